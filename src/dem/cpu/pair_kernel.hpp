// The loop over near pairs: as many at a time as P, a Pack or a Wide, has lanes.
//
// Short phases over a block of packs: gather rows and turn them into lanes, the three parts of the law, turn
// back and add up. One pack alone is a long chain of dependent operations; in phases the processor works on
// several at once.
#pragma once
#include <algorithm>
#include <tuple>
#include <type_traits>

#include "dem/cpu/rows.hpp"
#include "dem/cpu/tasks.hpp"

namespace moraine::dem::cpu {

constexpr int block_pairs = 64;  // that go through the phases together

// Where a list comes from: large beds do not stay in a processor's cache from step to step. Theirs are asked
// for two blocks ahead, which takes a tenth off a step; in the cache it would cost 2 %.
enum class Lists { in_cache, from_memory };
constexpr Index grains_in_cache = 30'000;
template <class Entry>
void ask_for(const Entry& entry) {
  const char* const first = reinterpret_cast<const char*>(&entry);
  for (std::size_t at = 0; at < sizeof entry; at += 64) __builtin_prefetch(first + at);
}

// Where j's share of a pair goes.
enum class Shares { in_place, to_slots };

// A line of eight numbers for each lane of a P, and what is done with lines; given for each P.
template <class P>
struct Lines;

// What the loop reads of as many pairs as P has lanes.
template <class P>
struct Gathered {
  Vec3<P> x_ij;
  P r_sum, r_difference;
  Motion<P> before;
};

template <class L, class P>
inline void gather(const Rows& rows, const Sides& sides, const Offset* at_i, const Offset* at_j,
                   bool across_sides, Gathered<P>& q) {
  typename Lines<P>::Line lines[P::width];
  P c[8];
  const auto difference = Lines<P>::i_minus_j();
  for (int k = 0; k < P::width; ++k)
    lines[k] = fma(difference, Lines<P>::load(&rows.grain(at_j[k])), Lines<P>::load(&rows.grain(at_i[k])));
  to_columns(lines, c);
  Vec3<P> x_ij{c[0], c[1], c[2]};
  if (across_sides) x_ij = nearest_image(sides, x_ij);
  q.x_ij = x_ij, q.r_sum = c[7], q.r_difference = c[3];
  q.before.v = {c[4], c[5], c[6]};
  if constexpr (L::rubs) {
    for (int k = 0; k < P::width; ++k)
      lines[k] = Lines<P>::two_rows(&rows.grain(at_i[k]).omega, &rows.grain(at_j[k]).omega);
    to_columns(lines, c);
    q.before.omega_i = {c[0], c[1], c[2]}, q.before.omega_j = {c[4], c[5], c[6]};
  }
}

// Turns what pairs do to their grains back into lines and adds them up, or leaves j's share in its slot.
template <class L, Shares shares, class P>
inline void scatter(const Offset* at_i, const Offset* at_target, const Geometry<P>& at, const Action<P>& a,
                    LoadRow* load, LoadRow* slot) {
  const auto row_at = [](LoadRow* first, Offset o) {
    return reinterpret_cast<double*>(reinterpret_cast<char*>(first) + o);
  };
  constexpr bool to_slots = shares == Shares::to_slots;
  typename Lines<P>::Line action[P::width];
  const auto make_lines = [&](const Vec3<P>& moment) {
    const P columns[8] = {a.f.x, a.f.y, a.f.z, a.slip, moment.x, moment.y, moment.z, a.viscous};
    to_lines(columns, action);
  };
  if constexpr (L::couples) {  // each grain's torque is its own
    typename Lines<P>::Line on_i[P::width];
    make_lines(a.torque_on_i(at));
    std::copy(action, action + P::width, on_i);
    make_lines(a.torque_on_j(at));
    const auto part_i = Lines<P>::on_i(1), part_j = Lines<P>::on_j(1);
    for (int k = 0; k < P::width; ++k) {
      double *const i = row_at(load, at_i[k]), *const j = row_at(to_slots ? slot : load, at_target[k]);
      fma(part_i, on_i[k], Lines<P>::load(i)).store(i);
      (to_slots ? part_j * action[k] : fma(part_j, action[k], Lines<P>::load(j))).store(j);
    }
    return;
  }
  make_lines(a.f_x_n);
  alignas(64) double l_i[P::width] = {}, l_j[P::width] = {};
  if constexpr (L::rubs) at.l_i.store(l_i), at.l_j.store(l_j);
  for (int k = 0; k < P::width; ++k) {
    double *const i = row_at(load, at_i[k]), *const j = row_at(to_slots ? slot : load, at_target[k]);
    fma(Lines<P>::on_i(l_i[k]), action[k], Lines<P>::load(i)).store(i);
    const auto on_j = Lines<P>::on_j(l_j[k]);
    (to_slots ? on_j * action[k] : fma(on_j, action[k], Lines<P>::load(j))).store(j);
  }
}

// What the law remembers of as many pairs, the first of which has this place; and no more. Parts that make
// couples are done before the others.
enum class Parts { couples, others };
template <class L, Account account, Parts parts, class Part>
constexpr bool takes = L::template remembers<Part, account>&& L::template is_couple<Part> ==
                       (parts == Parts::couples);

template <class L, Account account, Parts parts, class P>
inline void recall(Spring<P>& spring, const PairList& list, std::size_t place) {
  MoreParts::for_each_memory([&]<class Part>() {
    if constexpr (takes<L, account, parts, Part>) {
      typename Part::template Memory<P>& to = spring;
      for_each_named(to, list.of<Part>()[place / lanes],
                     [&](const char*, auto& p, const auto& group) { load_lanes(p, group, place % lanes); });
    }
  });
}
template <class L, Account account, Parts parts, class P>
inline void remember(const Spring<P>& spring, PairList& list, std::size_t place) {
  MoreParts::for_each_memory([&]<class Part>() {
    if constexpr (takes<L, account, parts, Part>) {
      const typename Part::template Memory<P>& from = spring;
      for_each_named(from, list.of<Part>()[place / lanes],
                     [&](const char*, const auto& p, auto& group) { store_lanes(p, group, place % lanes); });
    }
  });
}

template <class L, Account account>
inline void ask_for(const PairList& list, std::size_t group) {
  ask_for(list.pairs[group]);
  MoreParts::for_each_memory([&]<class Part>() {
    if constexpr (L::template remembers<Part, account>) ask_for(list.of<Part>()[group]);
  });
}

template <class L, Account account, Shares shares, Lists lists, class P>
[[gnu::flatten]] void run_forces(Bed& bed, PairList& list, std::size_t run, double dt, LoadRow* load) {
  constexpr int packs = block_pairs / P::width, packs_in_group = lanes / P::width;
  const Rows rows(bed.grain);
  const ContactParameters law = bed.scene.contact[static_cast<std::size_t>(list.runs[run].materials)];
  const Sides sides = bed.sides;
  LoadRow* const slot = bed.slot.data();

  Gathered<P> motion[packs];
  Geometry<P> geometry[packs];
  Slide<P> slides[packs];
  Patch<L, P> patches[packs];
  Couple<P> couples[packs];
  Vec3<P> delta_t[packs], v[packs];
  Grip<P> grips[packs];
  const auto v_c = [&](int q) -> const Vec3<P>& {
    if constexpr (L::rubs)
      return slides[q].v_c;
    else
      return motion[q].before.v;
  };

  const auto first = static_cast<std::size_t>(list.runs[run].first_group) * packs_in_group,
             all = static_cast<std::size_t>(list.end_of(run)) * packs_in_group;
  for (std::size_t start = first; start < all; start += packs) {
    const int block = static_cast<int>(std::min<std::size_t>(packs, all - start));
    const auto group = [&](int q) -> const PairGroup& { return list.pairs[(start + q) / packs_in_group]; };
    const auto lane = [&](int q) { return (start + q) % packs_in_group * P::width; };
    const auto place = [&](int q) { return (start + q) * P::width; };

    for (int q = 0; q < block; ++q) {
      const PairGroup& p = group(q);
      gather<L>(rows, sides, &p.i[lane(q)], &p.j[lane(q)], p.across_sides, motion[q]);
    }
    for (int q = 0; q < block; ++q) {
      if constexpr (lists == Lists::from_memory)
        ask_for<L, account>(list, std::min(start + q + 2 * packs, all - 1) / packs_in_group);
      geometry[q] = between_grains(motion[q].x_ij, motion[q].r_sum, motion[q].r_difference);
      if constexpr (L::rubs) slides[q] = slide(dt, geometry[q], motion[q].before);
    }
    for (int q = 0; q < block; ++q) {
      const std::size_t later = std::min(start + q + packs, all - 1);
      const Offset* const at_j = &list.pairs[later / packs_in_group].j[later % packs_in_group * P::width];
      for (int k = 0; k < P::width; ++k)
        __builtin_prefetch(&rows.grain(at_j[k]).x), __builtin_prefetch(&rows.grain(at_j[k]).omega);
      Spring<P> spring;
      recall<L, account, Parts::others>(spring, list, place(q));
      patches[q] = patch<L>(law, geometry[q]);
      if constexpr (L::rubs)
        delta_t[q] = trial_spring<L>(law, dt, geometry[q], patches[q], slides[q], spring);
      v[q] = velocity_at_step<L>(dt, v_c(q), spring);
      grips[q] = grip<L>(law, geometry[q], patches[q], v[q], delta_t[q], spring);
    }
    if constexpr (L::couples)
      for (int q = 0; q < block; ++q) {
        Spring<P> spring;
        recall<L, account, Parts::couples>(spring, list, place(q));
        couples[q] = couples_of<L, account>(law, dt, geometry[q], patches[q],
                                            Moved<P>{motion[q].before, slides[q]}, grips[q].f_n, spring);
        remember<L, account, Parts::couples>(spring, list, place(q));
      }
    for (int q = 0; q < block; ++q) {
      const PairGroup& p = group(q);
      const Geometry<P>& at = geometry[q];
      Spring<P> spring;
      recall<L, account, Parts::others>(spring, list, place(q));
      const Action<P> a =
          act<L, account>(law, dt, at, patches[q], v_c(q), v[q], delta_t[q], grips[q], couples[q], spring);
      remember<L, account, Parts::others>(spring, list, place(q));
      scatter<L, shares>(&p.i[lane(q)], &p.target[lane(q)], at, a, load, slot);
    }
  }
}

template <class L, Account account, Shares shares, Lists lists, class P>
void list_forces(Bed& bed, PairList& list, double dt, LoadRow* load) {
  for (std::size_t run = 0; run < list.runs.size(); ++run)
    run_forces<L, account, shares, lists, P>(bed, list, run, dt, load);
}

template <class L, Account account, class P>
void pair_forces(Bed& bed, Chunk& chunk, const ChunkStep& at) {
  const auto both = [&]<Lists lists>() {
    list_forces<L, account, Shares::in_place, lists, P>(bed, chunk.near[0], at.dt, at.load);
    list_forces<L, account, Shares::to_slots, lists, P>(bed, chunk.near[1], at.dt, at.load);
  };
  bed.n > grains_in_cache ? both.template operator()<Lists::from_memory>()
                          : both.template operator()<Lists::in_cache>();
}

}  // namespace moraine::dem::cpu
