// The rows of the verification table that live on the grid alone.
#include <cstdio>

#include "fluid/problems.hpp"

namespace moraine::fluid {
namespace {

// Slope of log error against log resolution between neighbours.
template <class Error>
void expect_slope(double wanted, const std::vector<int>& resolution, Error&& error_at) {
  double before = 0;
  for (std::size_t i = 0; i < resolution.size(); ++i) {
    const double now = error_at(resolution[i]);
    if (i > 0) {
      const double slope = std::log(before / now) / std::log(1.0 * resolution[i] / resolution[i - 1]);
      // The table's tolerance; what is left of the next order at these resolutions is less.
      EXPECT_NEAR(slope, wanted, 0.1) << resolution[i] << ": " << before << " -> " << now;
    }
    before = now;
  }
}

// 1 % of p0, the table's. On 32 cells the grid leaves about 1e-3 and 500 steps to a unit of T about 5e-3.
TEST(KnownAnswers, TerzaghiConsolidation) {
  EXPECT_LT(terzaghi_error(32, {500, {}}), 0.01);
  EXPECT_LT(terzaghi_error(32, {}), 0.01);
}

TEST(KnownAnswers, TerzaghiConsolidationIsOfSecondOrderInSpace) {
  expect_slope(2, {8, 16, 32}, [](int nz) { return terzaghi_error(nz, {}); });
}

// 2 % of A, the table's; exp(-6) = 0.25 % of it comes from the closed end of the column at 6 d.
TEST(KnownAnswers, SinusoidalPressureAtTheTop) {
  EXPECT_LT(sinusoid_error(48, {}, Sinusoid::half_space), 0.02);
  EXPECT_LT(sinusoid_error(48, {400, {}}, Sinusoid::half_space), 0.02);
}

TEST(KnownAnswers, SinusoidalPressureAtTheTopIsOfSecondOrderInSpace) {
  expect_slope(2, {48, 96, 192}, [](int nz) { return sinusoid_error(nz, {}, Sinusoid::column); });
}

TEST(KnownAnswers, ManufacturedPressureWithVariableKIsOfSecondOrderInSpace) {
  Way way;
  way.options.solver = SolverChoice::pcg;
  expect_slope(2, {8, 12, 18}, [&](int n) { return manufactured_error(n, way); });
}

TEST(KnownAnswers, BackwardEulerIsOfFirstOrderInTime) {
  expect_slope(1, {50, 100, 200, 400}, [](int steps) { return time_error({steps, {}}); });
}

// Fixed steps short enough for the slope and long enough that it is not rounding (errors 1e-4 to 1e-9).
TEST(KnownAnswers, EvolveIsOfItsMethodsOrderInTime) {
  const auto error_at = [](int order) {
    return [order](int steps) {
      Way way{0, {1e-12, 1e-9}};
      way.options.order = order;
      way.options.fixed_step = 2e-3 / steps;
      return time_error(way);
    };
  };
  expect_slope(2, {200, 400, 800}, error_at(2));
  expect_slope(3, {80, 160, 320}, error_at(3));
  expect_slope(4, {80, 160, 320}, error_at(4));
}

// Series resistance: Darcy velocity (p_low - p_high)/(mu sum h/k), p linear within each layer. 1e-10, the
// table's; three steps of 1e8 s leave 1e-20 of the start, the solver 1e-14.
TEST(KnownAnswers, SteadyFlowThroughLayers) {
  for (const int axis : {0, 1, 2})
    for (const SolverChoice choice : {SolverChoice::pcg, SolverChoice::cholmod}) {
      Grid grid{{2, 3, 2}, {0.2, 0.3, 0.1}, {true, true, true}};
      grid.periodic[axis] = false, grid.n[axis] = 12, grid.length[axis] = 0.6;
      Sides sides;
      sides.low[axis] = pressure_side(2e4), sides.high[axis] = pressure_side(5e3);
      Medium m = uniform(grid, 0.3, 0);
      const auto layer_k = [](int i) { return i < 5 ? 1e-12 : i < 8 ? 2e-14 : 1e-11; };
      const auto along = [&](std::size_t c) {
        const std::size_t stride = axis == 0 ? 1 : axis == 1 ? grid.n[0] : grid.n[0] * grid.n[1];
        return static_cast<int>(c / stride % grid.n[axis]);
      };
      for (std::size_t c = 0; c < grid.cells(); ++c) m.permeability[c] = layer_k(along(c));
      PressureStep step(grid, sides, {choice, 1e-14, 2000});
      step.set(grid, m);
      std::vector<double> p(grid.cells(), 0.0), q(p), none(p), flux;
      Exchanged through;
      for (int i = 0; i < 3; ++i) through = step.step(0, 1e8, none, q, p);

      const double h = grid.h(axis);
      double resistance = 0;
      for (int i = 0; i < 12; ++i) resistance += m.viscosity * h / layer_k(i);
      const double velocity = (2e4 - 5e3) / resistance, area = grid.face_area(axis);
      step.flux(axis, 0, p, flux);
      for (const double f : flux) EXPECT_NEAR(f / area, velocity, 1e-10 * velocity);
      const double cells_of_side = static_cast<double>(grid.cells()) / 12;
      EXPECT_NEAR(through.low[axis], velocity * area * cells_of_side * 1e8, 1e-2 * velocity * area);
      EXPECT_NEAR(through.high[axis], -through.low[axis], 1e-10 * through.low[axis]);
      // Power of the pressures = dissipation.
      EXPECT_NEAR(step.dissipation(), velocity * area * cells_of_side * 1.5e4,
                  1e-10 * velocity * area * cells_of_side * 1.5e4);
      for (std::size_t c = 0; c < grid.cells(); ++c) {
        double before = 0;
        for (int i = 0; i < along(c); ++i) before += m.viscosity * h / layer_k(i);
        before += m.viscosity * h / 2 / layer_k(along(c));
        EXPECT_NEAR(p[c], 2e4 - velocity * before, 1e-10 * 2e4);
      }
    }
}

}  // namespace
}  // namespace moraine::fluid
