"""A vertical section through the bed, as in Fig. 10: discs where spheres meet a plane, how they move, turn and slip."""
from dataclasses import dataclass

import numpy as np

from .forces import strongest_contacts


def contact_velocity(snapshot):
    """Of the surface of i over that of j at each contact, tangential part, m/s, n x 3 (eq. 7 with the lever arms of eq. 4).

    v_c = v_i - v_j + l_i n x omega_i + l_j n x omega_j with l = r + delta_n / 2, less its part along n. A contact that holds has
    nearly none: only what stretches its spring."""
    g, c = snapshot.grains, snapshot.contacts
    i, j, r = c["i"], c["j"], g["radius"]
    branch = snapshot.branches()
    n = branch / np.linalg.norm(branch, axis=1, keepdims=True)
    arm_i, arm_j = (r[i] - c["overlap"] / 2)[:, None], (r[j] - c["overlap"] / 2)[:, None]
    v = g["velocity"][i] - g["velocity"][j] + np.cross(n, arm_i * g["spin"][i] + arm_j * g["spin"][j])
    return v - np.sum(v * n, axis=1)[:, None] * n


@dataclass
class Section:
    """In the plane y; vectors are their (x, z) components, SI units."""
    y: float
    width: float             # of the box in x, m; x and the discs' copies may lie up to a radius outside 0 ... width
    z_range: tuple           # m
    grain: np.ndarray        # row of each disc's grain; one that crosses a side in x has two discs
    centre: np.ndarray       # n x 2
    radius: np.ndarray       # of the disc, at most that of the grain
    grain_radius: np.ndarray
    role: np.ndarray
    pressure: np.ndarray
    velocity: np.ndarray     # n x 2
    spin: np.ndarray         # about y, rad/s; positive: the top of the disc moves towards +x (par. 43)
    contact: np.ndarray      # rows of the contacts near the plane
    point: np.ndarray        # m x 2
    slip: np.ndarray         # m x 2, of the upper grain over the lower one


def section(snapshot, y=None, z_range=None, reach=None):
    """Discs where spheres meet the plane y (m, default: the middle of the box) with centres within z_range (m), as in Fig. 10.

    Contacts are those whose point lies within reach of the plane (m, default: half a mean radius)."""
    g, c = snapshot.grains, snapshot.contacts
    lx, ly = snapshot.box[:2]
    y = ly / 2 if y is None else y
    reach = g["radius"].mean() / 2 if reach is None else reach
    low, high = (-np.inf, np.inf) if z_range is None else z_range

    def off(places):
        d = places[:, 1] - y
        return np.abs(d - ly * np.round(d / ly))

    def shown(z):
        return (z >= low) & (z <= high)

    x, r = g["position"], g["radius"]
    cut2 = r**2 - off(x)**2
    grain = np.flatnonzero((cut2 > 0) & shown(x[:, 2]))
    disc = np.sqrt(cut2[grain])
    left, right = x[grain, 0] < disc, x[grain, 0] > lx - disc  # copies of what crosses a side
    shift = np.concatenate([np.zeros(len(grain)), np.full(left.sum(), lx), np.full(right.sum(), -lx)])
    disc = np.concatenate([disc, disc[left], disc[right]])
    grain = np.concatenate([grain, grain[left], grain[right]])

    near = np.flatnonzero((off(c["point"]) <= reach) & shown(c["point"][:, 2]))
    upper = np.where(snapshot.branches()[near, 2] >= 0, 1, -1)  # turned round where i is the lower grain
    centre = x[grain][:, [0, 2]] + np.column_stack([shift, 0 * shift])
    return Section(y, lx, (low, high), grain, centre, disc, r[grain], g["role"][grain], g["pressure"][grain],
                   g["velocity"][grain][:, [0, 2]], g["spin"][grain, 1],
                   near, c["point"][near][:, [0, 2]], upper[:, None] * contact_velocity(snapshot)[near][:, [0, 2]])


def opposite_spins(snapshot, strongest=1.0):
    """Share of the free contacts, or of the strongest of them by |f_n|, whose grains' spins oppose each other (par. 44).

    Opposed means omega_i . omega_j < 0: one half where neighbours turn independently and without a common sense."""
    rows, spin = strongest_contacts(snapshot, strongest), snapshot.grains["spin"]
    return float(np.mean(np.sum(spin[snapshot.contacts["i"][rows]] * spin[snapshot.contacts["j"][rows]], axis=1) < 0))
