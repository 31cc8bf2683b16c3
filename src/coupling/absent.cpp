// What stands in for pore water in builds without MORAINE_FLUID.
#include "coupling/pore_water.hpp"
#include "error.hpp"

namespace moraine::coupling {

bool water_built() { return false; }

std::unique_ptr<PoreWater> make_pore_water(const Water&, const dem::Scene&, const dem::State&,
                                           const WaterState&, bool) {
  throw error(
      "this build has no pore water in it: configure with -DMORAINE_FLUID=ON where SuiteSparse and SUNDIALS "
      "are "
      "installed, or set fluid.enabled = false");
}

}  // namespace moraine::coupling
