// Grains by cells of a grid, side by side in memory, so that several are looked at at a time. For the host.
#pragma once
#include <algorithm>
#include <bit>
#include <cstring>
#include <optional>
#include <vector>

#include "backend/number.hpp"
#include "dem/neighbours.hpp"

namespace moraine::dem {

class CloseGrains {
 public:
  // Sorts them into cells; m, margin: that usually asked for. Throws Error if a coordinate is not finite.
  void sort(const Host& space, const Scene& scene, const GrainRow* grains, Index n, double margin) {
    cells_ = neighbours_.sort_into_cells(space, scene, grains, n, margin);
    start_.assign(1, 0);
    for (std::int32_t c = 0; c < cells_->count; ++c)
      start_.push_back(start_.back() + cells_->end[c] - cells_->first[c]);
    for (std::vector<double>* const list : {&x_, &y_, &z_, &r_})
      list->resize(n + Pack::width);  // to a full pack
    place_.resize(n);
    space.for_each(n, [&](std::int64_t k) {
      const GrainRow& g = grains[cells_->order[k]];
      x_[k] = g.x.x, y_[k] = g.x.y, z_[k] = g.x.z, r_[k] = g.r;
      place_[cells_->order[k]] = static_cast<Index>(k);
    });
  }
  // The grain that has this number in the order of cells, and the number of a grain.
  Index grain(Index k) const { return cells_->order[k]; }
  Index place(Index i) const { return place_[i]; }
  Vec3d x(Index k) const { return {x_[k], y_[k], z_[k]}; }
  double r(Index k) const { return r_[k]; }

  // use(l, r_k + r_l + margin, square of the distance) for the grains l > k, in the order of cells, that are
  // closer to k than that: over all k each pair once. Those of coarser levels come before k.
  template <class Use>
  void after(Index number, double margin, Use&& use) const {
    const Vec3d x = this->x(number);
    const Vec3<Pack> at{Pack(x.x), Pack(x.y), Pack(x.z)};
    const double r = r_[number] + margin;
    const Pack r_and_margin(r);
    const Levels& levels = cells_->levels;
    const Sides& sides = levels.grid[0].sides;
    const Index from = number + 1;
    levels.runs_around(x, r, levels.of(r_[number]), [&](std::int32_t first_cell, std::int32_t last_cell) {
      const Index end = start_[last_cell + 1];
      for (Index k = std::max(start_[first_cell], from); k < end; k += Pack::width) {
        const Vec3<Pack> d = nearest_image(sides, at - Vec3<Pack>{load(x_, k), load(y_, k), load(z_, k)});
        const Pack reach = r_and_margin + load(r_, k), distance2 = dot(d, d);
        const unsigned in_run = (1u << std::min(end - k, Index{Pack::width})) - 1;
        for (unsigned close = bits(distance2 < reach * reach) & in_run; close != 0; close &= close - 1) {
          const int lane = std::countr_zero(close);
          use(k + lane, reach[lane], distance2[lane]);
        }
      }
    });
  }

 private:
  static Pack load(const std::vector<double>& list, Index k) {
    Pack p;
    std::memcpy(&p.v, &list[k], sizeof p.v);
    return p;
  }

  Neighbours<Host> neighbours_;
  std::optional<Neighbours<Host>::Cells> cells_;
  std::vector<Index> start_;           // of each cell in the order of cells, and of one after the last
  std::vector<Index> place_;           // in the order of cells, by grain
  std::vector<double> x_, y_, z_, r_;  // m
};

}  // namespace moraine::dem
