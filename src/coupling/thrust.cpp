#include "coupling/thrust.hpp"

namespace moraine::coupling {

void find_thrust(const Skeleton& skeleton, const fluid::Sides& sides, Closure closure, double t,
                 const std::vector<double>& p, Thrust& out) {
  const Mapping& mapping = skeleton.mapping();
  Faces& g = out.on_solids;
  pressure_drop(skeleton.grid(), sides, skeleton.medium(), t, p, g);
  for (int a = 0; a < 3; ++a) {
    if (closure == Closure::pressure_gradient)
      for (std::size_t f = 0; f < g[a].size(); ++f) g[a][f] *= mapping.solid_fraction()[a][f];
    for (std::size_t f = 0; f < g[a].size(); ++f) out.to_push[a][f] = mapping.scale()[a][f] * g[a][f];
  }
}

double mean_below_top(const fluid::Grid& grid, const std::vector<double>& p) {
  const std::size_t first = grid.cell(0, 0, grid.n[2] - 1);
  double sum = 0;
  for (std::size_t c = first; c < p.size(); ++c) sum += p[c];
  return sum / static_cast<double>(p.size() - first);
}

}  // namespace moraine::coupling
