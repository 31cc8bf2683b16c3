// What is known to go wrong is said before the first step.
//
// One contact of the smallest grains, inverse effective mass w, spring k, damping gamma: with the positions
// of step n and a velocity foreseen from the last acceleration, leapfrog is stable while
//   k w dt^2/4 + gamma w dt < 1
// w = 2/m between two grains and 1/m against a wall along the normal; 7/m and 3.5/m along the tangent, where
// a sphere also spins (1/m + r^2/I with I = 2/5 m r^2). A grain with many contacts bears less.
#pragma once
#include <string>
#include <vector>

#include "dem/engine.hpp"
#include "run/stages.hpp"

namespace moraine::run {

// Throws Error where grains of the start overlap deeply, naming the pair, or damping is unstable at the time
// step; returns warnings. Uses the engine to find the contacts and leaves it loaded with the first stage.
std::vector<std::string> precheck(const cases::Case& c, const Start& start, dem::Engine& engine);

}  // namespace moraine::run
