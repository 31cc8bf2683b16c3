#include "coupling/wall_gap.hpp"

#include <algorithm>
#include <numbers>

namespace moraine::coupling {

double kozeny_carman(double k_c, double porosity) {
  return k_c * porosity * porosity * porosity / ((1 - porosity) * (1 - porosity));
}

// Beyond an open side of another axis.
static bool beyond(const fluid::Grid& grid, const dem::Vec3d& x, int axis) {
  for (int a = 0; a < 3; ++a)
    if (a != axis && !grid.periodic[a] && (x[a] < 0 || x[a] > grid.length[a])) return true;
  return false;
}

fluid::WallGap wall_gap(const fluid::Grid& grid, const dem::GrainRow* grains,
                        const std::vector<dem::Vec3d>& x, const std::array<double, 2>& porosity_range,
                        int axis, bool high) {
  const std::size_t n = x.size();
  double square = 0, cube = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double r = grains[i].r;
    square += r * r, cube += r * r * r;
  }
  const double radius = cube / square;  // of the grains that fill the bed: Sauter's mean

  const double length = grid.length[axis], cell = grid.h(axis);
  const double depth = std::min(std::max(cell, 5 * radius), 0.5 * length);  // not into the other wall's gap
  if (depth < 2 * radius) return {};                                        // no bed behind the gap

  // m3, of solids within so much of the wall: in the gap, in the bed to `depth`, in the cells.
  const std::array<double, 3> within{radius, depth, cell};
  std::array<double, 3> solids{};
  for (std::size_t i = 0; i < n; ++i) {
    if (beyond(grid, x[i], axis)) continue;
    const double r = grains[i].r, z = high ? length - x[i][axis] : x[i][axis];
    for (int k = 0; k < 3; ++k) {
      const double t = std::clamp(within[k] - z, -r, r);  // of the sphere, up to there
      solids[k] += std::numbers::pi * (r * r * t - t * t * t / 3 + 2 * r * r * r / 3);
    }
  }
  const auto porosity = [&](double volume, double thickness) {
    const double area = grid.length[(axis + 1) % 3] * grid.length[(axis + 2) % 3];
    return std::clamp(1 - volume / (area * thickness), porosity_range[0], porosity_range[1]);
  };
  const double at_wall = porosity(solids[2], cell), behind = porosity(solids[1] - solids[0], depth - radius);
  if (behind >= at_wall) return {};
  // What does not fit beside the centres of cells as small as grains is left out.
  const double width = cell * (1 - (1 - at_wall) / (1 - behind));
  return {kozeny_carman(1, behind) / kozeny_carman(1, at_wall), std::min(width, 0.4 * cell)};
}

}  // namespace moraine::coupling
