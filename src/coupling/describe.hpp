// What a run says about its water, in words; see PoreWater for what each is like.
#pragma once
#include <cstdint>
#include <string>

#include "coupling/skeleton.hpp"
#include "coupling/stability.hpp"
#include "coupling/water.hpp"

namespace moraine::coupling {

// By what part pressures that drain through floor or top even out too fast on a grid of so few cells, 0 where
// they do not drain there: (pi/2n)^2/6 over n cells from the closed end, or the middle, to a drained one.
// Hats spread the pressure of a cell over its neighbours, the grains store less for it (- (pi/2n)^2/4), and
// the flow between centres makes up for a third.
double error_of_few_cells(const Water& water);

std::string describe_grid(const Water& water, const Skeleton& skeleton, const Stability& stability,
                          std::int64_t interval);
std::string describe_outside(const fluid::Grid& grid, const fluid::Sides& sides, const Outside& outside);
std::string describe_solver(const fluid::PressureStep::Report& report);

}  // namespace moraine::coupling
