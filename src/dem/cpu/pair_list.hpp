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
static_assert(sizeof(GrainRow) == 2 * row_bytes && sizeof(NowRow) == row_bytes);

constexpr int lanes = Pack::width;

struct PairGroup {
  std::array<Offset, lanes> i, j;
  std::array<Offset, lanes> target;  // where j's share goes: j itself, or (from the first slot) a slot
};

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

}  // namespace moraine::dem::cpu
