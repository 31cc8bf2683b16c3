// Solves (C + s L) p = b for the symmetric positive definite operator of darcy.hpp through SUNDIALS' linear
// solver interface: conjugate gradients (SUNLinSol_PCG, matrix-free) with the diagonal or CHOLMOD as
// preconditioner, or CHOLMOD itself with iterative refinement.
#pragma once
#include <sundials/sundials_linearsolver.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "fluid/darcy.hpp"

namespace moraine::fluid {

// CHOLMOD's factor of C + s L. The symbolic analysis is made once, at the first factor.
class Cholmod {
 public:
  explicit Cholmod(const Darcy& darcy);
  ~Cholmod();
  Cholmod(Cholmod&&) = delete;
  void factor(double s);  // throws Error where the matrix is not positive definite in double precision
  void solve(const double* b, double* x);
  std::int64_t factorisations() const;
  double solves_per_factor() const;  // how many solves take the arithmetic of one factor
  std::size_t cells() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The same as a SUNLinearSolver (direct; its matrix argument is not used, setup and s are the owner's).
SUNLinearSolver make_cholmod_solver(Cholmod& cholmod, SUNContext context);

enum class Method { pcg_jacobi, pcg_cholmod, cholmod };
const char* name(Method method);

class LinearSolver {
 public:
  LinearSolver(const Darcy& darcy, const SolverOptions& options);
  ~LinearSolver();
  LinearSolver(LinearSolver&&) = delete;

  // x: in, the guess; out, the solution: |b - A x| <= max(tolerance |b|, what rounding of A x allows).
  // Throws Error where that is not reached. What comes out depends on the coefficients, s and the arguments
  // alone, not on what was solved before.
  void solve(double s, const double* b, double* x);

  Method method() const;  // of the last solve
  std::int64_t solves() const;
  std::int64_t iterations() const;
  std::int64_t factorisations() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moraine::fluid
