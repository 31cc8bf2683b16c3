// Pore water that grains displace and that pushes them: Darcy flow on a grid (src/fluid) coupled to the
// grains by a scheme that conserves water, momentum and energy. At an exchange, m steps after the last one:
//
//   U_f = sum_i b_if (x_i - x_i at the last exchange)            solids through face f, m3
//   (C + Delta L) p = q - div U, q <- q - div U - Delta L p      fluid/step.hpp, Delta = m dt
//   f_i = -sum_f b_if (p_above - p_below)                        N, = -V/(1 - phi) grad p
//
// b_if = A_f V_i w_if / sum_j V_j w_jf: hats about the face's centre, made to reproduce affine motion
// (mapping.hpp), so that shear of a bed of few grains makes no false divergence. Force and displacement share
// them: the work on the grains is the work of the pressure, and momentum telescopes. Along z the grid is
// stretched between floor and wall. An impermeable wall displaces A dH and carries p A; a drained one carries
// the pressure of the side.
//
// pore_water.cpp has the exchange. Its parts: skeleton (what grains are to the water), faces (div, grad p),
// thrust (f_i), account (what drained), stability (m), readings and describe (what one is told).
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "coupling/stability.hpp"
#include "coupling/water.hpp"
#include "dem/fluid_coupling.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::coupling {

class PoreWater : public dem::FluidCoupling {
 public:
  virtual std::int64_t interval() const = 0;  // steps, chosen or checked
  virtual Stability stability() const = 0;
  virtual WaterState state() const = 0;  // after an exchange
  virtual WaterFields fields() const = 0;
  // Pressures over all cells, or over the upper half of their levels, where a sheared bed deforms.
  virtual WaterRecord record(bool upper_half) const = 0;
  virtual std::string solver() const = 0;  // as used so far, e.g. "pcg, jacobi: 6.2 iterations a solve"
  // What lies outside the grid, by side, e.g. "3 grains beyond x = 0.2 m (1e-05 m3 of solids)"; empty:
  // nothing.
  virtual std::string outside() const = 0;
  virtual std::string describe()
      const = 0;  // e.g. "water: 8 x 8 x 7 cells of 0.105 m (2.6 d), exchange every step, pcg"
};

// Whether this build has pore water in it (MORAINE_FLUID).
bool water_built();

// `grains`: at the start of a stage (or at an exchange, after a restart). `before`: what an earlier stage or
// a checkpoint left, whose pressures are carried over to another grid; empty q: the pressure of the top
// everywhere. restart: go on with the same bits. Throws Error where the description contradicts itself, where
// the grid is finer than memory allows, where the interval that is asked for is unstable (naming the longest
// that is not), and in builds without MORAINE_FLUID.
std::unique_ptr<PoreWater> make_pore_water(const Water& water, const dem::Scene& scene,
                                           const dem::State& grains, const WaterState& before, bool restart);

}  // namespace moraine::coupling
