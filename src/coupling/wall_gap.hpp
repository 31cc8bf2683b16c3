// The gap between a bed and a flat wall.
//
// Grains touch a flat wall but do not reach through it, so that the bed is emptier over the first radius.
// This void hardly resists flow towards the wall, but it does not widen the pores of the grains behind it
// either. Kozeny-Carman's law is steep: with the mean porosity of the cells at the wall, it made the way to a
// drained wall up to half too permeable. So the grains of these cells resist as those from one radius to five
// behind the wall do (b), and where they are fewer than there, the gap has the rest of the way:
//
//   k = k(phi_b),   width = h (1 - (1 - phi)/(1 - phi_b))
//
// Porosities of whole levels, by the spheres' exact volume. Flow along the wall is left as it is.
#pragma once
#include <array>
#include <vector>

#include "coupling/water.hpp"
#include "dem/grain.hpp"
#include "fluid/step.hpp"

namespace moraine::coupling {

double kozeny_carman(double k_c, double porosity);  // m2

// Of the cells at the wall at one end of an axis.
fluid::WallGap wall_gap(const fluid::Grid& grid, const dem::GrainRow* grains,
                        const std::vector<dem::Vec3d>& x, const std::array<double, 2>& porosity_range,
                        int axis, bool high);

}  // namespace moraine::coupling
