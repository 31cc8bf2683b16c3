#include "dem/cpu/neighbour_lists.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <tuple>

#include "dem/body/plane_contact.hpp"
#include "dem/cpu/rows.hpp"

namespace moraine::dem::cpu {

namespace {

// How long near pairs should last: drawing them costs as much as a step or two, but a wider margin has more
// pairs that do not touch.
constexpr int steps_foreseen = 48;
constexpr int fewest_steps = 24, most_steps = 128;
constexpr double least_near_margin = 1e-6;  // of the largest radius

// Places in the near list of the candidates that a chunk had; j by number.
class OldPlaces {
 public:
  OldPlaces(const Chunk& chunk, const std::vector<Candidate>& old)
      : begin_(chunk.begin), first_(chunk.end - chunk.begin + 2) {
    for (const Candidate& c : old)
      if (c.place != not_near) ++first_[c.i - begin_ + 2];
    for (std::size_t k = 2; k < first_.size(); ++k) first_[k] += first_[k - 1];
    known_.resize(first_.back());
    for (const Candidate& c : old)
      if (c.place != not_near) known_[first_[c.i - begin_ + 1]++] = {c.j, c.place};
  }
  Index of(Index i, Index j) const {
    for (Index k = first_[i - begin_]; k < first_[i - begin_ + 1]; ++k)
      if (known_[k].j == j) return known_[k].place;
    return not_near;
  }

 private:
  struct Known {
    Index j, place;
  };
  Index begin_;
  std::vector<Index> first_;  // of each grain, in known_
  std::vector<Known> known_;
};

template <class Work>
void for_each_chunk(const Host& space, Bed& bed, Work&& work) {
  run_team(space.threads, [&](int thread) {
    for (Chunk& chunk : bed.chunks)
      if (chunk.owner == thread) work(chunk);
  });
}

// Pairs that the grains of one chunk find, each pair once by one of its grains; the other may be of an
// earlier chunk, whose pair it then is.
void find_pairs(const Bed& bed, Chunk& chunk, const CloseGrains& grains) {
  const BodyId* const part_of = bed.part_of.data();
  for (auto& [of, pairs] : chunk.found) pairs.clear();
  std::vector<GrainPair>& own = chunk.found[chunk.number];
  for (Index a = chunk.begin; a < chunk.end; ++a) {
    const bool free = part_of[a] == BodyId::none;
    grains.after(grains.place(a), bed.margin, [&](Index k, double, double) {
      const Index b = grains.grain(k);
      if (!free && bed.scene.never_touch(part_of[a], part_of[b])) return;
      const GrainPair pair{std::min(a, b), std::max(a, b)};
      (pair.i >= chunk.begin ? own : chunk.found[bed.order.chunk_of(pair.i)]).push_back(pair);
    });
  }
}

// Those that ghosts find of this rank's grains.
FoundPairs pairs_of_ghosts(const Bed& bed, const CloseGrains& grains) {
  FoundPairs found;
  for (Index a = bed.n; a < bed.nobody(); ++a)
    grains.after(grains.place(a), bed.margin, [&](Index k, double, double) {
      const Index b = grains.grain(k);
      if (b >= bed.n || bed.scene.never_touch(bed.part_of[a], bed.part_of[b])) return;
      found[bed.order.chunk_of(b)].push_back({b, a});
    });
  return found;
}

// Pairs of one chunk that all have found, by pair of materials and (i, j).
std::vector<GrainPair> sorted_pairs(const Bed& bed, const Chunk& chunk, const FoundPairs& by_ghosts) {
  std::vector<std::size_t> row(chunk.end - chunk.begin + 2);  // where that of i ends, two places on
  const auto ghosts = by_ghosts.find(chunk.number);
  const auto each = [&](auto&& use) {
    for (const Index from : chunk.finders)
      for (const GrainPair& pair : bed.chunks[from].found.at(chunk.number)) use(pair, pair.i - chunk.begin);
    if (ghosts != by_ghosts.end())
      for (const GrainPair& pair : ghosts->second) use(pair, pair.i - chunk.begin);
  };
  each([&](const GrainPair&, Index at) { ++row[at + 2]; });
  for (std::size_t k = 2; k < row.size(); ++k) row[k] += row[k - 1];
  std::vector<GrainPair> pairs(row.back());
  each([&](const GrainPair& pair, Index at) { pairs[row[at + 1]++] = pair; });
  for (std::size_t k = 0; k + 1 < row.size(); ++k)
    std::sort(pairs.begin() + static_cast<std::ptrdiff_t>(row[k]),
              pairs.begin() + static_cast<std::ptrdiff_t>(row[k + 1]),
              [](const GrainPair& a, const GrainPair& b) { return a.j < b.j; });
  if (bed.order.material)
    std::ranges::stable_sort(pairs, {}, [&](const GrainPair& p) { return bed.order.pair(p.i, p.j); });
  return pairs;
}

// Candidates of one chunk, in that order, and how many go to each later chunk.
void take_pairs(const Bed& bed, Chunk& chunk, const FoundPairs& by_ghosts) {
  const OldPlaces inside(chunk, chunk.candidates[0]), across(chunk, chunk.candidates[1]);
  chunk.candidates[0].clear(), chunk.candidates[1].clear();
  chunk.outgoing.clear();
  for (const auto& [i, j] : sorted_pairs(bed, chunk, by_ghosts)) {
    if (j < chunk.end) {
      chunk.candidates[0].push_back({i, j, no_link, inside.of(i, j)});
      continue;
    }
    const Index to = bed.order.chunk_of(bed.number(j));
    auto link = std::ranges::find(chunk.outgoing, to, &Outgoing::to);
    if (link == chunk.outgoing.end()) link = chunk.outgoing.insert(link, {to, 0});
    ++link->size;
    chunk.candidates[1].push_back(
        {i, j, static_cast<Index>(link - chunk.outgoing.begin()), across.of(i, bed.number(j))});
  }
}

// from_others: of earlier ranks, in their order.
void lay_out_links(Bed& bed, const std::vector<Outgoing>& from_others) {
  const auto chunks = static_cast<Index>(bed.chunks.size());
  std::int64_t slots = 1;  // the first one is for pads
  bed.links.clear();
  const auto add = [&](Index from, const Outgoing& to) {
    const auto link = static_cast<Index>(bed.links.size());
    bed.links.push_back({from, to.to, static_cast<Index>(slots), 0, to.size});
    slots += to.size;
    if (to.to < chunks) bed.chunks[to.to].incoming.push_back(link);
  };
  for (Chunk& chunk : bed.chunks) chunk.incoming.clear(), chunk.needs_ghosts = chunk.has_ghosts = false;
  for (const Outgoing& link : from_others) add(-1, link), bed.chunks[link.to].has_ghosts = true;
  for (Chunk& chunk : bed.chunks) {
    chunk.first_link = static_cast<Index>(bed.links.size());
    for (const Outgoing& out : chunk.outgoing)
      add(chunk.number, out), chunk.needs_ghosts = chunk.needs_ghosts || out.to >= chunks;
  }
  if (std::max<std::int64_t>(bed.nobody() + 1, slots) * row_bytes > std::numeric_limits<Offset>::max())
    throw error("too many grains for one process: ", bed.nobody(), " grains and ", slots,
                " pairs across chunks; there is room for 67 million of each; use more ranks");
  bed.slot.resize(slots), bed.slot_owner.resize(slots);
  clear(bed.slot);
}

// far: m, gaps from which on pairs are not watched either.
void draw_pairs(Bed& bed, Chunk& chunk, int part, double far) {
  const GrainRow* const grain = bed.grain.data();
  const Line difference = i_minus_j();
  const Pack foreseen(-steps_foreseen * bed.scene.dt);
  PairList& old = chunk.near[part];
  PairList& list = chunk.spare;
  WatchList& watched = chunk.watched[part];
  list.clear(), watched.clear();
  const auto fill_up = [&] { list.pad(chunk.begin, bed.nobody(), part == 1 ? 0 : chunk.begin); };
  std::vector<Candidate>& candidates = chunk.candidates[part];
  for (std::size_t start = 0; start < candidates.size(); start += Pack::width) {
    const int used = static_cast<int>(std::min<std::size_t>(Pack::width, candidates.size() - start));
    Line lines[Pack::width];
    Pack c[8];
    for (int k = 0; k < Pack::width; ++k) {
      const Candidate& q = candidates[start + std::min(k, used - 1)];
      lines[k] = fma(difference, line(grain[q.j]), line(grain[q.i]));
    }
    to_columns(lines, c);
    const Vec3<Pack> plain{c[0], c[1], c[2]}, d = nearest_image(bed.sides, plain), shift = d - plain;
    // How far the two come closer while the list lasts, if they go on as they do.
    const Pack closing = max(dot(Vec3<Pack>{c[4], c[5], c[6]}, d) * foreseen / c[7], Pack(0.0));
    const Pack reach = c[7] + closing + Pack(chunk.near_margin);
    const Pack distance2 = dot(d, d), across = dot(shift, shift), sight = c[7] + Pack(far);
    const unsigned near = bits(distance2 < reach * reach), seen = bits(distance2 < sight * sight);
    const unsigned over = bits(across > Pack(0.0));
    for (int k = 0; k < used; ++k) {
      Candidate& q = candidates[start + k];
      const bool across_sides = over >> k & 1;
      // One that has just opened, however far, still gives up what its spring held.
      if (!(near >> k & 1) && (q.place == not_near || !old.remembers(q.place))) {
        q.place = not_near;
        if (seen >> k & 1) watched.add(q.i, q.j, across_sides);
        continue;
      }
      Index target = q.j;
      if (q.link != no_link) {
        Link& link = bed.links[chunk.first_link + q.link];
        target = link.first + link.used++;
        bed.slot_owner.data()[target] = q.j;
      }
      if (const int pair = bed.order.pair(q.i, q.j);
          list.runs.empty() || list.runs.back().materials != pair) {
        fill_up();
        list.begin_run(pair);
      }
      const Spring<double> spring = q.place == not_near ? Spring<double>{} : old.spring(q.place);
      q.place = list.add(q.i, q.j, target, across_sides, spring);
    }
  }
  fill_up();
  std::swap(old, list);
}

void find_plane_pairs(Bed& bed, Chunk& chunk, const BodyMotion& bodies) {
  std::vector<PlanePair> pairs;
  auto known = chunk.planes.begin();
  const auto at = [](const PlanePair& p) { return std::tie(p.i, p.plane); };
  for (Index i = chunk.begin; i < chunk.end; ++i) {
    if (!meets_planes(bed.scene, bed.part_of.data()[i])) continue;
    const GrainRow& g = bed.grain.data()[i];
    for (std::int32_t k = 0; k < bodies.planes; ++k) {
      if (!(bodies.plane[k].gap(g.x, g.r) < bed.margin)) continue;
      while (known != chunk.planes.end() && at(*known) < std::tie(i, k)) ++known;
      const bool same = known != chunk.planes.end() && at(*known) == std::tie(i, k);
      pairs.push_back(same ? *known : PlanePair{i, k, {}});
    }
  }
  chunk.planes = std::move(pairs);
}

void draw_near_pairs(Bed& bed, Chunk& chunk, const Closing& closing) {
  const double far = std::max(most_steps * closing.in_step, least_near_margin * bed.r_max);
  chunk.near_until = closing.so_far + far;
  chunk.apart_until = closing.so_far, chunk.steps_near = 0, ++chunk.times_drawn;
  for (std::size_t l = 0; l < chunk.outgoing.size(); ++l) bed.links[chunk.first_link + l].used = 0;
  for (int part = 0; part < 2; ++part) draw_pairs(bed, chunk, part, far);
}

// A lower bound on the gaps of all pairs, m; not positive where one touches.
double least_gap(const Bed& bed, const WatchList& watched) {
  const Rows rows(bed.grain);
  const Row difference(-1, -1, -1, 1), slack(1 + 1e-12);
  Pack least(bed.r_max * bed.r_max);  // of d^2 - R^2 = gap (2 R + gap)
  for (std::size_t g = 0; g < watched.pairs.size(); ++g) {
    const WatchList::Group& p = watched.pairs[g];
    Row c[Pack::width];
    for (int k = 0; k < Pack::width; ++k)
      c[k] = fma(difference, row(rows.grain(p.j[k])), row(rows.grain(p.i[k])));
    transpose(c[0], c[1], c[2], c[3]);
    Vec3<Pack> d{c[0], c[1], c[2]};
    if (p.across_sides) d = nearest_image(bed.sides, d);
    const Pack reach = slack * c[3];
    least = min(fnma(reach, reach, dot(d, d)), least);
  }
  double l = least[0];
  for (int k = 1; k < Pack::width; ++k) l = std::min(l, least[k]);
  const double r2 = 2 * bed.r_max;
  return l / (r2 + std::sqrt(r2 * r2 + std::max(l, 0.0)));
}

// Candidates of all chunks, their links by number of the chunk alone.
void find_all_pairs(const Host& space, Bed& bed, const CloseGrains& grains, const BodyMotion& bodies) {
  for_each_chunk(space, bed, [&](Chunk& chunk) { find_pairs(bed, chunk, grains); });
  const FoundPairs by_ghosts = pairs_of_ghosts(bed, grains);
  for (Chunk& chunk : bed.chunks) chunk.finders.clear();
  for (const Chunk& chunk : bed.chunks)
    for (const auto& [of, pairs] : chunk.found)
      if (!pairs.empty()) bed.chunks[of].finders.push_back(chunk.number);
  for_each_chunk(space, bed, [&](Chunk& chunk) {
    take_pairs(bed, chunk, by_ghosts);
    find_plane_pairs(bed, chunk, bodies);
    for (Index i = chunk.begin; i < chunk.end; ++i) bed.searched.data()[i].x = bed.grain.data()[i].x;
  });
  for (int k = 0; k < bodies.planes; ++k) bed.plane_searched[k] = bodies.plane[k].place;
}

}  // namespace

double find_candidates(const Host& space, Bed& bed, CloseGrains& grains, const Control& control,
                       Traffic* traffic) {
  const BodyMotion& bodies = control.bodies;
  if (traffic) traffic->fetch_ghosts(bed);
  on_all_ranks(bed.part.ranks, [&] {
    grains.sort(space, bed.scene, bed.grain.data(), bed.nobody(), bed.margin);
    find_all_pairs(space, bed, grains, bodies);
  });
  std::vector<Outgoing> from_others;
  if (traffic) from_others = traffic->keep_ghosts(bed);
  on_all_ranks(bed.part.ranks, [&] { lay_out_links(bed, from_others); });
  if (traffic) traffic->lay_out(bed);
  const auto began = std::chrono::steady_clock::now();
  const Closing closing{control.travelled, 2 * fastest(bed, bodies) * bed.scene.dt};
  for_each_chunk(space, bed, [&](Chunk& chunk) {
    draw_near_pairs(bed, chunk, closing);
    chunk.times_drawn = 0;
  });
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
}

void renew_near_pairs(Bed& bed, Chunk& chunk, const Closing& closing) {
  ++chunk.steps_near;
  const bool due = closing.so_far >= chunk.near_until;
  if (!due && closing.so_far < chunk.apart_until) return;
  const double gap = std::min(least_gap(bed, chunk.watched[0]), least_gap(bed, chunk.watched[1]));
  if (!(gap > 0)) {
    if (chunk.steps_near < fewest_steps) chunk.near_margin = std::min(1.5 * chunk.near_margin, bed.margin);
  } else if (due) {
    chunk.near_margin = std::max(0.75 * chunk.near_margin, least_near_margin * bed.r_max);
  } else {
    chunk.apart_until = closing.so_far + (1 - 1e-9) * gap;
    return;
  }
  draw_near_pairs(bed, chunk, closing);
}

}  // namespace moraine::dem::cpu
