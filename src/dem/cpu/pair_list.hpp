// Near pairs of one chunk, as the SIMD loop reads them: groups of as many pairs as there are lanes, by (i,
// j).
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

constexpr int lanes = Pack::width;

struct PairGroup {
  std::array<Offset, lanes> i, j;
  std::array<Offset, lanes> target;  // where j's share goes: j itself, or (from the first slot) a slot
};

inline void set_lane(Pack& to, double number, int lane) { to.v[lane] = number; }
inline void set_lane(Vec3<Pack>& to, const Vec3d& v, int lane) {
  to.x.v[lane] = v.x, to.y.v[lane] = v.y, to.z.v[lane] = v.z;
}
inline void get_lane(double& to, const Pack& p, int lane) { to = p[lane]; }
inline void get_lane(Vec3d& to, const Vec3<Pack>& v, int lane) { to = {v.x[lane], v.y[lane], v.z[lane]}; }

struct PairList {
  std::vector<PairGroup> pairs;
  MoreParts::MemoryLists<std::vector, Pack> memory;  // by group
  std::vector<bool> across_sides;                    // groups with a pair that touches across periodic sides
  Index count = 0;

  void clear();
  // Returns its place in the list. target: see PairGroup.
  Index add(Index i, Index j, Index target, bool across_sides, const Spring<double>& spring);
  // Fills the last group with a pair that never touches.
  void pad(Index i, Index far_away, Index target);
  Spring<double> spring(Index place) const;
  bool remembers(Index place) const;  // whether any number of its spring is not zero

  // What a part of the law remembers of each group.
  template <class Part>
  auto& of() {
    return std::get<std::vector<typename Part::template Memory<Pack>>>(memory);
  }
  template <class Part>
  const auto& of() const {
    return std::get<std::vector<typename Part::template Memory<Pack>>>(memory);
  }
};

// Pairs of which only the distance is looked at.
struct WatchList {
  struct Group {
    std::array<Offset, lanes> i, j;
  };
  std::vector<Group> pairs;
  std::vector<bool> across_sides;  // groups with a pair across periodic sides
  Index count = 0;

  void clear() { pairs.clear(), across_sides.clear(), count = 0; }
  void add(Index i, Index j, bool across) {
    const int lane = count++ % lanes;
    if (lane == 0) {
      pairs.emplace_back();
      across_sides.push_back(false);
      pairs.back().i.fill(row_bytes * i), pairs.back().j.fill(row_bytes * j);
    }
    pairs.back().i[lane] = row_bytes * i, pairs.back().j[lane] = row_bytes * j;
    if (across) across_sides.back() = true;
  }
};

inline Index PairList::add(Index i, Index j, Index target, bool across, const Spring<double>& s) {
  const int lane = count % lanes;
  if (lane == 0) {
    pairs.emplace_back();
    across_sides.push_back(false);
  }
  PairGroup& p = pairs.back();
  p.i[lane] = row_bytes * i, p.j[lane] = row_bytes * j, p.target[lane] = row_bytes * target;
  if (across) across_sides.back() = true;
  MoreParts::for_each_memory([&]<class Part>() {
    if (lane == 0) of<Part>().emplace_back();
    const typename Part::template Memory<double>& from = s;
    for_each_named(of<Part>().back(), from,
                   [lane](const char*, auto& group, const auto& value) { set_lane(group, value, lane); });
  });
  return count++;
}

inline Spring<double> PairList::spring(Index place) const {
  Spring<double> s;
  MoreParts::for_each_memory([&]<class Part>() {
    typename Part::template Memory<double>& to = s;
    for_each_named(to, of<Part>()[place / lanes], [&](const char*, auto& value, const auto& group) {
      get_lane(value, group, static_cast<int>(place % lanes));
    });
  });
  return s;
}

}  // namespace moraine::dem::cpu
