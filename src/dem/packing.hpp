// Grains to begin with: one in each cell of a loose lattice, placed at random in it (Damsgaard et al. 2013,
// par. 26).
#pragma once
#include <cstdint>

#include "dem/state.hpp"

namespace moraine::dem {

struct Packing {
  enum class Distribution { lognormal, uniform };
  std::int64_t count = 10000;
  Distribution distribution = Distribution::lognormal;
  double radius_mean = 0.02, radius_std = 9.38e-5;  // m, lognormal
  double radius_min = 0.02, radius_max = 0.02;      // m, uniform
  std::uint64_t seed = 1;
  std::int64_t columns_x = 10, columns_y = 10;
  double cell = 2.1;            // height of a lattice cell in largest diameters
  double box_x = 0, box_y = 0;  // m; 0: columns times that height, too
};

struct Lattice {
  State state;          // at rest, ids in the order of the lattice
  double box_x, box_y;  // m
  double cell;          // m
};

// The same grains for the same numbers, wherever it runs. Throws Error where the grains do not fit into their
// cells.
Lattice make_lattice(const Packing& packing);

// A state of n grains at rest, all arrays of the right length.
State grains_at_rest(std::vector<double> r, std::vector<Vec3d> x);

}  // namespace moraine::dem
