#include "dem/cpu/bed.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "dem/body/plane_contact.hpp"
#include "dem/cpu/rows.hpp"
#include "dem/scene_check.hpp"
#include "dem/state_rows.hpp"

namespace moraine::dem::cpu {

namespace {

// Of the law between grains that the scene takes, as PairList has them.
unsigned remembered_parts(const Scene& scene) {
  unsigned parts = 0;
  with_laws(scene, [&]<class Row, Account account>() {
    unsigned bit = 1;
    MoreParts::for_each_memory([&]<class Part>() {
      if (Row::BetweenGrains::template remembers<Part, account>) parts |= bit;
      bit <<= 1;
    });
  });
  return parts;
}

std::vector<Chunk> chunks_of(const Bed& bed, const State& s, const BodyMotion& bodies) {
  const Index all = (bed.n + bed.order.chunk - 1) / bed.order.chunk;
  std::vector<Chunk> chunks(all);
  const unsigned parts = remembered_parts(bed.scene);
  for (Index c = 0; c < static_cast<Index>(chunks.size()); ++c) {
    Chunk& chunk = chunks[c];
    for (PairList* list : {&chunk.near[0], &chunk.near[1], &chunk.spare}) list->remembered = parts;
    chunk.number = c;
    chunk.near_margin = 1e-4 * bed.r_max;
    chunk.begin = bed.order.begin_of(c), chunk.end = std::min(bed.n, bed.order.begin_of(c + 1));
    for (int k = 0; k < bodies.servos; ++k)
      for (Index i = chunk.begin; i < chunk.end; ++i)
        if (s.part_of[i] == bodies.servo[k].body) chunk.members[k].push_back(i);
  }
  return chunks;
}

const ContactParameters& between(const Bed& bed, Index i, Index j) {
  return bed.scene.between(bed.material_of(i), bed.material_of(j));
}

// Of a grain that is known by its number alone.
Bed::Ghost stranger(Index number, Material material) {
  return {{{0, 0, 0}, 0, {0, 0, 0}, 0, {0, 0, 0}, 0, {0, 0, 0}, 0}, number, BodyId::none, material};
}

Index row_of(const Bed& bed, Index number) {
  if (number < bed.n) return number;
  const auto at = std::ranges::lower_bound(bed.ghost_number, number);
  return bed.n + static_cast<Index>(at - bed.ghost_number.begin());
}

// As near pairs, from which the search takes their springs. Contacts are sorted.
void place_contacts(Bed& bed, const std::vector<Contact>& contacts) {
  auto contact = contacts.begin();
  for (Chunk& chunk : bed.chunks)
    for (; contact != contacts.end() && contact->i < chunk.end; ++contact) {
      const auto& [i, number, spring] = *contact;
      const Index j = row_of(bed, number);
      const int part = j < chunk.end ? 0 : 1;
      const Index place =
          chunk.near[part].add(i, j, 0, false, remembered(bed.scene, between(bed, i, j), spring));
      chunk.candidates[part].push_back({i, j, no_link, place});
    }
}

void place_plane_contacts(Bed& bed, const std::vector<WallContact>& contacts, const BodyMotion& bodies) {
  for (const WallContact& w : contacts)
    if (const Plane* plane = bodies.find(w.wall))
      bed.chunks[bed.order.chunk_of(w.i)].planes.push_back(
          {w.i, static_cast<std::int32_t>(plane - bodies.plane),
           remembered(bed.scene, bed.scene.between(bed.material_of(w.i), plane->material), w.spring)});
  for (Chunk& chunk : bed.chunks)
    std::ranges::sort(chunk.planes, {}, [](const PlanePair& p) { return std::tuple(p.i, p.plane); });
}

// The ghosts that contacts of a part name: its list of materials goes on with theirs.
std::vector<Bed::Ghost> strangers(const State& state, Index n) {
  std::vector<Index> numbers;
  for (const Contact& c : state.contacts)
    if (c.j >= n) numbers.push_back(c.j);
  std::ranges::sort(numbers);
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  std::vector<Bed::Ghost> ghosts;
  for (const Index number : numbers)
    ghosts.push_back(
        stranger(number, state.material.empty() ? Material::grain : state.material[n + ghosts.size()]));
  return ghosts;
}

template <class Number>
double sum_over_bed(const Bed& bed, std::int64_t step, Number&& number) {
  double sum = 0;
  for_each_tally(bed, step, [&](const Chunk::Tally& tally) { sum += number(tally); });
  return sum;
}

}  // namespace

Part Part::whole(const Scene& scene, const State& state) {
  return {.all = state.size(),
          .first_chunks = {0, chunk_count(state.size())},
          .r_max = *std::max_element(state.r.begin(), state.r.end()),
          .margin = neighbour_margin(scene, state),
          .widest_margin = dem::widest_margin(scene, state)};
}

void Bed::set_ghosts(const std::vector<Ghost>& ghosts) {
  const auto all = static_cast<Index>(n + ghosts.size());
  if (grain.size() < all + 1) {
    Host::Array<GrainRow> larger;
    larger.resize(all + 1);
    std::copy(grain.data(), grain.data() + n, larger.data());
    grain = std::move(larger);
  }
  ghost_number.clear();
  part_of.resize(n);
  const bool one_material = material.empty();
  if (!one_material) material.resize(n);
  for (const Ghost& ghost : ghosts) {
    grain.data()[n + ghost_number.size()] = ghost.row;
    ghost_number.push_back(ghost.number);
    part_of.push_back(ghost.part_of);
    if (!one_material) material.push_back(ghost.material);
  }
  order.material = one_material ? nullptr : material.data();
  // One grain that never touches, for the last lanes of a list; at no round place, lest a grain be there.
  grain.data()[all] = {
      {-987654321.12, -876543210.98, -765432109.87}, -1e9, {0, 0, 0}, -1e9, {0, 0, 0}, 0, {0, 0, 0}, 0};
}

void Bed::load_state(const Scene& s, const State& state, const Part& of, const BodyMotion& bodies) {
  scene = s, sides = Sides::of(s), uses = uses_of(s), part = of;
  n = state.size();
  r_max = part.r_max;
  margin = part.margin;
  searched.resize(n);
  part_of = state.part_of;
  material.assign(state.material.begin(), state.material.begin() + (state.material.empty() ? 0 : n));
  order = {chunk_size(part.all)};

  grain.resize(n + 1), load.resize(n);
  water.resize(uses.water ? n : 0);
  const std::vector<GrainRow> rows = grain_rows(s, state);
  std::copy(rows.begin(), rows.end(), grain.data());
  for (Index i = 0; i < n; ++i) load.data()[i] = {state.force[i], 0, state.torque[i], 0};
  for (Index i = 0; i < static_cast<Index>(water.size()); ++i)
    water.data()[i] = {state.staggered ? state.water_force[i] : Vec3d{0, 0, 0}, 0};
  set_ghosts(strangers(state, n));

  chunks = chunks_of(*this, state, bodies);
  for (Chunk& chunk : chunks)
    for (Index i = chunk.begin; i < chunk.end; ++i)
      for (int a = 0; a < 3; ++a) {
        double& fastest = chunk.at(bodies.step - 1).fastest2[a];
        fastest = std::max(fastest, rows[i].v[a] * rows[i].v[a]);
      }
  place_contacts(*this, state.contacts);
  place_plane_contacts(*this, state.wall_contacts, bodies);
}

Reaction sum_reactions(const Bed& bed, const BodyMotion& bodies) {
  const auto sum = [&](auto&& number) {
    return sum_over_bed(bed, bodies.step, [&](const Chunk::Tally& t) { return number(t.reaction); });
  };
  Reaction total;
  for (int k = 0; k < bodies.servos; ++k) total.force[k] = sum([k](const Reaction& r) { return r.force[k]; });
  return total;
}

Dissipation sum_dissipation(const Bed& bed, std::int64_t step) {
  return {sum_over_bed(bed, step, [](const Chunk::Tally& t) { return t.lost.slip; }),
          sum_over_bed(bed, step, [](const Chunk::Tally& t) { return t.lost.viscous; })};
}

Dissipation pending_dissipation(const Bed& bed) {
  const Part& part = bed.part;
  std::vector<Dissipation> of_chunk(part.first_chunks.back());
  for (const Chunk& c : bed.chunks) {
    ChunkSum slip, viscous;
    for (Index i = c.begin; i < c.end; ++i)
      slip.add(i, bed.load.data()[i].slip), viscous.add(i, bed.load.data()[i].viscous);
    of_chunk[part.first_chunk() + c.number] = {slip.total(), viscous.total()};
  }
  if (part.ranks) {
    std::vector<std::size_t> begin;
    for (const Index c : part.first_chunks) begin.push_back(c * sizeof(Dissipation));
    part.ranks->gather(of_chunk.data(), begin);
  }
  Dissipation sum;
  for (const Dissipation& d : of_chunk) sum.slip += d.slip, sum.viscous += d.viscous;
  return sum;
}

void measure_ways(const Bed& bed, Chunk& chunk, std::int64_t step) {
  double first = 0, second = 0;
  for (Index i = chunk.begin; i < chunk.end; ++i) {
    const Vec3d way = bed.grain.data()[i].x - bed.searched.data()[i].x;
    const double way2 = dot(way, way);
    second = std::max(second, std::min(first, way2)), first = std::max(first, way2);
  }
  chunk.at(step).ways2[0] = first, chunk.at(step).ways2[1] = second;
}

double approach_since_search(const Bed& bed, const BodyMotion& bodies) {
  double first = 0, second = 0;
  const auto count = [&](double way2) {
    second = std::max(second, std::min(first, way2)), first = std::max(first, way2);
  };
  for_each_tally(bed, bodies.step - 1, [&](const Chunk::Tally& tally) {
    for (const double way2 : tally.ways2) count(way2);
  });
  for (int k = 0; k < bodies.planes; ++k) {
    const double way = bodies.plane[k].place - bed.plane_searched[k];
    count(way * way);
  }
  return (1 + 1e-9) * (std::sqrt(first) + std::sqrt(second));
}

double fastest(const Bed& bed, const BodyMotion& bodies) {
  double v2[3] = {0, 0, 0};
  for_each_tally(bed, bodies.step - 1, [&](const Chunk::Tally& tally) {
    for (int a = 0; a < 3; ++a) v2[a] = std::max(v2[a], tally.fastest2[a]);
  });
  return std::max(std::sqrt(v2[0] + v2[1] + v2[2]), bodies.fastest_plane());
}

void check_lost(const Bed& bed, const BodyMotion& bodies, const std::vector<Index>& id) {
  for (const Chunk& chunk : bed.chunks)
    for (Index i = chunk.begin; i < chunk.end; ++i)
      if (is_lost(bodies, bed.grain.data()[i]))
        throw lost_grain(bed.scene, bodies, bed.grain.data()[i], id[i]);
}

}  // namespace moraine::dem::cpu
