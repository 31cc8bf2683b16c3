#include "fluid/step.hpp"

#include <algorithm>

#include "error.hpp"
#include "fluid/darcy.hpp"
#include "fluid/linear_solver.hpp"

namespace moraine::fluid {

struct PressureStep::Impl {
  Darcy darcy;
  LinearSolver solver;
  std::vector<double> rhs, out;
  std::vector<double> q, pressure;  // of the step under way
  double dissipation = 0;

  Impl(const Grid& grid, const Sides& sides, const SolverOptions& options)
      : darcy(grid, sides), solver(darcy, options) {
    for (auto* v : {&rhs, &out}) v->assign(grid.cells(), 0);
  }

  // share: of the step's div_u.
  Exchanged advance(double t, double dt, double share, const std::vector<double>& div_u) {
    const std::size_t n = rhs.size();
    for (std::size_t c = 0; c < n; ++c) rhs[c] = q[c] - share * div_u[c];
    darcy.add_sides(dt, t, rhs.data());
    solver.solve(dt, rhs.data(), pressure.data());
    darcy.outflow(t, pressure.data(), out.data());
    for (std::size_t c = 0; c < n; ++c) q[c] = (q[c] - share * div_u[c]) - dt * out[c];
    Exchanged volume = darcy.inflow(t, pressure.data());
    for (int a = 0; a < 3; ++a) volume.low[a] *= dt, volume.high[a] *= dt;
    return volume;
  }
};

PressureStep::PressureStep(const Grid& grid, const Sides& sides, const SolverOptions& options)
    : impl_(std::make_unique<Impl>(grid, sides, options)) {}
PressureStep::~PressureStep() = default;
PressureStep::PressureStep(PressureStep&&) noexcept = default;
PressureStep& PressureStep::operator=(PressureStep&&) noexcept = default;

void PressureStep::set(const Grid& grid, const Medium& medium) { impl_->darcy.set(grid, medium); }

Exchanged PressureStep::step(double t, double dt, const std::vector<double>& div_u, std::vector<double>& q,
                             std::vector<double>& p) {
  Impl& m = *impl_;
  const std::size_t n = m.rhs.size();
  if (m.darcy.version() == 0) throw error("pore water: a step before porosity and permeability were set");
  if (div_u.size() != n || q.size() != n || p.size() != n)
    throw error("pore water: ", div_u.size(), " volume changes, ", q.size(), " volumes and ", p.size(),
                " pressures; expected ", n, " of each");
  if (!(dt > 0)) throw error("pore water: a step of ", dt, " s; expected a positive one");
  m.q = q, m.pressure = p;
  Exchanged volume;
  try {
    volume = m.advance(t, dt, 1, div_u);
  } catch (const Error&) {
    m.q = q, m.pressure = p;
    volume = m.advance(t - 0.5 * dt, 0.5 * dt, 0.5, div_u);
    const Exchanged rest = m.advance(t, 0.5 * dt, 0.5, div_u);
    for (int a = 0; a < 3; ++a) volume.low[a] += rest.low[a], volume.high[a] += rest.high[a];
  }
  q = m.q, p = m.pressure;
  m.dissipation = m.darcy.dissipation(t, p.data(), m.out.data());
  return volume;
}

const std::vector<double>& PressureStep::storage() const { return impl_->darcy.storage(); }
const std::vector<double>& PressureStep::transmissibility(int axis) const {
  return impl_->darcy.transmissibility(axis);
}
void PressureStep::flux(int axis, double t, const std::vector<double>& p, std::vector<double>& out) const {
  out.resize(impl_->darcy.grid().face_count(axis));
  impl_->darcy.flux(axis, t, p.data(), out.data());
}
double PressureStep::dissipation() const { return impl_->dissipation; }
PressureStep::Report PressureStep::report() const {
  const LinearSolver& s = impl_->solver;
  return {name(s.method()), s.solves(), s.iterations(), s.factorisations()};
}

}  // namespace moraine::fluid
