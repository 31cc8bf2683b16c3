// Forces of near pairs, four at a time in SIMD lanes.
//
// Short phases over a block of groups: gather rows and turn them into lanes, the three parts of the law, turn
// back and add up. One group alone is a long chain of dependent operations; in phases the processor works on
// several at once.
#include <algorithm>
#include <tuple>
#include <type_traits>

#include "dem/cpu/rows.hpp"
#include "dem/cpu/tasks.hpp"

namespace moraine::dem::cpu {

namespace {

constexpr int block_pairs = 16;  // that go through the phases together

// Where j's share of a pair goes.
enum class Shares { in_place, to_slots };

// What the loop reads of a group of pairs.
struct Gathered {
  Vec3<Pack> x_ij;
  Pack r_sum, r_difference;
  Motion<Pack> before;
};

template <class L>
inline void gather(const Rows& rows, const Line& difference, const Sides& sides, const PairGroup& p,
                   bool across_sides, Gathered& q) {
  Line lines[lanes];
  Pack c[8];
  for (int k = 0; k < lanes; ++k)
    lines[k] = fma(difference, line(rows.grain(p.j[k])), line(rows.grain(p.i[k])));
  to_columns(lines, c);
  Vec3<Pack> x_ij{c[0], c[1], c[2]};
  if (across_sides) x_ij = nearest_image(sides, x_ij);
  q.x_ij = x_ij, q.r_sum = c[7], q.r_difference = c[3];
  q.before.v = {c[4], c[5], c[6]};
  if constexpr (L::rubs) {
    for (int k = 0; k < lanes; ++k) lines[k] = {row(rows.grain(p.i[k]).omega), row(rows.grain(p.j[k]).omega)};
    to_columns(lines, c);
    q.before.omega_i = {c[0], c[1], c[2]}, q.before.omega_j = {c[4], c[5], c[6]};
  }
}

// Turns what a group's pairs do to their grains back into lines and adds them up, or leaves j's share in its
// slot.
template <class L, Shares shares>
inline void scatter(const PairGroup& p, const Geometry<Pack>& at, const Action<Pack>& a, LoadRow* load,
                    LoadRow* slot) {
  const auto row_at = [](LoadRow* first, Offset o) -> double* {
    return reinterpret_cast<double*>(reinterpret_cast<char*>(first) + o);
  };
  constexpr bool to_slots = shares == Shares::to_slots;
  const Pack columns[8] = {a.f.x, a.f.y, a.f.z, a.slip, a.f_x_n.x, a.f_x_n.y, a.f_x_n.z, a.viscous};
  Line action[lanes];
  to_lines(columns, action);
  for (int k = 0; k < lanes; ++k) {
    double *const on_i = row_at(load, p.i[k]), *const on_j = row_at(to_slots ? slot : load, p.target[k]);
    const double l_i = L::rubs ? at.l_i[k] : 0, l_j = L::rubs ? at.l_j[k] : 0;
    fma(Line{1.0, Row(l_i, l_i, l_i, 1)}, action[k], Line::load(on_i)).store(on_i);
    const Line factor{Row(-1, -1, -1, 0), Row(l_j, l_j, l_j, 0)};
    (to_slots ? factor * action[k] : fma(factor, action[k], Line::load(on_j))).store(on_j);
  }
}

// What the law remembers of a group, and no more.
template <class L, Account account>
inline Spring<Pack> recalled(const PairList& list, std::int64_t group) {
  Spring<Pack> spring;
  MoreParts::for_each_memory([&]<class Part>() {
    if constexpr (L::template remembers<Part, account>)
      static_cast<typename Part::template Memory<Pack>&>(spring) = list.of<Part>()[group];
  });
  return spring;
}
template <class L, Account account>
inline void remember(const Spring<Pack>& spring, PairList& list, std::int64_t group) {
  MoreParts::for_each_memory([&]<class Part>() {
    if constexpr (L::template remembers<Part, account>) list.of<Part>()[group] = spring;
  });
}

template <class L, Account account, Shares shares>
[[gnu::flatten]] void list_forces(Bed& bed, PairList& list, double dt, LoadRow* load) {
  constexpr int group_block = block_pairs / lanes;
  const Rows rows(bed.grain);
  const ContactParameters law = bed.scene.with(Material::grain);
  const Sides sides = bed.sides;
  const Line difference = i_minus_j();
  LoadRow* const slot = bed.slot.data();

  Gathered motion[group_block];
  Geometry<Pack> geometry[group_block];
  Slide<Pack> slides[group_block];
  Vec3<Pack> delta_t[group_block], v[group_block];
  Grip<Pack> grips[group_block];

  const auto v_c = [&](int g) -> const Vec3<Pack>& {
    if constexpr (L::rubs)
      return slides[g].v_c;
    else
      return motion[g].before.v;
  };
  const auto groups = static_cast<std::int64_t>(list.pairs.size());
  for (std::int64_t start = 0; start < groups; start += group_block) {
    const int block = static_cast<int>(std::min<std::int64_t>(group_block, groups - start));

    for (int g = 0; g < block; ++g)
      gather<L>(rows, difference, sides, list.pairs[start + g], list.across_sides[start + g], motion[g]);
    for (int g = 0; g < block; ++g) {
      geometry[g] = between_grains(motion[g].x_ij, motion[g].r_sum, motion[g].r_difference);
      if constexpr (L::rubs) slides[g] = slide(dt, geometry[g], motion[g].before);
    }
    for (int g = 0; g < block; ++g) {
      const PairGroup& later = list.pairs[std::min(start + g + group_block, groups - 1)];
      for (const Offset j : later.j)
        __builtin_prefetch(&rows.grain(j).x), __builtin_prefetch(&rows.grain(j).omega);
      const Spring<Pack> spring = recalled<L, account>(list, start + g);
      if constexpr (L::rubs) delta_t[g] = carry(dt, geometry[g], slides[g], spring.delta_t);
      v[g] = velocity_at_step<L>(dt, v_c(g), spring);
      grips[g] = grip<L>(law, geometry[g], v[g], delta_t[g], spring);
    }
    for (int g = 0; g < block; ++g) {
      const PairGroup& p = list.pairs[start + g];
      const Geometry<Pack>& at = geometry[g];
      Spring<Pack> spring = recalled<L, account>(list, start + g);
      const Action<Pack> a = act<L, account>(law, dt, at, v_c(g), v[g], delta_t[g], grips[g], spring);
      remember<L, account>(spring, list, start + g);
      scatter<L, shares>(p, at, a, load, slot);
    }
  }
}

template <class L, Account account>
void pair_forces(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  list_forces<L, account, Shares::in_place>(bed, chunk.near[0], at.dt, at.load);
  list_forces<L, account, Shares::to_slots>(bed, chunk.near[1], at.dt, at.load);
}

}  // namespace

ChunkTask pair_forces_for(const Scene& scene) {
  ChunkTask task = nullptr;
  with_laws(scene,
            [&]<class Row, Account account>() { task = &pair_forces<typename Row::BetweenGrains, account>; });
  return task;
}

}  // namespace moraine::dem::cpu
