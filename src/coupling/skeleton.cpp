#include "coupling/skeleton.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "coupling/wall_gap.hpp"
#include "coupling/walls.hpp"
#include "dem/state_rows.hpp"
#include "error.hpp"
#include "memory.hpp"

namespace moraine::coupling {

using dem::Vec3d;

fluid::Grid grid_over(const Water& water, const dem::Scene& scene, double height) {
  fluid::Grid g;
  g.n = water.cells;
  g.periodic = {scene.periodic_x, scene.periodic_y, false};
  g.length = {scene.box.x, scene.box.y, height};
  for (int a = 0; a < 3; ++a)
    if (!(g.length[a] > 0) || g.n[a] < 1)
      throw error("pore water: ", g.n[a], " cells over ", g.length[a], " m along ", "xyz"[a],
                  ": expected at least one cell and a length > 0 m");
  std::ostringstream cells;
  cells << "pore water: " << g.n[0] << " x " << g.n[1] << " x " << g.n[2] << " cells";
  expect_memory(bytes_a_cell * g.n[0] * g.n[1] * g.n[2], cells.str(),
                "; expected a larger fluid.cell (2 to 3 mean grain diameters), or fewer fluid.cells_x, "
                "cells_y, cells_z");
  return g;
}

fluid::Sides sides_of(const Water& water) {
  fluid::Sides sides = water.sides;
  if (water.top == TopSide::impermeable) sides.high[2] = {};
  return sides;
}

Skeleton::Skeleton(const Water& water, const dem::Scene& scene, const dem::State& grains,
                   const fluid::Grid& grid)
    : water_(water), scene_(scene), grid_(grid), grains_(dem::grain_rows(scene, grains)) {
  double over_r = 0;
  for (dem::Index i = 0; i < grains.size(); ++i) {
    volume_.push_back(dem::sphere_volume(grains.r[i])), solids_ += volume_.back();
    over_r += volume_.back() / grains.r[i];
    top_layer_.push_back(share_of_top_layer(scene, grains, i));
  }
  sauter_ = 2 * solids_ / over_r;
  const fluid::Sides sides = sides_of(water);
  for (int a = 0; a < 3; ++a) {
    sides_.open_low[a] = sides.low[a].kind != fluid::Side::Kind::closed;
    sides_.open_high[a] = sides.high[a].kind != fluid::Side::Kind::closed;
  }
  sides_.holds = held_sides(scene);
}

void Skeleton::make(const std::vector<Vec3d>& x, double height) {
  grid_.length[2] = height;
  mapping_.build(grid_, sides_, grains_.data(), x, squeeze(x), top_layer_);
  medium_.viscosity = water_.viscosity, medium_.compressibility = water_.compressibility;
  medium_.porosity = mapping_.porosity();
  medium_.permeability.resize(grid_.cells());
  for (std::size_t c = 0; c < grid_.cells(); ++c) {
    double& phi = medium_.porosity[c];
    phi = std::clamp(phi, water_.porosity_range[0], water_.porosity_range[1]);
    medium_.permeability[c] = kozeny_carman(k_c(c), phi);
  }
  for (int a = 0; a < 3; ++a)
    for (const bool high : {false, true})
      if (sides_.holds.at(a, high))
        medium_.gap[a][high] = wall_gap(grid_, grains_.data(), x, water_.porosity_range, a, high);
}

double Skeleton::k_c(std::size_t cell) const {
  if (water_.k_c > 0) return water_.k_c;
  const double of_all = sauter_ * sauter_ / 180, d = mapping_.sauter()[cell],
               least = water_.porosity_range[0];
  if (d == 0) return of_all;
  const double here = d * d / 180, phi = mapping_.porosity()[cell];
  if (phi >= least || here <= of_all) return here;
  const double share = std::max(phi, 0.0) / least;
  return of_all + (here - of_all) * share * share * share;
}

double Skeleton::longest_way(const std::vector<Vec3d>& x, const dem::GrainRow* now) const {
  double way = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (beyond(now[i].x, now[i].r) && beyond(x[i], now[i].r)) continue;
    for (int a = 0; a < 3; ++a) way = std::max(way, std::abs(now[i].x[a] - x[i][a]));
  }
  return way;
}

bool Skeleton::beyond(const Vec3d& x, double r) const {
  const Holds& held = sides_.holds;
  for (int a = 0; a < 3; ++a)
    if (!grid_.periodic[a] &&
        ((!held.low[a] && x[a] + r < 0) || (!held.high[a] && x[a] - r > grid_.length[a])))
      return true;
  return false;
}

// m, sum of each grain's overlaps, as good as that of its normal forces.
std::vector<double> Skeleton::squeeze(const std::vector<Vec3d>& x) {
  std::vector<double> sum(x.size(), 0);
  for (std::size_t i = 0; i < x.size(); ++i) {
    dem::GrainRow& g = grains_[i];
    g.x = x[i];
    for (int a = 2; a >= 0; --a) {
      if (sides_.holds.low[a]) sum[i] += std::max(g.r - x[i][a], 0.0);
      if (sides_.holds.high[a]) sum[i] += std::max(x[i][a] + g.r - grid_.length[a], 0.0);
    }
  }
  touching_.each(scene_, grains_.data(), static_cast<dem::Index>(x.size()),
                 [&](dem::Index i, dem::Index j, double overlap) { sum[i] += overlap, sum[j] += overlap; });
  return sum;
}

}  // namespace moraine::coupling
