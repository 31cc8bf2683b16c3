#include "fluid/step.hpp"

#include <nvector/nvector_serial.h>

#include <algorithm>
#include <cmath>

#include "error.hpp"
#include "fluid/darcy.hpp"
#include "fluid/linear_solver.hpp"

namespace moraine::fluid {

namespace {

// PCG takes some sqrt(dt L/C) iterations, a factor costs one large effort at each set(): direct where
// diffusion crosses many cells in a step and the factor is small.
constexpr double fast_diffusion = 30;
constexpr std::size_t small_grid = 10000;

}  // namespace

struct PressureStep::Impl {
  Impl(const Grid& grid, const Sides& sides, const SolverOptions& o)
      : darcy(grid, sides), options(o), context(make_context()) {
    x = make_vector(grid.cells(), context.get()), b = make_vector(grid.cells(), context.get());
    system.darcy = &darcy;
    pcg = make_pcg(system, x.get(), options.max_iterations, context.get());
    change.resize(grid.cells());
  }

  void use(double dt) {
    if (dt == system.dt) return;
    system.dt = dt;
    double fastest = 0;
    for (std::size_t c = 0; c < change.size(); ++c)
      fastest = std::max(fastest, dt * darcy.outflow()[c] / darcy.storage()[c]);
    direct =
        options.choice == SolverChoice::cholmod || (options.choice == SolverChoice::automatic &&
                                                    fastest > fast_diffusion && change.size() <= small_grid);
    if (!direct) return;
    if (!cholmod) cholmod = make_cholmod(system, context.get());
    if (SUNLinSolSetup(cholmod.get(), nullptr) != 0)
      throw error("pore water: CHOLMOD cannot factorise the pressure's matrix of ", change.size(), " cells");
  }

  void solve() {
    ++report.solves;
    if (direct) {
      if (SUNLinSolSolve(cholmod.get(), nullptr, x.get(), b.get(), 0) != 0)
        throw error("pore water: CHOLMOD cannot solve for the pressure in ", change.size(), " cells");
      return;
    }
    // The 2-norm of the residual.
    const double target = std::max(options.tolerance * std::sqrt(N_VDotProd(b.get(), b.get())), 1e-300);
    const int flag = SUNLinSolSolve(pcg.get(), nullptr, x.get(), b.get(), target);
    report.iterations += SUNLinSolNumIters(pcg.get());
    if (flag != 0)
      throw error("pore water: conjugate gradients stop at a residual of ", SUNLinSolResNorm(pcg.get()),
                  " m3 after ", SUNLinSolNumIters(pcg.get()), " iterations; expected at most ", target,
                  " m3: try fluid.solver = \"cholmod\" or a larger fluid.tolerance");
  }

  Darcy darcy;
  SolverOptions options;
  Owned<SUNContext, FreeContext> context;
  System system;
  Owned<N_Vector, FreeVector> x, b;
  Owned<SUNLinearSolver, FreeSolver> pcg, cholmod;
  bool direct = false;
  std::vector<double> change;
  Report report;
};

PressureStep::PressureStep(const Grid& grid, const Sides& sides, const SolverOptions& options)
    : impl_(std::make_unique<Impl>(grid, sides, options)) {}
PressureStep::~PressureStep() = default;
PressureStep::PressureStep(PressureStep&&) noexcept = default;
PressureStep& PressureStep::operator=(PressureStep&&) noexcept = default;

void PressureStep::set(const Grid& grid, const Medium& medium) {
  impl_->darcy.set(grid, medium);
  impl_->system.dt = -1;  // a factor belongs to one medium
}

Exchanged PressureStep::step(double t, double dt, const std::vector<double>& div_u, std::vector<double>& q,
                             std::vector<double>& p) {
  Impl& m = *impl_;
  m.use(dt);
  double *const b = NV_DATA_S(m.b.get()), *const x = NV_DATA_S(m.x.get());
  for (std::size_t c = 0; c < q.size(); ++c) b[c] = q[c] - div_u[c], x[c] = p[c];
  std::copy_n(b, q.size(), m.change.data());
  m.darcy.add_sides(dt, t, b);
  m.solve();
  std::copy_n(x, q.size(), p.data());
  const Exchanged in = m.darcy.through_sides(t, dt, p);
  m.darcy.add_flow(-dt, p.data(), m.change.data());
  m.darcy.add_inflow(dt, t, p, m.change.data());
  std::swap(q, m.change);
  return in;
}

const std::vector<double>& PressureStep::storage() const { return impl_->darcy.storage(); }
const std::vector<double>& PressureStep::transmissibility(int axis) const {
  return impl_->darcy.transmissibility(axis);
}
void PressureStep::flux(int axis, double t, const std::vector<double>& p, std::vector<double>& out) const {
  impl_->darcy.flux(axis, t, p, out);
}
double PressureStep::dissipation(double t, const std::vector<double>& p) const {
  return impl_->darcy.dissipation(t, p);
}

PressureStep::Report PressureStep::report() const {
  Report r = impl_->report;
  r.solver = impl_->direct ? "cholmod" : "pcg, jacobi";
  if (impl_->cholmod) r.factorisations = cholmod_factorisations(impl_->cholmod.get());
  return r;
}

}  // namespace moraine::fluid
