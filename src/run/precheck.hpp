// What is known to go wrong is said before the first step.
//
// For a swing with inverse effective mass w, spring k and damping gamma, leapfrog (positions of step n,
// viscous velocity foreseen from the last acceleration) is stable while
//   k w dt^2/4 + gamma w dt < 1
// Of the smallest grain: w = 2/m between two grains and 1/m against a wall along the normal; 7/m and 3.5/m
// along the tangent, where a sphere also spins (1/m + r^2/I with I = 2/5 m r^2). A grain with many contacts
// bears less. A top wall driven by stress moves against all M grains that touch it at once:
// w = 1/m + M/wall mass. M is not known beforehand; one layer of mean grains is taken, and exceeding that
// limit is a warning.
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
