// One implicit step of pore pressure on a grid, for callers that move the skeleton themselves.
//
//   (C + dt L) p = q - div U + dt b(t),   then   q <- q - div U - dt div Q,   Q_f = T_f (p_low - p_high)
//
// q: m3, excess water volume stored in each cell; the state (p = q/C). C = beta phi V, m3/Pa. L from the face
// transmissibilities T = A k_f/(mu_f l), m3/(Pa s), k_f the harmonic mean of both cells, l the distance of
// centres (half a cell at a side of given pressure). U_f: m3, volume of skeleton that passed face f upwards
// along its axis during the step (div U = sum of U leaving the cell); b: sides. q is updated from face
// fluxes, so water is conserved to rounding whatever the solver's tolerance. Backward Euler: first order in
// dt.
#pragma once
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "fluid/grid.hpp"

namespace moraine::fluid {

// A layer of cells beside a wall whose mean porosity is that of a bed and of a gap between bed and wall: flow
// towards the wall meets the bed, and then nothing.
struct WallGap {
  double k = 1;      // permeability of the bed over that of the cells
  double width = 0;  // m, of the way from the centres to the wall that does not resist
};

// What fills the cells.
struct Medium {
  double viscosity = 1.8e-3;                    // Pa s, mu_f
  double compressibility = 4.5e-10;             // 1/Pa, beta
  std::vector<double> porosity;                 // 1, phi of each cell
  std::vector<double> permeability;             // m2, k of each cell
  std::array<std::array<WallGap, 2>, 3> gap{};  // at the low and high side of each axis
};

enum class SolverChoice { automatic, pcg, cholmod };

struct SolverOptions {
  SolverChoice choice = SolverChoice::automatic;
  double tolerance = 1e-10;  // of the residual, relative to the right-hand side
  int max_iterations = 500;  // PCG
};

// Volumes through sides during a step, m3, positive into the grid; by axis.
struct Exchanged {
  std::array<double, 3> low{}, high{};
};

class PressureStep {
 public:
  PressureStep(const Grid& grid, const Sides& sides, const SolverOptions& options = {});
  ~PressureStep();
  PressureStep(PressureStep&&) noexcept;
  PressureStep& operator=(PressureStep&&) noexcept;

  // New height, porosity and permeability. Throws Error naming the cell where they are impossible. Cheap
  // enough for every few hundred steps; the symbolic analysis is kept, the numeric factor is made anew only
  // when needed.
  void set(const Grid& grid, const Medium& medium);

  // Advances q (cells() long) by dt to time t (of the sides' values). div_u: cells() long, m3. p: in, the
  // guess; out, the pressure at t. Where the solver does not converge the step is done in two halves; throws
  // Error where that fails, too (q and p are then as they were).
  Exchanged step(double t, double dt, const std::vector<double>& div_u, std::vector<double>& q,
                 std::vector<double>& p);

  const std::vector<double>& storage() const;                   // m3/Pa, C of each cell
  const std::vector<double>& transmissibility(int axis) const;  // m3/(Pa s), of each face
  // m3/s through each face of an axis, upwards along it, at pressures p and time t.
  void flux(int axis, double t, const std::vector<double>& p, std::vector<double>& out) const;
  // W, dissipated by the flow at the end of the last step: sum of T (drop of p)^2, sides included.
  double dissipation() const;

  struct Report {
    std::string solver;  // "pcg, jacobi" | "pcg, cholmod" | "cholmod"
    std::int64_t solves = 0, iterations = 0, factorisations = 0;
  };
  Report report() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moraine::fluid
