// Linear solvers for (w C + dt L) x = b behind SUNDIALS' interface: its conjugate gradients with the diagonal
// as preconditioner, and a direct one of our own around CHOLMOD, whose symbolic analysis is done once and
// whose numeric factor is kept until it is told that the matrix has changed (SUNLinSolSetup).
#pragma once
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_nvector.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fluid/darcy.hpp"

namespace moraine::fluid {

struct FreeContext {
  void operator()(SUNContext c) const { SUNContext_Free(&c); }
};
struct FreeVector {
  void operator()(N_Vector v) const { N_VDestroy(v); }
};
struct FreeSolver {
  void operator()(SUNLinearSolver s) const { SUNLinSolFree(s); }
};
template <class Pointer, class Free>
using Owned = std::unique_ptr<std::remove_pointer_t<Pointer>, Free>;

Owned<SUNContext, FreeContext> make_context();  // SUNDIALS' own messages go to errors, not to the terminal

// The matrix at hand.
struct System {
  const Darcy* darcy = nullptr;
  double w = 1, dt = 0;
};

// The custom solver: a SUNLinearSolver of the matrix that `system` describes when SUNLinSolSetup is called
// (its SUNMatrix argument is not used). system must outlive it.
Owned<SUNLinearSolver, FreeSolver> make_cholmod(const System& system, SUNContext context);
std::int64_t cholmod_factorisations(SUNLinearSolver solver);

// A vector of n numbers; its dot products are those of SUNDIALS, but for the speed.
Owned<N_Vector, FreeVector> make_vector(std::size_t n, SUNContext context);

// Conjugate gradients with preconditioner 1/diagonal.
Owned<SUNLinearSolver, FreeSolver> make_pcg(System& system, N_Vector like, int max_iterations,
                                            SUNContext context);

}  // namespace moraine::fluid
