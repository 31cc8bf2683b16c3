"""What a step costs on ranks of several machines: the functions of bench/scaling. Seconds, bytes, metres.

A bed is a box of sides (x, y, z), periodic along x and y, in which grains of one mean diameter lie evenly. The program halves it into
chunks (src/dem/memory_order.cpp), and a rank has a stretch of them. What passes between ranks follows from the faces between
their parts.
"""
import math
from dataclasses import dataclass

import numpy as np

row_bytes = 72                  # of a ghost: x, v, omega
slot_bytes, link_bytes = 52, 4  # of a share: force, torque and whose it is; of a link: how many
rank_numbers = 6                # that a rank adds to the totals
dealt_from = 8                  # pieces that a rank's part is put together from, where there are many ranks


@dataclass
class Machine:
    latency: float = 1.5e-6         # s, between nodes
    bandwidth: float = 12e9         # B/s of a node, each way
    ranks_a_node: int = 64
    memory: float = 300e9           # B/s of a node
    near_latency: float = 0.35e-6   # s, within a node
    near_bandwidth: float = 9e9     # B/s, from rank to rank within a node
    posting: float = 0.25e-6        # s of a core, for a message's isend and irecv
    copying: float = 5e9            # B/s of one core that copies through memory
    cache: float = 5e6              # B of a rank
    grain_traffic: float = 450      # B from and to memory, a grain and step, beyond the cache: its rows, and those of two near pairs

    def nodes(self, ranks):
        return math.ceil(ranks / self.ranks_a_node)


def chunk_size(grains):
    return min(max((grains // 16 + 63) // 64 * 64, 128), 1024)


def chunk_count(grains):
    return -(-grains // chunk_size(grains))


def halved(sides, pieces):
    """Corners (low, high) of the pieces, in memory order, of a box that is halved along its longest side until they are of one size."""
    out = []

    def halve(low, high, count, round_):
        if count == 1:
            out.append((low, high))
            return
        length = [(high[a] - low[a]) * (0.4 if round_[a] else 1) for a in range(3)]
        axis = max(range(3), key=lambda a: length[a])
        first = (count + 1) // 2
        middle = low[axis] + (high[axis] - low[axis]) * first / count
        rest = [r and a != axis for a, r in enumerate(round_)]
        halve(low, [middle if a == axis else x for a, x in enumerate(high)], first, rest)
        halve([middle if a == axis else x for a, x in enumerate(low)], high, count - first, rest)
    halve([0.0] * 3, list(sides), pieces, [True, True, False])
    return np.array(out)


def dealt(pieces, ranks):
    """The rank of each of so many pieces of equal work."""
    first, before = [0], 0
    for c in range(pieces):
        if len(first) == ranks:
            break
        due, last_chance = ranks * (before + 0.5) >= pieces * len(first), pieces - c == ranks - len(first)
        if c > first[-1] and (due or last_chance):
            first.append(c)
        before += 1
    return np.searchsorted(first, np.arange(pieces), side="right") - 1


def meetings(sides, ranks, chunks, reach):
    """Area of the faces between parts of different ranks, and the pairs of ranks whose parts are within reach."""
    if ranks == 1:
        return 0.0, set()
    pieces = chunks if chunks <= 4096 else min(chunks, max(4096, dealt_from * ranks))
    box, rank = halved(sides, pieces), dealt(pieces, ranks)
    middle, half = box.mean(axis=1), 0.5 * (box[:, 1] - box[:, 0])
    area, pairs = 0.0, set()
    for i in range(pieces - 1):
        others = i + 1 + np.flatnonzero(rank[i + 1:] != rank[i])
        apart = np.abs(middle[others] - middle[i])
        image = np.empty_like(apart)
        for a in range(2):
            image[:, a] = sides[a] - apart[:, a]
        image[:, 2] = np.inf
        sum_, less = half[others] + half[i], 2 * np.minimum(half[others], half[i])
        gap, gap_round = apart - sum_, image - sum_
        near = np.all(np.minimum(gap, gap_round) < reach, axis=1)
        pairs.update((int(rank[i]), int(r)) for r in np.unique(rank[others[near]]))
        overlap = np.minimum(np.maximum(-np.minimum(gap, gap_round), 0), less)
        for a in range(3):
            faces = (np.abs(gap[:, a]) < 1e-9 * sides[a]).astype(int) + (np.abs(gap_round[:, a]) < 1e-9 * sides[a])
            area += float(np.sum(faces * np.prod(np.delete(overlap, a, axis=1), axis=1)))
    return area, pairs


@dataclass
class Bed:
    sides: tuple      # m
    grains: int
    diameter: float   # m, mean
    servos: int = 2


@dataclass
class Measured:
    """On one core, and of what passes between two ranks."""
    step_of_grain: dict      # s, by number of grains of the rank, alone on the machine
    beside: dict             # the same while the other core works, too
    ghosts_of_face: float    # a face of a squared diameter
    slots_of_ghost: float
    steps_of_search: float
    look: float              # s, for a grain among the cells of another rank
    tally: float             # s, of a chunk
    row: float               # s, to pack or unpack one
    state_bytes: float       # of a grain, with its contacts, in a state

    def grain(self, grains, ranks):
        """s of a step of a rank, for each of its grains: between those measured by the logarithm of their number, beyond as at the ends."""
        of = self.step_of_grain if ranks == 1 else self.beside
        known = sorted(of)
        return float(np.interp(math.log(grains), [math.log(n) for n in known], [of[n] for n in known]))


def traffic(bed, ranks, m, reach=1.2):
    """Ghosts, bytes of a step and messages of a step, of all ranks."""
    area, pairs = meetings(bed.sides, ranks, chunk_count(bed.grains), reach * bed.diameter)
    ghosts = m.ghosts_of_face * area / bed.diameter**2
    return dict(ghosts=ghosts, bytes=ghosts * (row_bytes + m.slots_of_ghost * slot_bytes), messages=2 * len(pairs))


def unevenness(chunks, ranks):
    """Grains of the rank that has the most, over the mean, where all chunks are alike."""
    return float(np.bincount(dealt(chunks, ranks)).max() * ranks / chunks)


def totals_bytes(chunks, ranks, servos, group=1):
    """Of all ranks' totals together; group: chunks that are added up before."""
    return 8 * ((servos + 2) * -(-chunks // group) + rank_numbers * ranks)


def gather(ranks, size, machine):
    """Of so many bytes in all, to all: by way. A rank takes all bytes in and hands them on, at a share of its node's memory."""
    if ranks == 1:
        return dict(ring=0.0, doubling=0.0, nodes=0.0)
    nodes, inside = machine.nodes(ranks), min(ranks, machine.ranks_a_node)
    slowest = machine.latency if nodes > 1 else machine.near_latency
    copies = max(size * (ranks - 1) / ranks / machine.near_bandwidth, 2 * size * inside / machine.memory)
    wire = size * (nodes - 1) / nodes / machine.bandwidth
    rounds_near, rounds_far = math.ceil(math.log2(inside)), math.ceil(math.log2(nodes))
    rounds = rounds_near * machine.near_latency + rounds_far * machine.latency
    return dict(ring=(ranks - 1) * slowest + max(wire, copies),   # each passes its neighbour's on, node beside node
                doubling=rounds + wire * inside + copies,         # all ranks of a node send at once, and the same
                nodes=rounds + rounds_near * machine.near_latency + wire + copies)  # one rank of a node sends, and deals out


def step(bed, ranks, m, machine, record_every=math.inf, group=1, way=None, shared=None):
    """Parts of a step's time, s, on the rank that is last.

    group: chunks added up before the gather.
    way: of the gather; None: the better of ring and doubling, of which an MPI chooses. shared: of traffic(), where known.
    """
    chunks = chunk_count(bed.grains)
    own, inside = bed.grains / ranks, min(ranks, machine.ranks_a_node)
    t = traffic(bed, ranks, m) if shared is None else shared
    uneven = unevenness(chunks, ranks)
    beyond_cache = max(0.0, own * machine.grain_traffic - machine.cache)
    even = max(own * m.grain(own, ranks), beyond_cache * inside / machine.memory)
    out = dict(grains=even, uneven=even * (uneven - 1))
    out["packing"] = 4 * t["ghosts"] / ranks * m.row  # rows and shares, packed and unpacked
    per_rank = t["messages"] / ranks
    out["posting"] = per_rank * machine.posting
    # What the wire takes beyond the pairs that need no ghosts: those of a third of the grains while rows are under way.
    far = machine.nodes(ranks) > 1
    wire = 2 * (machine.latency if far else machine.near_latency)
    wire += t["bytes"] / ranks / machine.near_bandwidth if not far else \
        t["bytes"] / machine.nodes(ranks) * far_share(ranks, machine) / machine.bandwidth
    out["waiting"] = max(0.0, wire - even / 3)
    ways = gather(ranks, totals_bytes(chunks, ranks, bed.servos, group), machine)
    out["totals"] = ways[way] if way else min(ways["ring"], ways["doubling"])
    if group > 1 and chunks / ranks < group:  # a group's ranks tell their first of their chunks
        out["totals"] += math.ceil(math.log2(group * ranks / chunks + 1)) * (machine.latency if far else machine.near_latency)
    out["sums"] = -(-chunks // group) * m.tally if ranks > 1 else 0.0
    out["search"] = search(bed, ranks, m, machine) / m.steps_of_search
    out["records"] = bed.grains * m.state_bytes * (1 / machine.bandwidth + 3 / machine.copying) / record_every if ranks > 1 else 0.0
    return out


def far_share(ranks, machine):
    """Of a rank's faces, those to other nodes: a block of its node's parts has so many on its outside."""
    side = min(ranks, machine.ranks_a_node) ** (1 / 3)
    return min(1.0, 1 / side)


def cells(bed):
    """Of the coarse grid, of which each rank sends a bit each."""
    most, width = max(4096.0, bed.grains / 64), 2.2 * bed.diameter / 2 * 1.05

    def along(w):
        return math.prod(max(1, math.floor(s / w)) for s in bed.sides)
    while along(width) > most:
        width *= 1.1
    return along(width)


def search(bed, ranks, m, machine):
    """What a search takes beyond that of one rank: cells to all, ranks that have none beside those of this one ruled out by their
    bits, a look for each grain at some 26 others, and parcels."""
    if ranks == 1:
        return 0.0
    bits = 8 * -(-cells(bed) // 64)
    ways = gather(ranks, bits * ranks, machine)
    near = min(ranks - 1, 26)
    look = (ranks - 1) * bits / 8 * 0.5e-9 + near * bed.grains / ranks * m.look
    latency = machine.latency if machine.nodes(ranks) > 1 else machine.near_latency
    return min(ways["ring"], ways["doubling"]) + look + near * 2 * 2 * (latency / 2 + machine.posting)
