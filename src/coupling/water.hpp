// Pore water around the grains, as a case describes it and as a run keeps it. Plain data, known also to
// builds without SuiteSparse and SUNDIALS; what it does is in pore_water.hpp.
//
// p is the excess over the hydrostatic pressure. Buoyancy enters through Scene::fluid_density.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dem/vec3.hpp"
#include "fluid/grid.hpp"

namespace moraine::coupling {

// What of the pressure gradient a grain of volume V feels.
enum class Closure {
  full,               // -V/(1 - phi) grad p: pressure gradient and Darcy drag
  pressure_gradient,  // -V grad p: without the drag, as in Damsgaard et al. (2015)
};
enum class TopSide { drained, impermeable };
enum class Solver { automatic, pcg, cholmod };

// Constant while a stage runs.
struct Water {
  bool present = false;
  double viscosity = 1.8e-3;         // Pa s, mu_f
  double compressibility = 4.5e-10;  // 1/Pa, beta
  double k_c = 0;  // m2, of k = k_c phi^3/(1 - phi)^2; 0: by the grains of each cell (skeleton.hpp)
  std::array<double, 2> porosity_range{0.1, 0.9};  // phi is kept within it for k and storage
  std::array<int, 3> cells{1, 1, 1};
  double height = 0;               // m, of the grid where there is no top wall
  fluid::Sides sides;              // x and y count where they are not periodic; top: see below
  TopSide top = TopSide::drained;  // drained: at sides.high[2]; impermeable: the wall carries p
  Closure closure = Closure::full;
  std::int64_t interval = 0;  // steps between exchanges; 0: the longest that is stable
  Solver solver = Solver::automatic;
  double tolerance = 1e-10;
  bool operator==(const Water&) const = default;
};

constexpr double bytes_a_cell = 600;  // measured, without what CHOLMOD fills in

// All that must be known to go on from an exchange with the same bits, beside the grains.
struct WaterState {
  std::vector<std::int32_t> cells;  // along x, y, z
  std::vector<double> q;            // m3, excess water stored in each cell: beta phi V p
  std::vector<double> p;            // Pa, at the last exchange
  std::vector<dem::Vec3d> x_map;    // m, where the grains were when the weights were made; memory order
  double height_map = 0;            // m, of the grid then
  double moved = 0;                 // m, at most, since
  double wall_z = 0;                // m, at the last exchange
  double wall_pressure = 0;         // Pa, on the top wall
  std::int64_t exchanges = 0;       // since the stage began
  // Since the stage began.
  double drained_top = 0, drained_bottom = 0, drained_sides = 0;  // m3 of water that left
  double dissipated = 0;                                          // J, by the flow
  double dissipation = 0;                                         // W, at the last exchange
  double volume_0 = 0;  // m3, of water when the stage began: sum of phi V (1 + beta p)
};

// What one reads off at an exchange, for the series and for snapshots.
struct WaterFields {
  fluid::Grid grid;
  std::vector<double> pressure, porosity, permeability;  // Pa, 1, m2; by cell
  std::vector<dem::Vec3d> flux;                          // m/s, Darcy velocity at cell centres
};
struct WaterRecord {
  double mean = 0, least = 0, most = 0;  // Pa, pressure over the shear zone (else the whole grid)
  double stored = 0;                     // J, 1/2 q^2/C
  double volume = 0;                     // m3 of water: sum of phi V (1 + beta p)
  double balance = 0;  // m3, volume + drained - volume_0: what the account leaves unexplained
};

}  // namespace moraine::coupling
