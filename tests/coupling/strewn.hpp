// Grains at rest at random places.
#pragma once
#include <functional>

#include "wet_scenes.hpp"

namespace moraine::coupling {

// Grains at random places, none of them touching; x and y periodic, nothing moves them.
inline WetBed strewn(const std::vector<double>& radii, const Vec3d& box, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  const double least = *std::min_element(radii.begin(), radii.end());
  // A table of cells finer than the smallest grain, each with the grain that covers its middle or nears it.
  std::vector<Vec3d> x;
  const std::array<int, 3> n{int(box.x / (2 * least)), int(box.y / (2 * least)), int(box.z / (2 * least))};
  std::vector<std::vector<dem::Index>> near(std::size_t(n[0]) * n[1] * n[2]);
  const auto cells_about = [&](const Vec3d& at, double reach, const std::function<void(std::size_t)>& use) {
    int low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      const double h = box[a] / n[a];
      low[a] = int(std::floor((at[a] - reach) / h)), high[a] = int(std::floor((at[a] + reach) / h));
      if (a == 2)
        low[a] = std::max(low[a], 0), high[a] = std::min(high[a], n[a] - 1);
      else
        high[a] = std::min(high[a], low[a] + n[a] - 1);
    }
    for (int k = low[2]; k <= high[2]; ++k)
      for (int j = low[1]; j <= high[1]; ++j)
        for (int i = low[0]; i <= high[0]; ++i)
          use((std::size_t(k) * n[1] + (j % n[1] + n[1]) % n[1]) * n[0] + (i % n[0] + n[0]) % n[0]);
  };
  for (const double r : radii)
    for (;;) {
      const Vec3d at{box.x * unit(random), box.y * unit(random), r + (box.z - 2 * r) * unit(random)};
      bool free = true;
      cells_about(at, r, [&](std::size_t c) {
        for (const dem::Index j : near[c]) {
          Vec3d d = at - x[j];
          d.x -= box.x * std::round(d.x / box.x), d.y -= box.y * std::round(d.y / box.y);
          free = free && dem::length(d) > r + radii[j];
        }
      });
      if (!free) continue;
      cells_about(at, r, [&](std::size_t c) { near[c].push_back(static_cast<dem::Index>(x.size())); });
      x.push_back(at);
      break;
    }
  WetBed bed;
  bed.scene = dem::empty_space(1e5);
  bed.scene.periodic_x = bed.scene.periodic_y = true;
  bed.scene.body(dem::BodyId::floor) = dem::floor_at(0);
  bed.scene.box = box, bed.scene.dt = 1e-7;
  bed.state = dem::grains_at_rest(radii, x);
  return bed;
}

}  // namespace moraine::coupling
