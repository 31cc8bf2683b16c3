// Pressures carried over to a grid of other cells over the same box.
#pragma once
#include <array>
#include <vector>

namespace moraine::fluid {

// Pa, of each of to[0] x to[1] x to[2] cells: the mean of p over what it covers of the from[0] x from[1] x
// from[2] cells (order as in grid.hpp), in parts of the box's lengths. The mean over the box is kept; equal
// numbers of cells give equal bits.
std::vector<double> regrid(std::vector<double> p, const std::array<int, 3>& from,
                           const std::array<int, 3>& to);

}  // namespace moraine::fluid
