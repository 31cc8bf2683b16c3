#include "dem/cpu/pair_list.hpp"

namespace moraine::dem::cpu {

namespace {

void set_lane(Pack& to, double number, int lane) { to.v[lane] = number; }
void set_lane(Vec3<Pack>& to, const Vec3d& v, int lane) {
  to.x.v[lane] = v.x, to.y.v[lane] = v.y, to.z.v[lane] = v.z;
}
void get_lane(double& to, const Pack& p, int lane) { to = p[lane]; }
void get_lane(Vec3d& to, const Vec3<Pack>& v, int lane) { to = {v.x[lane], v.y[lane], v.z[lane]}; }

}  // namespace

void PairList::clear() {
  pairs.clear(), across_sides.clear(), count = 0;
  MoreParts::for_each_memory([&]<class Part>() { of<Part>().clear(); });
}

Index PairList::add(Index i, Index j, Index target, bool across, const Spring<double>& s) {
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

void PairList::pad(Index i, Index far_away, Index target) {
  while (count % lanes != 0) add(i, far_away, target, false, {});
}

Spring<double> PairList::spring(Index place) const {
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
