// Rows of grains (grain.hpp) as SIMD registers.
#pragma once
#include <algorithm>

#include "backend/host.hpp"
#include "backend/number.hpp"
#include "dem/cpu/pair_list.hpp"
#include "dem/grain.hpp"

namespace moraine::dem::cpu {

// Grains by their offset (pair_list.hpp).
class Rows {
 public:
  explicit Rows(const Host::Array<GrainRow>& grain) : grain_(reinterpret_cast<const char*>(grain.data())) {}
  const GrainRow& grain(Offset at) const {
    return *reinterpret_cast<const GrainRow*>(grain_ + 2 * static_cast<std::size_t>(at));
  }

 private:
  const char* grain_;
};

// A vector and the number behind it.
using Row = Pack;
template <class Member>
Row row(const Member& v) {
  return Row::load(reinterpret_cast<const double*>(&v));
}
template <class Member>
void set_row(Member& v, Row p) {
  p.store(reinterpret_cast<double*>(&v));
}
// All of a LoadRow, or the first half of a GrainRow.
template <class Struct>
Line line(const Struct& s) {
  return Line::load(reinterpret_cast<const double*>(&s));
}
// j's line times this and i's line: x_ij, r_i - r_j, v_ij, r_i + r_j.
inline Line i_minus_j() { return {-1.0, Row(-1, -1, -1, 1)}; }

inline void clear(Host::Array<LoadRow>& loads) {
  std::fill(loads.data(), loads.data() + loads.size(), LoadRow{});
}

}  // namespace moraine::dem::cpu
