#include "dem/cpu/pair_list.hpp"

namespace moraine::dem::cpu {

void PairList::clear() { pairs.clear(), springs.clear(), slipping.clear(), across_sides.clear(), count = 0; }

Index PairList::add(Index i, Index j, Index target, bool across, const Spring<double>& s) {
  const int lane = count % lanes;
  if (lane == 0) {
    pairs.emplace_back();
    springs.emplace_back();
    slipping.emplace_back();
    across_sides.push_back(false);
  }
  PairGroup& p = pairs.back();
  p.i[lane] = row_bytes * i, p.j[lane] = row_bytes * j, p.target[lane] = row_bytes * target;
  for (int a = 0; a < 3; ++a) springs.back()[a].v[lane] = s.delta_t[a];
  slipping.back().v[lane] = s.slipping;
  if (across) across_sides.back() = true;
  return count++;
}

void PairList::pad(Index i, Index far_away, Index target) {
  while (count % lanes != 0) add(i, far_away, target, false, {{0, 0, 0}, 0});
}

Spring<double> PairList::spring(Index place) const {
  const Vec3<Pack>& s = springs[place / lanes];
  const int lane = static_cast<int>(place % lanes);
  return {{s.x[lane], s.y[lane], s.z[lane]}, slipping[place / lanes][lane]};
}

}  // namespace moraine::dem::cpu
