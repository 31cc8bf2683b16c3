// Pore pressure by itself, over a skeleton at rest:
//
//   dq/dt = b(t) - L p + source(t),   q = C p   (as in darcy.hpp)
//
// from t0 to t1 with ARKODE's diagonally implicit Runge-Kutta methods and steps that follow the error. The
// integrator's unknown is y = C^(1/2) p, whose system I + gamma C^(-1/2) L C^(-1/2) is symmetric: conjugate
// gradients, matrix-free, with the diagonal or CHOLMOD as preconditioner; CHOLMOD's factor is kept until the
// method's gamma has moved too far. Water is conserved to rounding: what is added to q are fluxes.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "fluid/step.hpp"

namespace moraine::fluid {

// Sets the water that enters each cell, m3/s, at time t.
using Source = std::function<void(double t, std::vector<double>& rate)>;

struct EvolveOptions {
  // Estimated error of p in a step, each cell's over relative |p| + absolute, is kept below 1 (root mean
  // square).
  double relative_tolerance = 1e-6;
  double absolute_tolerance = 1e-3;  // Pa
  int order = 4;                     // of the method, 2 to 5
  double fixed_step = 0;             // s; above 0: steps of this length, whatever the error
  std::int64_t max_steps = 100000;
  SolverChoice solver = SolverChoice::automatic;  // cholmod: as preconditioner
  int max_iterations = 500;                       // of conjugate gradients in one solve
};

struct Evolved {
  std::string solver;  // as in PressureStep::Report
  std::int64_t steps = 0, error_test_failures = 0, evaluations = 0, solves = 0, iterations = 0,
               factorisations = 0;
  double last_step = 0;  // s
};

// Advances q (m3, of each cell) from t0 to t1 (s); p: out, Pa at t1. Steps are no longer than an eighth of
// the shortest period among the sides. Throws Error where it gives up, and leaves q and p as they were.
Evolved evolve(const Grid& grid, const Sides& sides, const Medium& medium, double t0, double t1,
               std::vector<double>& q, std::vector<double>& p, const EvolveOptions& options = {},
               const Source& source = {});

}  // namespace moraine::fluid
