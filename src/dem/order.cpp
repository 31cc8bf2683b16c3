#include "dem/order.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "dem/grain.hpp"

namespace moraine::dem {

namespace {

// 21 bits, two zeros between each.
std::uint64_t spread(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffff;
  v = (v | v << 16) & 0x1f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  return (v | v << 2) & 0x1249249249249249;
}

}  // namespace

void sort_spatially(const Scene& scene, State& s) {
  const Index n = s.size();
  const Sides sides = Sides::of(scene);
  for (Index i = 0; i < n; ++i)
    for (int a = 0; a < 3; ++a)
      if (sides.side[a] > 0) {
        const double shift = sides.side[a] * std::floor(s.x[i][a] * sides.inverse[a]);
        s.x[i][a] -= shift, s.x_start[i][a] -= shift;
      }

  Vec3d low = s.x[0];
  double r_max = 0;
  for (Index i = 0; i < n; ++i) {
    for (int a = 0; a < 3; ++a) low[a] = std::min(low[a], s.x[i][a]);
    r_max = std::max(r_max, s.r[i]);
  }
  std::vector<std::uint64_t> key(n);
  for (Index i = 0; i < n; ++i) {
    const auto cell = [&](int a) {
      return static_cast<std::uint64_t>(std::min((s.x[i][a] - low[a]) / r_max, 2097151.0));
    };
    key[i] = spread(cell(0)) | spread(cell(1)) << 1 | spread(cell(2)) << 2;
  }
  std::vector<Index> order(n), place(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](Index a, Index b) { return std::tie(key[a], s.id[a]) < std::tie(key[b], s.id[b]); });
  for (Index k = 0; k < n; ++k) place[order[k]] = k;

  const auto permute = [&](auto& v) {
    auto sorted = v;
    for (Index k = 0; k < n; ++k) sorted[k] = v[order[k]];
    v = std::move(sorted);
  };
  permute(s.id), permute(s.r), permute(s.x), permute(s.v), permute(s.omega), permute(s.rotation);
  permute(s.force), permute(s.torque), permute(s.x_start), permute(s.role);
  for (Contact& c : s.contacts) {
    c.i = place[c.i], c.j = place[c.j];
    if (c.i > c.j) std::swap(c.i, c.j), c.delta_t = -c.delta_t;
  }
  std::sort(s.contacts.begin(), s.contacts.end(),
            [](const Contact& a, const Contact& b) { return std::tie(a.i, a.j) < std::tie(b.i, b.j); });
  for (WallContact& w : s.wall_contacts) w.i = place[w.i];
  std::sort(s.wall_contacts.begin(), s.wall_contacts.end(), [](const WallContact& a, const WallContact& b) {
    return std::tie(a.wall, a.i) < std::tie(b.wall, b.i);
  });
}

}  // namespace moraine::dem
