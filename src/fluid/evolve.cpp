#include "fluid/evolve.hpp"

#include <arkode/arkode_arkstep.h>
#include <sunlinsol/sunlinsol_pcg.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <memory>

#include "error.hpp"
#include "fluid/darcy.hpp"
#include "fluid/linear_solver.hpp"
#include "fluid/vector.hpp"

namespace moraine::fluid {
namespace {

// Beyond, solves with a factor take longer than the iterations that they save: bench/results/fluid-times.csv.
constexpr std::size_t cholmod_cells = 1000;
// A factor for another gamma leaves a condition of at most the ratio of both. Up to `near` it costs nothing;
// up to `far` it is kept until iterations with it have taken the work of a new one.
constexpr double near = 1.3, far = 6;

// ARKODE takes a first linear solve that only lowered the residual for done, and a linear problem has no
// second: with the iterations used up, steps of fixed length could end anywhere.
int solve_or_fail(SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b, double tolerance) {
  const int flag = SUNLinSolSolve_PCG(solver, matrix, x, b, tolerance);
  return flag == SUNLS_RES_REDUCED ? SUNLS_CONV_FAIL : flag;
}

class Integration {
 public:
  Integration(const Darcy& darcy, const EvolveOptions& options, const Source& source)
      : darcy_(darcy), options_(options), source_(source), n_(darcy.grid().cells()), cholmod_(darcy) {
    for (auto* v : {&p_, &out_, &rate_, &root_, &inverse_diagonal_}) v->assign(n_, 0);
    for (std::size_t c = 0; c < n_; ++c) root_[c] = std::sqrt(darcy.storage()[c]);
    const bool factor = options.solver == SolverChoice::cholmod ||
                        (options.solver == SolverChoice::automatic && n_ <= cholmod_cells);
    method_ = factor ? Method::pcg_cholmod : Method::pcg_jacobi;
    SUNContext_Create(nullptr, &context_);
    y_ = new_vector(n_, context_);
    tolerance_ = new_vector(n_, context_);
    direct_ = make_cholmod_solver(cholmod_, context_);
    pcg_ = SUNLinSol_PCG(y_, SUN_PREC_LEFT, options.max_iterations, context_);
    if (!pcg_) throw error("pore water: no memory for the linear solver of ", n_, " cells");
    pcg_->ops->solve = solve_or_fail;
  }
  ~Integration() {
    ARKStepFree(&arkode_);
    SUNLinSolFree(pcg_);
    SUNLinSolFree(direct_);
    N_VDestroy(tolerance_);
    N_VDestroy(y_);
    SUNContext_Free(&context_);
  }
  Integration(Integration&&) = delete;

  Evolved run(double t0, double t1, double longest, std::vector<double>& q, std::vector<double>& p) {
    double* y = NV_DATA_S(y_);
    for (std::size_t c = 0; c < n_; ++c) {
      y[c] = q[c] / root_[c];
      NV_DATA_S(tolerance_)[c] = options_.absolute_tolerance * root_[c];
    }
    arkode_ = ARKStepCreate(nullptr, slope, t0, y_, context_);
    if (!arkode_) throw error("pore water: ARKODE cannot start");
    ARKStepSetErrHandlerFn(arkode_, keep_message, this);
    ARKStepSetUserData(arkode_, this);
    const int flags[] = {
        ARKStepSVtolerances(arkode_, options_.relative_tolerance, tolerance_),
        ARKStepSetOrder(arkode_, options_.order),
        ARKStepSetLinear(arkode_, 0),
        ARKStepSetLinearSolver(arkode_, pcg_, nullptr),
        ARKStepSetJacTimes(arkode_, nullptr, multiply),
        ARKStepSetPreconditioner(arkode_, set_up, precondition),
        ARKStepSetMaxNumSteps(arkode_, static_cast<long>(options_.max_steps)),
        ARKStepSetMaxStep(arkode_, longest),
        ARKStepSetStopTime(arkode_, t1),
        options_.fixed_step > 0 ? ARKStepSetFixedStep(arkode_, options_.fixed_step) : ARK_SUCCESS};
    for (const int flag : flags)
      if (flag != ARK_SUCCESS) throw error("pore water: ARKODE refuses its options: ", message_);

    double t = t0;
    const int flag = ARKStepEvolve(arkode_, t1, y_, &t, ARK_NORMAL);
    const Evolved done = statistics();
    if (failure_) std::rethrow_exception(failure_);
    if (flag < 0)
      throw error("pore water: ARKODE gave up at t = ", t, " s of ", t1, " s after ", done.steps, " steps (",
                  done.error_test_failures, " failed the error test, ", done.iterations, " iterations of ",
                  done.solver, "): ", message_,
                  "; expected to arrive: loosen the tolerances, or allow more steps or iterations");
    p.resize(n_);
    for (std::size_t c = 0; c < n_; ++c) q[c] = y[c] * root_[c], p[c] = y[c] / root_[c];
    return done;
  }

 private:
  static Integration& self(void* data) { return *static_cast<Integration*>(data); }

  // Callbacks may not throw through the library: an exception waits until ARKODE has returned.
  template <class Body>
  int guarded(Body&& body) {
    try {
      body();
      return 0;
    } catch (...) {
      failure_ = std::current_exception();
      return -1;
    }
  }

  static int slope(double t, N_Vector y, N_Vector to, void* data) {
    return self(data).guarded([&] {
      Integration& s = self(data);
      const double* from = NV_DATA_S(y);
      for (std::size_t c = 0; c < s.n_; ++c) s.p_[c] = from[c] / s.root_[c];
      s.darcy_.outflow(t, s.p_.data(), s.out_.data());
      if (s.source_) s.source_(t, s.rate_);
      for (std::size_t c = 0; c < s.n_; ++c) NV_DATA_S(to)[c] = (s.rate_[c] - s.out_[c]) / s.root_[c];
    });
  }
  static int multiply(N_Vector v, N_Vector to, double, N_Vector, N_Vector, void* data, N_Vector) {
    Integration& s = self(data);
    for (std::size_t c = 0; c < s.n_; ++c) s.p_[c] = NV_DATA_S(v)[c] / s.root_[c];
    s.darcy_.apply_flow(-1, s.p_.data(), NV_DATA_S(to));
    for (std::size_t c = 0; c < s.n_; ++c) NV_DATA_S(to)[c] /= s.root_[c];
    return 0;
  }
  static int set_up(double, N_Vector, N_Vector, int, int* current, double gamma, void* data) {
    *current = 1;
    return self(data).guarded([&] {
      Integration& s = self(data);
      if (s.method_ == Method::pcg_cholmod) {
        const double ratio = std::max(gamma, s.factor_gamma_) / std::min(gamma, s.factor_gamma_);
        if (ratio < near || (ratio < far && s.solves_with_factor_ < s.cholmod_.solves_per_factor())) return;
        s.cholmod_.factor(gamma);
        s.factor_gamma_ = gamma, s.solves_with_factor_ = 0;
        return;
      }
      s.darcy_.diagonal(gamma, s.inverse_diagonal_.data());
      for (std::size_t c = 0; c < s.n_; ++c)
        s.inverse_diagonal_[c] = s.darcy_.storage()[c] / s.inverse_diagonal_[c];
    });
  }
  static int precondition(double, N_Vector, N_Vector, N_Vector r, N_Vector z, double, double tolerance, int,
                          void* data) {
    Integration& s = self(data);
    const double* from = NV_DATA_S(r);
    double* to = NV_DATA_S(z);
    if (s.method_ == Method::pcg_jacobi) {
      for (std::size_t c = 0; c < s.n_; ++c) to[c] = from[c] * s.inverse_diagonal_[c];
      return 0;
    }
    ++s.solves_with_factor_;
    for (std::size_t c = 0; c < s.n_; ++c) to[c] = from[c] * s.root_[c];
    if (SUNLinSolSolve(s.direct_, nullptr, z, z, tolerance) != SUNLS_SUCCESS) return -1;
    for (std::size_t c = 0; c < s.n_; ++c) to[c] *= s.root_[c];
    return 0;
  }
  static void keep_message(int code, const char*, const char* where, char* text, void* data) {
    if (code >= 0) return;
    std::string& message = self(data).message_;
    message = std::string(where) + ": " + text;
    if (message.ends_with('.')) message.pop_back();
  }

  Evolved statistics() const {
    long steps = 0, tries = 0, failures = 0, none = 0, evaluations = 0, set_ups = 0, solves = 0,
         iterations = 0;
    Evolved e;
    ARKStepGetNumSteps(arkode_, &steps);
    ARKStepGetNumStepAttempts(arkode_, &tries);
    ARKStepGetNumErrTestFails(arkode_, &failures);
    ARKStepGetNumRhsEvals(arkode_, &none, &evaluations);
    ARKStepGetNumLinSolvSetups(arkode_, &set_ups);
    ARKStepGetNumNonlinSolvIters(arkode_, &solves);
    ARKStepGetNumLinIters(arkode_, &iterations);
    ARKStepGetLastStep(arkode_, &e.last_step);
    e.solver = name(method_);
    e.steps = steps, e.error_test_failures = failures, e.evaluations = evaluations, e.solves = solves;
    e.iterations = iterations, e.factorisations = cholmod_.factorisations();
    return e;
  }

  const Darcy& darcy_;
  const EvolveOptions& options_;
  const Source& source_;
  const std::size_t n_;
  Cholmod cholmod_;
  Method method_;
  SUNContext context_ = nullptr;
  N_Vector y_ = nullptr, tolerance_ = nullptr;
  SUNLinearSolver direct_ = nullptr, pcg_ = nullptr;
  void* arkode_ = nullptr;
  std::vector<double> p_, out_, rate_, root_, inverse_diagonal_;
  std::exception_ptr failure_;
  double factor_gamma_ = 0;  // s, 0: none
  std::int64_t solves_with_factor_ = 0;
  std::string message_ = "no message";
};

void check(const EvolveOptions& o) {
  const auto refuse = [](const char* what, double value, const char* expected) {
    throw error("pore water: ", what, " ", value, "; expected ", expected);
  };
  if (!(o.relative_tolerance >= 0 && o.relative_tolerance < 1))
    refuse("relative tolerance", o.relative_tolerance, "0 or more and less than 1");
  if (!(o.absolute_tolerance > 0)) refuse("absolute tolerance", o.absolute_tolerance, "more than 0 Pa");
  if (o.order < 2 || o.order > 5) refuse("order", o.order, "2, 3, 4 or 5");
  if (!(o.fixed_step >= 0)) refuse("fixed step", o.fixed_step, "0 s or more");
  if (o.max_steps < 1) refuse("steps at most:", static_cast<double>(o.max_steps), "one or more");
  if (o.max_iterations < 1) refuse("iterations at most:", o.max_iterations, "one or more");
}

}  // namespace

Evolved evolve(const Grid& grid, const Sides& sides, const Medium& medium, double t0, double t1,
               std::vector<double>& q, std::vector<double>& p, const EvolveOptions& options,
               const Source& source) {
  check(options);
  Darcy darcy(grid, sides);
  darcy.set(grid, medium);
  if (q.size() != grid.cells())
    throw error("pore water: ", q.size(), " volumes for ", grid.cells(), " cells; expected one each");
  if (!(t1 > t0)) throw error("pore water: from ", t0, " s to ", t1, " s; expected a later end");
  double highest = 0;  // Hz
  for (int a = 0; a < 3; ++a)
    if (!grid.periodic[a])
      for (const Side& side : {sides.low[a], sides.high[a]})
        if (side.amplitude != 0) highest = std::max(highest, side.frequency);
  const double longest = highest > 0 ? 1 / (8 * highest) : 0;  // 0: no limit
  return Integration(darcy, options, source).run(t0, t1, longest, q, p);
}

}  // namespace moraine::fluid
