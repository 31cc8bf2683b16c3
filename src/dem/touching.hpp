// Pairs of grains that touch, found from their places alone, several at a time. For the host.
#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <vector>

#include "backend/number.hpp"
#include "dem/neighbours.hpp"

namespace moraine::dem {

class TouchingPairs {
 public:
  // Calls visit(i, j, overlap in m) for each pair, once, always in the same order. Throws Error if a
  // coordinate is not finite.
  template <class Visit>
  void each(const Scene& scene, const GrainRow* grains, Index n, Visit&& visit) {
    double r_max = 0;
    for (Index i = 0; i < n; ++i) r_max = std::max(r_max, grains[i].r);
    // By names, because clang 14 lets no lambda see a structured binding.
    const auto cells = neighbours_.sort_into_cells(Host{}, scene, grains, n, 2 * r_max);
    const CellGrid& grid = cells.grid;
    const std::int32_t *const order = cells.order, *const first = cells.first, *const end = cells.end;
    for (std::vector<double>* const list : {&x_, &y_, &z_, &r_})
      list->resize(n + Pack::width);  // to a full pack
    for (Index k = 0; k < n; ++k) {
      const GrainRow& g = grains[order[k]];
      x_[k] = g.x.x, y_[k] = g.x.y, z_[k] = g.x.z, r_[k] = g.r;
    }
    for (Index k = 0; k < n; ++k) {
      const Vec3<Pack> x{Pack(x_[k]), Pack(y_[k]), Pack(z_[k])};
      const Pack r(r_[k]);
      grid.runs_around({x_[k], y_[k], z_[k]}, [&](std::int32_t first_cell, std::int32_t last_cell) {
        Index from = n, to = 0;
        for (std::int32_t c = first_cell; c <= last_cell; ++c)
          if (first[c] < end[c]) from = std::min(from, first[c]), to = end[c];
        for (Index l = std::max(from, k + 1); l < to; l += Pack::width) {
          const Vec3<Pack> d = nearest_image(grid.sides, x - Vec3<Pack>{at(x_, l), at(y_, l), at(z_, l)});
          const Pack reach = r + at(r_, l), distance2 = dot(d, d);
          const unsigned in_run = (1u << std::min(to - l, Index{Pack::width})) - 1;
          for (unsigned touch = bits(distance2 < reach * reach) & in_run; touch != 0; touch &= touch - 1) {
            const int lane = std::countr_zero(touch);
            visit(order[k], order[l + lane], reach[lane] - std::sqrt(distance2[lane]));
          }
        }
      });
    }
  }

 private:
  static Pack at(const std::vector<double>& list, Index k) {
    Pack p;
    std::memcpy(&p.v, &list[k], sizeof p.v);
    return p;
  }

  Neighbours<Host> neighbours_;
  std::vector<double> x_, y_, z_, r_;  // m, side by side in the order of cells
};

}  // namespace moraine::dem
