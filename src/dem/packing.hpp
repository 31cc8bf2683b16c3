// Grains to begin with, none of which touch: one in each cell of a loose lattice, placed at random in it
// (Damsgaard et al. 2013, par. 26); or all at random places, the largest first.
#pragma once
#include <cstdint>

#include "dem/grading.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

struct Packing {
  enum class Distribution { lognormal, uniform, ranges, bimodal };
  enum class Placement { lattice, random };
  std::int64_t count = 10000;
  Distribution distribution = Distribution::lognormal;
  double radius_mean = 0.02, radius_std = 9.38e-5;  // m, lognormal; bimodal: of the coarse
  double radius_min = 0, radius_max = 0;            // m, uniform; lognormal: what lies outside is drawn again
  double fine_radius_mean = 0, fine_radius_std = 0;  // m, bimodal
  double fine_fraction = 0;                          // bimodal: of the mass
  std::vector<SizeRange> ranges;                     // of ranges
  std::uint64_t seed = 1;
  Placement placement = Placement::lattice;
  std::int64_t columns_x = 10, columns_y = 10;  // lattice
  double cell = 2.1;                            // lattice: height of a cell in largest diameters
  double solid_fraction = 0.25;                 // random: of the box up to the height that they fill
  double box_x = 0, box_y = 0;                  // m; 0: columns times the height of a cell, or see below
  double box_z = 0;                             // m; counts only where z is periodic
  bool periodic_x = true, periodic_y = true, periodic_z = false;
};

struct LooseGrains {
  State state;          // at rest
  double box_x, box_y;  // m
  double box_z = 0;     // m; of Packing where z is periodic at random places, else 0
  double cell;          // m, of the lattice; random: as wide as that of grains of the mean volume
};

// The same grains for the same numbers, wherever it runs. Throws Error where the grains do not fit.
// At random places with z periodic the sides that are 0 are equal, and such that solid_fraction holds; where
// none is 0 the box says how loose the grains are.
LooseGrains make_loose_grains(const Packing& packing);

// A state of n grains at rest, all arrays of the right length.
State grains_at_rest(std::vector<double> r, std::vector<Vec3d> x);

}  // namespace moraine::dem
