// Sums over the faces of the grid (fluid/grid.hpp): divergence and, its opposite, the drop of pressure.
#pragma once
#include <array>
#include <vector>

#include "fluid/step.hpp"

namespace moraine::coupling {

// A number for each face of each axis.
using Faces = std::array<std::vector<double>, 3>;
Faces zeros_on_faces(const fluid::Grid& grid);

// m3, sum of U leaving each cell; out: cells() long.
void divergence(const fluid::Grid& grid, const Faces& u, std::vector<double>& out);

// Pa, p_below - p_above of each face. Beyond a side lies its pressure at time t (s), or the one that drives
// its flux; by a closed one that of the cell.
void pressure_drop(const fluid::Grid& grid, const fluid::Sides& sides, const fluid::Medium& medium, double t,
                   const std::vector<double>& p, Faces& out);

// use(cell, its low face, its high face, count): that many cells that follow each other, and so do their
// faces along the axis.
template <class Use>
void for_each_run(const fluid::Grid& grid, int axis, Use&& use) {
  const auto& n = grid.n;
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j) {
      int above[3] = {0, j, k};
      ++above[axis];
      const bool wraps = grid.periodic[axis];
      if (wraps && above[axis] == n[axis]) above[axis] = 0;
      const std::size_t c = grid.cell(0, j, k), low = grid.face(axis, 0, j, k),
                        high = grid.face(axis, above[0], above[1], above[2]);
      const auto count = static_cast<std::size_t>(n[0]);
      if (axis == 0 && wraps) {
        use(c, low, low + 1, count - 1);
        use(c + count - 1, low + count - 1, low, std::size_t{1});
      } else {
        use(c, low, high, count);
      }
    }
}

}  // namespace moraine::coupling
