#include "coupling/faces.hpp"

#include <algorithm>

namespace moraine::coupling {

Faces zeros_on_faces(const fluid::Grid& grid) {
  Faces out;
  for (int a = 0; a < 3; ++a) out[a].resize(grid.face_count(a));
  return out;
}

void divergence(const fluid::Grid& grid, const Faces& u, std::vector<double>& out) {
  std::fill(out.begin(), out.end(), 0.0);
  for (int a = 0; a < 3; ++a) {
    const double* const of = u[a].data();
    for_each_run(grid, a, [&](std::size_t c, std::size_t low, std::size_t high, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i) out[c + i] += of[high + i] - of[low + i];
    });
  }
}

void pressure_drop(const fluid::Grid& grid, const fluid::Sides& sides, const fluid::Medium& medium, double t,
                   const std::vector<double>& p, Faces& out) {
  for (int a = 0; a < 3; ++a) {
    std::fill(out[a].begin(), out[a].end(), 0.0);
    double* const g = out[a].data();
    for_each_run(grid, a, [&](std::size_t c, std::size_t low, std::size_t high, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i) g[high + i] += p[c + i];
      for (std::size_t i = 0; i < count; ++i) g[low + i] -= p[c + i];
    });
    if (grid.periodic[a]) continue;
    const double stride = grid.h(a) / 2;
    const auto at_side = [&](std::size_t f, std::size_t c, bool high) {
      const fluid::Side& s = high ? sides.high[a] : sides.low[a];
      double beyond = p[c];
      if (s.kind == fluid::Side::Kind::pressure) beyond = s.at(t);
      const fluid::WallGap& gap = medium.gap[a][high];
      if (s.kind == fluid::Side::Kind::flux)
        beyond = p[c] + s.at(t) * medium.viscosity * (stride - gap.width) / (gap.k * medium.permeability[c]);
      g[f] += high ? -beyond : beyond;
    };
    const auto last = [&](int axis) { return axis == a ? 1 : grid.n[axis]; };
    for (int k = 0; k < last(2); ++k)
      for (int j = 0; j < last(1); ++j)
        for (int i = 0; i < last(0); ++i) {
          int high[3] = {i, j, k};
          high[a] = grid.n[a];
          at_side(grid.face(a, i, j, k), grid.cell(i, j, k), false);
          const std::size_t f = grid.face(a, high[0], high[1], high[2]);
          high[a] -= 1;
          at_side(f, grid.cell(high[0], high[1], high[2]), true);
        }
  }
}

}  // namespace moraine::coupling
