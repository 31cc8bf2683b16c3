// Near pairs of one chunk, as the SIMD loop reads them: groups of eight pairs, by pair of materials and (i,
// j), which it takes in one or more packs.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "backend/number.hpp"
#include "dem/grain.hpp"
#include "dem/law/laws.hpp"

namespace moraine::dem::cpu {

// Where a grain's rows are, in bytes from the first LoadRow; its GrainRow is twice as far from the first of
// those. Kept instead of the index because the loop over pairs would have to compute it.
using Offset = std::uint32_t;
constexpr Offset row_bytes = sizeof(LoadRow);
static_assert(sizeof(GrainRow) == 2 * row_bytes);

constexpr int lanes = 8;

struct PairGroup {
  std::array<Offset, lanes> i, j;
  std::array<Offset, lanes> target;  // where j's share goes: j itself, or (from the first slot) a slot
  bool across_sides;                 // whether a pair touches across periodic sides
};

// A number of each pair of a group.
struct alignas(64) Lanes {
  double v[lanes] = {};
};
inline void set_lane(Lanes& to, double number, int lane) { to.v[lane] = number; }
inline void set_lane(Vec3<Lanes>& to, const Vec3d& v, int lane) {
  to.x.v[lane] = v.x, to.y.v[lane] = v.y, to.z.v[lane] = v.z;
}
inline void get_lane(double& to, const Lanes& p, int lane) { to = p.v[lane]; }
inline void get_lane(Vec3d& to, const Vec3<Lanes>& v, int lane) {
  to = {v.x.v[lane], v.y.v[lane], v.z.v[lane]};
}

// As many of them as P has lanes, from `lane` on.
template <class P>
void load_lanes(P& p, const Lanes& from, std::size_t lane) {
  p = P::load(from.v + lane);
}
template <class P>
void load_lanes(Vec3<P>& p, const Vec3<Lanes>& from, std::size_t lane) {
  load_lanes(p.x, from.x, lane), load_lanes(p.y, from.y, lane), load_lanes(p.z, from.z, lane);
}
template <class P>
void store_lanes(const P& p, Lanes& to, std::size_t lane) {
  p.store(to.v + lane);
}
template <class P>
void store_lanes(const Vec3<P>& p, Vec3<Lanes>& to, std::size_t lane) {
  store_lanes(p.x, to.x, lane), store_lanes(p.y, to.y, lane), store_lanes(p.z, to.z, lane);
}

struct PairList {
  // Groups one after the other whose pairs are of one pair of materials, so that the loop over them has one
  // set of parameters.
  struct Run {
    Index first_group;
    int materials;  // pair_number
  };
  std::vector<PairGroup> pairs;
  std::vector<Run> runs;
  MoreParts::MemoryLists<std::vector, Lanes> memory;  // by group; empty where nothing is remembered
  unsigned remembered = 0;                            // which parts of the law, bit by bit
  Index count = 0;

  void clear();
  // Returns its place in the list. target: see PairGroup.
  Index add(Index i, Index j, Index target, bool across_sides, const Spring<double>& spring);
  // What is added from here on is of this pair of materials; the last group is full.
  void begin_run(int materials) { runs.push_back({static_cast<Index>(pairs.size()), materials}); }
  Index end_of(std::size_t run) const {  // in groups
    return run + 1 < runs.size() ? runs[run + 1].first_group : static_cast<Index>(pairs.size());
  }
  // Fills the last group with a pair that never touches.
  void pad(Index i, Index far_away, Index target);
  Spring<double> spring(Index place) const;
  bool remembers(Index place) const;  // whether any number of its spring is not zero

  template <class Use>
  void for_each_remembered(Use&& use) const {
    unsigned bit = 1;
    MoreParts::for_each_memory([&]<class Part>() {
      if (remembered & bit) use.template operator()<Part>();
      bit <<= 1;
    });
  }
  // What a part of the law remembers of each group.
  template <class Part>
  auto& of() {
    return std::get<std::vector<typename Part::template Memory<Lanes>>>(memory);
  }
  template <class Part>
  const auto& of() const {
    return std::get<std::vector<typename Part::template Memory<Lanes>>>(memory);
  }
};

// Pairs of which only the distance is looked at.
struct WatchList {
  struct Group {
    std::array<Offset, Pack::width> i, j;
    bool across_sides;  // whether a pair is across periodic sides
  };
  std::vector<Group> pairs;
  Index count = 0;

  void clear() { pairs.clear(), count = 0; }
  void add(Index i, Index j, bool across) {
    const int lane = count++ % Pack::width;
    if (lane == 0) {
      Group& group = pairs.emplace_back();
      group.i.fill(row_bytes * i), group.j.fill(row_bytes * j), group.across_sides = false;
    }
    Group& group = pairs.back();
    group.i[lane] = row_bytes * i, group.j[lane] = row_bytes * j;
    group.across_sides |= across;
  }
};

inline Index PairList::add(Index i, Index j, Index target, bool across, const Spring<double>& s) {
  const int lane = count % lanes;
  if (lane == 0) {
    pairs.emplace_back().across_sides = false;
  }
  PairGroup& p = pairs.back();
  p.i[lane] = row_bytes * i, p.j[lane] = row_bytes * j, p.target[lane] = row_bytes * target;
  p.across_sides |= across;
  for_each_remembered([&]<class Part>() {
    if (lane == 0) of<Part>().emplace_back();
    const typename Part::template Memory<double>& from = s;
    for_each_named(of<Part>().back(), from,
                   [lane](const char*, auto& group, const auto& value) { set_lane(group, value, lane); });
  });
  return count++;
}

inline Spring<double> PairList::spring(Index place) const {
  Spring<double> s;
  for_each_remembered([&]<class Part>() {
    typename Part::template Memory<double>& to = s;
    for_each_named(to, of<Part>()[place / lanes], [&](const char*, auto& value, const auto& group) {
      get_lane(value, group, static_cast<int>(place % lanes));
    });
  });
  return s;
}

}  // namespace moraine::dem::cpu
