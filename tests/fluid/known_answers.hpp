// Problems whose answer is known, as functions of resolution: each returns how far off it ends. Shared by the
// tests and bench/fluid-convergence.
#pragma once
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "fluid/darcy.hpp"
#include "fluid/evolve.hpp"
#include "fluid/step.hpp"

namespace moraine::fluid {

constexpr double pi = std::numbers::pi;

inline Medium uniform(const Grid& grid, double porosity, double permeability) {
  Medium m;
  m.porosity.assign(grid.cells(), porosity);
  m.permeability.assign(grid.cells(), permeability);
  return m;
}

inline double diffusivity(const Medium& m) {  // m2/s, of the first cell
  return m.permeability[0] / (m.viscosity * m.porosity[0] * m.compressibility);
}

inline Side pressure_side(double value) {
  Side s;
  s.kind = Side::Kind::pressure, s.value = value;
  return s;
}

// What takes p of a grid from t0 to t1: `steps` of backward Euler, or evolve() where there are none.
struct Way {
  int steps = 0;
  EvolveOptions options{1e-7, 1e-4};  // of pressures of 1e4 Pa: 1e-6 over some ten steps
};

inline void advance(const Grid& grid, const Sides& sides, const Medium& medium, double t0, double t1,
                    std::vector<double>& p, const Way& way, const Source& source = {}) {
  PressureStep one(grid, sides, {SolverChoice::automatic, 1e-12, 2000});
  one.set(grid, medium);
  std::vector<double> q(p), div_u(grid.cells(), 0.0);
  for (std::size_t c = 0; c < q.size(); ++c) q[c] *= one.storage()[c];
  if (way.steps == 0) {
    evolve(grid, sides, medium, t0, t1, q, p, way.options, source);
    return;
  }
  const double dt = (t1 - t0) / way.steps;
  for (int i = 1; i <= way.steps; ++i) {
    const double t = t0 + i * dt;
    if (source) {
      source(t, div_u);
      for (double& v : div_u) v *= -dt;
    }
    one.step(t, dt, div_u, q, p);
  }
}

// Terzaghi: a column under uniform excess pressure that drains through its top from T = 0 on. p/p0 at
// distance z from the top.
inline double terzaghi(double z, double T) {
  double sum = 0;
  for (int m = 0; m < 200; ++m) {
    const double M = pi * (2 * m + 1) / 2, term = 2 / M * std::exp(-M * M * T);
    sum += term * std::sin(M * z);
    if (term < 1e-18) break;
  }
  return sum;
}

// Largest error of p/p0 over all cells at T = 0.05, 0.1, 0.2, 0.5, 1; way.steps are for a unit of T.
inline double terzaghi_error(int nz, const Way& way) {
  Grid grid{{1, 1, nz}, {0.1, 0.1, 2}, {true, true, false}};
  Sides sides;
  sides.high[2] = pressure_side(0);
  const Medium m = uniform(grid, 0.4, 1e-12);
  const double p0 = 1e4, unit = grid.length[2] * grid.length[2] / diffusivity(m);
  std::vector<double> p(grid.cells(), p0);
  double T = 0, worst = 0;
  for (const double next : {0.05, 0.1, 0.2, 0.5, 1.0}) {
    Way part = way;
    part.steps = static_cast<int>(std::lround((next - T) * way.steps));
    advance(grid, sides, m, T * unit, next * unit, p, part);
    T = next;
    for (int k = 0; k < nz; ++k)
      worst = std::max(worst, std::abs(p[k] / p0 - terzaghi(1 - (k + 0.5) / nz, T)));
  }
  return worst;
}

// Sinusoidal pressure A sin(w t) at the top of a column of height H = 6 d, d = sqrt(2 D/w), closed below.
struct Sinusoid {
  static constexpr double depths = 6;
  // p/A at distance z (in d) below the top: of the half-space, and of the column.
  static double half_space(double z, double wt) { return std::exp(-z) * std::sin(wt - z); }
  static double column(double z, double wt) {
    const std::complex<double> kappa(1, 1), phase(0, wt);
    return (std::cosh(kappa * (depths - z)) / std::cosh(kappa * depths) * std::exp(phase)).imag();
  }
};

// Largest error of p/A over the cells, worst of eight times over the second period; begun from the answer.
template <class Answer>
double sinusoid_error(int nz, const Way& way, Answer&& answer) {
  const double A = 1e4, f = 0.2, w = 2 * pi * f;
  Grid grid{{1, 1, nz}, {0.1, 0.1, 1}, {true, true, false}};
  const Medium m = uniform(grid, 0.4, 1e-12);
  const double d = std::sqrt(2 * diffusivity(m) / w);
  grid.length[2] = Sinusoid::depths * d;
  Sides sides;
  sides.high[2] = pressure_side(0);
  sides.high[2].amplitude = A, sides.high[2].frequency = f;
  std::vector<double> p(nz);
  const auto depth = [&](int k) { return Sinusoid::depths * (1 - (k + 0.5) / nz); };
  for (int k = 0; k < nz; ++k) p[k] = A * answer(depth(k), 0);
  double worst = 0;
  for (int eighth = 0; eighth < 16; ++eighth) {
    Way part = way;
    part.steps = way.steps / 8;  // way.steps are for a period
    advance(grid, sides, m, eighth / (8 * f), (eighth + 1) / (8 * f), p, part);
    if (eighth < 8) continue;
    for (int k = 0; k < nz; ++k)
      worst = std::max(worst, std::abs(p[k] / A - answer(depth(k), 2 * pi * (eighth + 1) / 8)));
  }
  return worst;
}

// Manufactured pressure in a unit cube with variable k and phi, periodic in x and y, closed below, p = 0
// above: p = P(t) g(x, y, z), g = sin(2 pi x) cos(2 pi y) cos(pi z/2), k = k0 a(x, y) b(z).
struct Manufactured {
  static constexpr double P0 = 1e4, k0 = 1e-12, period = 0.02, end = 0.3 * period;
  static double P(double t) { return P0 * (1 + 0.5 * std::sin(2 * pi * t / period)); }
  static double P_rate(double t) { return P0 * pi / period * std::cos(2 * pi * t / period); }
  static double g(double x, double y, double z) {
    return std::sin(2 * pi * x) * std::cos(2 * pi * y) * std::cos(pi * z / 2);
  }
  static double porosity(double x, double z) { return 0.4 + 0.1 * std::cos(2 * pi * x) * std::sin(pi * z); }
  static double k(double x, double y, double z) {
    return k0 * (1 + 0.5 * std::sin(2 * pi * x + 1) * std::cos(2 * pi * y)) * (1 + 0.5 * z);
  }
  static double div_k_grad_g(double x, double y, double z) {
    const double X = std::sin(2 * pi * x), Y = std::cos(2 * pi * y), Z = std::cos(pi * z / 2);
    const double X1 = 2 * pi * std::cos(2 * pi * x), Y1 = -2 * pi * std::sin(2 * pi * y),
                 Z1 = -pi / 2 * std::sin(pi * z / 2);
    const double a = 1 + 0.5 * std::sin(2 * pi * x + 1) * Y, b = 1 + 0.5 * z;
    const double a_x = pi * std::cos(2 * pi * x + 1) * Y, a_y = 0.5 * std::sin(2 * pi * x + 1) * Y1;
    return k0 * (a * b * -(8 + 0.25) * pi * pi * X * Y * Z + a_x * b * X1 * Y * Z + a_y * b * X * Y1 * Z +
                 0.5 * a * X * Y * Z1);
  }
};

// Root mean square error of p/P0 at the end.
inline double manufactured_error(int n, const Way& way) {
  using E = Manufactured;
  Grid grid{{n, n, n}, {1, 1, 1}, {true, true, false}};
  Sides sides;
  sides.high[2] = pressure_side(0);
  Medium m = uniform(grid, 0.4, 0);
  std::vector<double> p(grid.cells()), g(p), steady(p), storage(p);
  const auto each_cell = [&](auto&& body) {
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) body(grid.cell(i, j, k), (i + 0.5) / n, (j + 0.5) / n, (k + 0.5) / n);
  };
  each_cell([&](std::size_t c, double x, double y, double z) {
    m.porosity[c] = E::porosity(x, z), m.permeability[c] = E::k(x, y, z);
    g[c] = E::g(x, y, z), p[c] = E::P(0) * g[c];
    steady[c] = -grid.cell_volume() / m.viscosity * E::div_k_grad_g(x, y, z);
    storage[c] = grid.cell_volume() * m.compressibility * m.porosity[c] * g[c];
  });
  advance(grid, sides, m, 0, E::end, p, way, [&](double t, std::vector<double>& rate) {
    for (std::size_t c = 0; c < rate.size(); ++c) rate[c] = E::P_rate(t) * storage[c] + E::P(t) * steady[c];
  });
  double squares = 0;
  for (std::size_t c = 0; c < p.size(); ++c)
    squares += std::pow(p[c] / E::P0 - E::P(E::end) / E::P0 * g[c], 2);
  return std::sqrt(squares / static_cast<double>(p.size()));
}

// Error in time alone: a pressure that solves the equations on the grid exactly, random from cell to cell and
// sinusoidal in time. Largest error of p/P0 at the end.
inline double time_error(const Way& way) {
  Grid grid{{4, 3, 6}, {0.2, 0.2, 0.3}, {true, true, false}};
  Sides sides;
  sides.low[2].kind = Side::Kind::flux, sides.low[2].value = 1e-6;
  sides.high[2] = pressure_side(0);
  Medium m = uniform(grid, 0.4, 1e-12);
  std::vector<double> shape(grid.cells()), p(shape), flow(shape);
  for (std::size_t c = 0; c < p.size(); ++c) {
    m.permeability[c] *= 1 + 0.5 * std::sin(2.7 * static_cast<double>(c));
    shape[c] = std::sin(1.3 * static_cast<double>(c) + 0.5);
  }
  Darcy darcy(grid, sides);
  darcy.set(grid, m);
  using E = Manufactured;
  const double end = 2e-3, w = 2 * pi / 3e-3;
  const auto P = [&](double t) { return E::P0 * (1 + 0.5 * std::sin(w * t)); };
  for (std::size_t c = 0; c < p.size(); ++c) p[c] = P(0) * shape[c];
  std::vector<double> exact(p);
  advance(grid, sides, m, 0, end, p, way, [&](double t, std::vector<double>& rate) {
    for (std::size_t c = 0; c < rate.size(); ++c) exact[c] = P(t) * shape[c];
    darcy.outflow(t, exact.data(), flow.data());
    for (std::size_t c = 0; c < rate.size(); ++c)
      rate[c] = darcy.storage()[c] * shape[c] * E::P0 * 0.5 * w * std::cos(w * t) + flow[c];
  });
  double worst = 0;
  for (std::size_t c = 0; c < p.size(); ++c)
    worst = std::max(worst, std::abs(p[c] - P(end) * shape[c]) / E::P0);
  return worst;
}

}  // namespace moraine::fluid
