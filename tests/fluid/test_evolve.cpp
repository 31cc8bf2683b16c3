// The grid by itself in time.
#include "fluid/evolve.hpp"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "fluid/problems.hpp"

namespace moraine::fluid {
namespace {

struct Setting {
  Grid grid{{3, 4, 5}, {0.2, 0.3, 0.5}, {true, true, false}};
  Sides sides;
  Medium medium = uniform(grid, 0.4, 0);
  Source source = [](double t, std::vector<double>& rate) {
    for (std::size_t c = 0; c < rate.size(); ++c) rate[c] = 1e-10 * std::sin(30 * t + static_cast<double>(c));
  };
  std::vector<double> q;

  explicit Setting(std::uint64_t seed) {
    Random random(seed);
    sides.low[2].kind = Side::Kind::flux;
    sides.low[2].amplitude = 1e-6, sides.low[2].frequency = 7;
    sides.high[2] = pressure_side(2e3);
    sides.high[2].amplitude = 1e3, sides.high[2].frequency = 4, sides.high[2].phase = 0.3;
    medium.porosity = random.vector(grid.cells(), 0.2, 0.9);
    for (double& k : medium.permeability) k = std::pow(10.0, random(-15, -12));
    q = random.vector(grid.cells(), 0, 1e4);
    PressureStep step(grid, sides);
    step.set(grid, medium);
    for (std::size_t c = 0; c < q.size(); ++c) q[c] *= step.storage()[c];
  }
};

// The same equations by CVODE (BDF, dense differences as Jacobian), in p.
std::vector<double> by_cvode(const Setting& s, double end) {
  struct Data {
    const Setting& setting;
    Darcy darcy;
    std::vector<double> flow, rate;
  } data{s, Darcy(s.grid, s.sides), std::vector<double>(s.q.size()), std::vector<double>(s.q.size())};
  data.darcy.set(s.grid, s.medium);
  const auto n = static_cast<sunindextype>(s.q.size());
  SUNContext context = nullptr;
  SUNContext_Create(nullptr, &context);
  N_Vector p = N_VNew_Serial(n, context);
  for (sunindextype c = 0; c < n; ++c) NV_Ith_S(p, c) = s.q[c] / data.darcy.storage()[c];
  void* cvode = CVodeCreate(CV_BDF, context);
  CVodeInit(
      cvode,
      [](double t, N_Vector now, N_Vector slope, void* user) {
        Data& d = *static_cast<Data*>(user);
        d.darcy.outflow(t, NV_DATA_S(now), d.flow.data());
        d.setting.source(t, d.rate);
        for (std::size_t c = 0; c < d.flow.size(); ++c)
          NV_Ith_S(slope, c) = (d.rate[c] - d.flow[c]) / d.darcy.storage()[c];
        return 0;
      },
      0, p);
  CVodeSetUserData(cvode, &data);
  CVodeSStolerances(cvode, 1e-11, 1e-8);
  CVodeSetMaxNumSteps(cvode, 1000000);
  CVodeSetStopTime(cvode, end);
  SUNMatrix matrix = SUNDenseMatrix(n, n, context);
  SUNLinearSolver solver = SUNLinSol_Dense(p, matrix, context);
  CVodeSetLinearSolver(cvode, solver, matrix);
  double t = 0;
  EXPECT_GE(CVode(cvode, end, p, &t, CV_NORMAL), 0);
  EXPECT_EQ(t, end);
  std::vector<double> out(NV_DATA_S(p), NV_DATA_S(p) + n);
  CVodeFree(&cvode);
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  N_VDestroy(p);
  SUNContext_Free(&context);
  return out;
}

// Local errors of 1e-8 (relative) and 1e-5 Pa add up over some hundred steps to less than 1e-5 of the largest
// pressure; CVODE's are a thousand times smaller.
TEST(Evolve, AgreesWithCvode) {
  for (const std::uint64_t seed : {1, 2}) {
    const Setting s(seed);
    const double end = 0.6;
    const auto reference = by_cvode(s, end);
    for (const SolverChoice choice : {SolverChoice::automatic, SolverChoice::pcg, SolverChoice::cholmod})
      for (const int order : {3, 4, 5}) {
        EvolveOptions options{1e-8, 1e-5, order};
        options.solver = choice;
        auto q = s.q;
        std::vector<double> p;
        const Evolved done = evolve(s.grid, s.sides, s.medium, 0, end, q, p, options, s.source);
        EXPECT_LT(largest_difference(p, reference), 1e-5 * largest(reference)) << order << ' ' << done.solver;
        EXPECT_GT(done.steps, 10);
        EXPECT_LE(done.last_step, 1.0 / 56);  // an eighth of the shortest period
        EXPECT_EQ(done.factorisations > 0, done.solver == "pcg, cholmod");
        // The factor is kept from step to step.
        EXPECT_LT(done.factorisations, done.solves);
      }
  }
}

// A kept factor is as good as its gamma is near: a handful of iterations where the diagonal needs some tens.
TEST(Evolve, KeptFactorsSaveIterations) {
  Grid grid{{6, 6, 12}, {0.15, 0.15, 0.3}, {true, true, false}};
  Sides sides;
  sides.high[2] = pressure_side(0);
  const Medium m = uniform(grid, 0.4, 1e-12);
  const double storage = m.compressibility * 0.4 * grid.cell_volume(), end = 0.09 / diffusivity(m);
  Evolved done[2];
  for (const bool factor : {false, true}) {
    EvolveOptions options{1e-5, 0.1};
    options.solver = factor ? SolverChoice::cholmod : SolverChoice::pcg;
    std::vector<double> q(grid.cells(), 1e4 * storage), p;
    done[factor] = evolve(grid, sides, m, 0, end, q, p, options);
  }
  EXPECT_LT(done[1].iterations, 5 * done[1].solves);
  EXPECT_LT(2 * done[1].iterations, done[0].iterations);
  EXPECT_LT(done[1].factorisations, done[1].steps);
}

// Two implementations of the same grid: many short steps of backward Euler (first order: 1e-3) and evolve.
TEST(Evolve, AgreesWithManySmallSteps) {
  const Setting s(3);
  const double end = 0.1;
  auto q = s.q;
  std::vector<double> p, rate(q.size());
  evolve(s.grid, s.sides, s.medium, 0, end, q, p, {}, s.source);
  PressureStep step(s.grid, s.sides);
  step.set(s.grid, s.medium);
  auto q2 = s.q;
  std::vector<double> p2(q.size(), 0.0);
  const int steps = 2000;
  for (int i = 1; i <= steps; ++i) {
    const double t = end * i / steps;
    s.source(t, rate);
    for (double& r : rate) r *= -end / steps;
    step.step(t, end / steps, rate, q2, p2);
  }
  EXPECT_LT(largest_difference(p, p2), 2e-3 * largest(p));
  EXPECT_LT(largest_difference(q, q2), 2e-3 * largest(q));
}

// Rounding, whatever the tolerances: what is added to q are fluxes.
TEST(Evolve, ClosedBoxKeepsItsWater) {
  Setting s(4);
  s.sides = {};
  for (const double tolerance : {1e-8, 1e-2})
    for (const double end : {1e-3, 1.0, 1e4}) {
      auto q = s.q;
      std::vector<double> p;
      evolve(s.grid, s.sides, s.medium, 0, end, q, p, {tolerance, 1.0});
      EXPECT_NEAR(sum(q), sum(s.q), 1e-12 * sum(s.q));
    }
}

TEST(Evolve, StableWhateverTheMedium) {
  Random random(5);
  for (const double beta : {1e-7, 1e-9, 1e-11})
    for (const double k : {1e-9, 1e-12, 1e-20, 0.0})
      for (const double phi : {0.2, 0.999}) {
        Grid grid{{3, 4, 5}, {0.06, 0.08, 0.1}, {true, true, false}};
        Medium m = uniform(grid, phi, k);
        m.compressibility = beta;
        const double storage = beta * phi * grid.cell_volume();
        auto start = random.vector(grid.cells(), -1e4, 1e4), q = start;
        for (double& x : q) x *= storage;
        std::vector<double> p;
        const double water = sum(q);
        evolve(grid, Sides{}, m, 0, 10, q, p, {1e-4, 1.0});
        EXPECT_NEAR(sum(q), water, 1e-12 * storage * 1e4 * static_cast<double>(q.size()));
        // Errors of a step of 1 Pa and 1e-4 of the pressure, over at most some tens of steps.
        const double number = k / (m.viscosity * beta) * 10 / (0.1 * 0.1);
        const std::vector<double> even(q.size(), sum(start) / 60);
        if (number > 1e3) {
          EXPECT_LT(largest_difference(p, even), 50) << beta << ' ' << k << ' ' << phi;
        } else if (number < 1e-9) {
          EXPECT_LT(largest_difference(p, start), 1e-4);
        }
      }
}

TEST(Evolve, GivesUpWithAMessageAndLeavesTheState) {
  const Setting s(6);
  auto q = s.q;
  std::vector<double> p{1, 2};
  const auto refused = [&](const EvolveOptions& options, const Source& source,
                           const std::vector<std::string>& parts) {
    expect_error([&] { evolve(s.grid, s.sides, s.medium, 0, 1, q, p, options, source); }, parts);
    EXPECT_EQ(q, s.q);
    EXPECT_EQ(p.size(), 2u);
  };
  EvolveOptions few;
  few.max_steps = 3;
  refused(few, s.source, {"gave up at t = ", "after 3 steps", "mxstep"});
  EvolveOptions weak;
  weak.max_iterations = 1, weak.fixed_step = 0.1, weak.solver = SolverChoice::pcg;
  refused(weak, s.source, {"gave up at t = ", "pcg, jacobi", "solver convergence"});
  // A residual that was lowered, but not to the tolerance, is no solution either.
  weak.max_iterations = 3, weak.fixed_step = 0.02;
  refused(weak, s.source, {"gave up at t = ", "pcg, jacobi", "solver convergence"});
  refused({}, [](double, std::vector<double>&) { throw error("the source ran dry"); },
          {"the source ran dry"});
  EvolveOptions wrong;
  wrong.order = 7;
  refused(wrong, {}, {"order 7", "2, 3, 4 or 5"});
  wrong = {}, wrong.absolute_tolerance = 0;
  refused(wrong, {}, {"absolute tolerance 0", "more than 0 Pa"});
  wrong = {}, wrong.relative_tolerance = -1;
  refused(wrong, {}, {"relative tolerance -1"});
  expect_error([&] { evolve(s.grid, s.sides, s.medium, 1, 1, q, p); }, {"from 1 s to 1 s"});
  q.pop_back();
  expect_error([&] { evolve(s.grid, s.sides, s.medium, 0, 1, q, p); }, {"59 volumes", "60 cells"});
}

}  // namespace
}  // namespace moraine::fluid
