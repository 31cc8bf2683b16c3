// What pressures press with on the solids about each face and on the top wall.
#pragma once
#include <vector>

#include "coupling/faces.hpp"
#include "coupling/skeleton.hpp"
#include "coupling/water.hpp"

namespace moraine::coupling {

struct Thrust {
  Faces on_solids;  // Pa, g of mapping.hpp: -(p_above - p_below), by Closure::pressure_gradient times psi
  Faces to_push;    // the same for Mapping::push
};
// t: s, of the sides' values. out: as long as the faces.
void find_thrust(const Skeleton& skeleton, const fluid::Sides& sides, Closure closure, double t,
                 const std::vector<double>& p, Thrust& out);

// Pa, over the highest level of cells.
double mean_below_top(const fluid::Grid& grid, const std::vector<double>& p);

}  // namespace moraine::coupling
