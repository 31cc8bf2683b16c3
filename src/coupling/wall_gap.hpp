// Flow across the gap beside a flat wall.
//
// Grains can touch a flat wall but not reach through it, so that the bed is emptier over the first radius.
// This void resists flow towards the wall hardly at all, but it does not widen the pores of the grains behind
// it either; a cell's mean porosity, put into Kozeny-Carman's steep law, counts it as if it did. Here the
// grains of the cells at the wall resist, volume for volume, as those from one radius to some cells' depth
// behind the wall do, and the gap in series with them does not:
//
//   k_across = k(phi_b) (1 - phi_b)/(1 - phi_c)     b: the bed behind the gap, c: the cells at the wall
//
// Porosities of whole levels, by the spheres' exact volume. Flow along the wall is left as it is.
#pragma once
#include <array>
#include <vector>

#include "coupling/water.hpp"
#include "dem/grain.hpp"
#include "fluid/grid.hpp"

namespace moraine::coupling {

double kozeny_carman(double k_c, double porosity);  // m2

// k_across over k(phi_c), 1 at most; for the cells at the floor or at the top wall (high).
double across_wall(const fluid::Grid& grid, const dem::GrainRow* grains, const std::vector<dem::Vec3d>& x,
                   const std::array<double, 2>& porosity_range, bool high);

}  // namespace moraine::coupling
