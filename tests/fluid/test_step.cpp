// One implicit step: water kept, solvers that agree, stability, the same bits, and what is refused.
#include "fluid/problems.hpp"

namespace moraine::fluid {
namespace {

Medium random_medium(const Grid& grid, Random& random, double low_k = -14, double high_k = -10) {
  Medium m = uniform(grid, 0.4, 0);
  m.porosity = random.vector(grid.cells(), 0.2, 0.9);
  for (double& k : m.permeability) k = std::pow(10.0, random(low_k, high_k));
  return m;
}

// Skeleton volumes through random faces; nothing passes a side.
std::vector<double> random_motion(const Grid& grid, Random& random, double size) {
  std::vector<double> div_u(grid.cells(), 0.0);
  for (int a = 0; a < 3; ++a)
    for (int k = 0; k < grid.n[2]; ++k)
      for (int j = 0; j < grid.n[1]; ++j)
        for (int i = 0; i < grid.n[0]; ++i) {
          std::array<int, 3> up{i, j, k};
          if (++up[a] == grid.n[a]) {
            if (!grid.periodic[a]) continue;
            up[a] = 0;
          }
          const double u = random(-size, size);
          div_u[grid.cell(i, j, k)] += u, div_u[grid.cell(up[0], up[1], up[2])] -= u;
        }
  return div_u;
}

// Rounding, 1e-14 of what the cells can hold in a step and 1e-12 over 200 (the table has 1e-10); a loose
// solver must not matter.
TEST(Step, ClosedBoxKeepsItsWater) {
  Random random(1);
  for (const double tolerance : {1e-10, 1e-2})
    for (const double dt : {1e-5, 1e-2, 10.0}) {
      Grid grid{{5, 6, 10}, {0.2, 0.3, 0.5}, {true, true, false}};
      PressureStep step(grid, Sides{}, {SolverChoice::automatic, tolerance, 500});
      std::vector<double> q(grid.cells()), p(grid.cells(), 0.0);
      double scale = 0, start = 0;
      for (int i = 0; i < 200; ++i) {
        if (i % 20 == 0) {
          grid.length[2] = random(0.49, 0.51);
          step.set(grid, random_medium(grid, random));
          if (i == 0)
            for (std::size_t c = 0; c < q.size(); ++c) q[c] = random(0, 1e4) * step.storage()[c];
          scale = std::max(scale, largest(q));
          if (i == 0) start = sum(q);
        }
        const double before = sum(q);
        const Exchanged none = step.step(i * dt, dt, random_motion(grid, random, 1e-2 * scale), q, p);
        EXPECT_NEAR(sum(q), before, 1e-14 * scale * static_cast<double>(q.size()));
        for (int a = 0; a < 3; ++a) {
          EXPECT_EQ(none.low[a], 0);
          EXPECT_EQ(none.high[a], 0);
        }
      }
      EXPECT_NEAR(sum(q), start, 1e-12 * scale * static_cast<double>(q.size()));
    }
}

TEST(Step, WaterThroughTheSidesIsAccountedFor) {
  Random random(2);
  Grid grid{{3, 2, 5}, {0.2, 0.3, 0.5}, {false, true, false}};
  Sides sides;
  sides.low[0].kind = Side::Kind::flux, sides.low[0].value = 1e-4;
  sides.low[2] = pressure_side(2e3);
  sides.high[2] = pressure_side(1e3);
  sides.high[2].amplitude = 5e3, sides.high[2].frequency = 3, sides.high[2].phase = 1;
  PressureStep step(grid, sides);
  step.set(grid, random_medium(grid, random));
  std::vector<double> q(grid.cells(), 0.0), p(q);
  for (int i = 1; i < 50; ++i) {
    const double before = sum(q), dt = 0.01;
    const Exchanged in = step.step(i * dt, dt, random_motion(grid, random, 1e-9), q, p);
    double entered = 0, size = 0;
    for (int a = 0; a < 3; ++a)
      for (const double v : {in.low[a], in.high[a]}) entered += v, size += std::abs(v);
    EXPECT_NEAR(sum(q) - before, entered, 1e-13 * (size + std::abs(before)));  // rounding
    EXPECT_DOUBLE_EQ(in.low[0], 1e-4 * 0.3 * 0.5 * dt);
    for (std::size_t c = 0; c < q.size(); ++c)  // the solver's tolerance, and volumes that are pressure
      EXPECT_NEAR(q[c], step.storage()[c] * p[c], 1e-8 * (largest(q) + size));
  }
}

// Each solver to 1e-12 of the right-hand side; the condition of the matrix (up to 1e4 here) comes on top.
TEST(Step, SolversAgree) {
  Random random(3);
  Grid grid{{6, 5, 7}, {0.2, 0.3, 0.5}, {true, true, false}};
  Sides sides;
  sides.high[2] = pressure_side(1e3);
  for (const double dt : {1e-6, 1e-3, 1.0}) {
    std::vector<std::vector<double>> ends;
    for (const SolverChoice choice : {SolverChoice::automatic, SolverChoice::pcg, SolverChoice::cholmod}) {
      Random same(4);
      PressureStep step(grid, sides, {choice, 1e-12, 500});
      step.set(grid, random_medium(grid, same));
      std::vector<double> q(grid.cells(), 0.0), p(q);
      for (int i = 0; i < 20; ++i) step.step(i * dt, dt, random_motion(grid, same, 1e-12), q, p);
      ends.push_back(p);
      const auto report = step.report();
      EXPECT_EQ(report.solves, 20);
      if (choice != SolverChoice::automatic) {
        const bool factor = choice == SolverChoice::cholmod;
        EXPECT_EQ(report.solver, factor ? "cholmod" : "pcg, jacobi");
        EXPECT_EQ(report.factorisations, factor ? 1 : 0);
      }
    }
    EXPECT_LT(largest_difference(ends[0], ends[1]), 1e-7 * largest(ends[1]));
    EXPECT_LT(largest_difference(ends[2], ends[1]), 1e-7 * largest(ends[1]));
  }
}

// Backward Euler's matrix is an M-matrix, so no pressure leaves the range of those before it and the sides',
// and energy sum q2/2C cannot grow. What the solver leaves (1e-10) may; 1e-6 over 20 steps is its room where
// water moves much faster than the step.
TEST(Step, StableWhateverTheMedium) {
  Random random(5);
  for (const bool drained : {true, false})
    for (const double beta : {1e-7, 1e-9, 1e-11})
      for (const double k : {1e-9, 1e-12, 1e-16, 1e-20, 0.0})
        for (const double phi : {0.2, 0.999, 0.0})  // 0: random between them
          for (const double dt : {1e-7, 1e-4, 1e-1}) {
            Grid grid{{3, 4, 5}, {0.06, 0.08, 0.1}, {true, true, false}};
            Sides sides;
            if (drained) sides.high[2] = pressure_side(0);
            Medium m = uniform(grid, phi, k);
            m.compressibility = beta;
            if (phi == 0) m.porosity = random.vector(grid.cells(), 0.2, 0.999);
            PressureStep step(grid, sides);
            step.set(grid, m);
            std::vector<double> q = random.vector(grid.cells(), -1e4, 1e4), none(q.size(), 0.0), p(q);
            for (std::size_t c = 0; c < q.size(); ++c) q[c] *= step.storage()[c];
            const auto energy = [&] {
              double e = 0;
              for (std::size_t c = 0; c < q.size(); ++c) e += q[c] * q[c] / step.storage()[c];
              return e;
            };
            const double start = energy(), water = sum(q);
            double before = start;
            for (int i = 0; i < 20; ++i) {
              step.step(i * dt, dt, none, q, p);
              EXPECT_LE(largest(p), 1e4 * (1 + 1e-6));
              EXPECT_LE(energy(), before + 1e-6 * start) << beta << ' ' << k << ' ' << phi << ' ' << dt;
              before = energy();
            }
            if (!drained) {
              EXPECT_NEAR(sum(q), water, 1e-12 * step.storage()[0] * 1e4 * q.size());
            }
            // Diffusion number of a step: 1e5 or more leaves nothing to even out.
            const double number = k / (m.viscosity * beta) * dt / (0.02 * 0.02);
            if (number > 1e5 && !drained) {
              const double even = water / sum(step.storage());
              for (const double x : p) EXPECT_NEAR(x, even, 1e-3 * 1e4);
            }
          }
}

TEST(Step, GoodGuessesCostNothing) {
  Random random(6);
  Grid grid{{6, 5, 7}, {0.2, 0.3, 0.5}, {true, true, false}};
  Sides sides;
  sides.high[2] = pressure_side(500);
  PressureStep step(grid, sides);
  step.set(grid, uniform(grid, 0.4, 1e-12));
  std::vector<double> q(grid.cells()), none(q.size(), 0.0), p(q.size(), 500.0);
  for (std::size_t c = 0; c < q.size(); ++c) q[c] = 500 * step.storage()[c];
  step.step(0, 1e-5, none, q, p);
  EXPECT_EQ(step.report().iterations, 0);
  for (const double x : p) EXPECT_EQ(x, 500);

  // Nothing on the right-hand side: zero pressure, whatever the guess.
  PressureStep dry(grid, Sides{});
  dry.set(grid, uniform(grid, 0.4, 1e-12));
  std::fill(q.begin(), q.end(), 0.0);
  dry.step(0, 1e-5, none, q, p);
  for (const double x : p) EXPECT_EQ(x, 0);
}

// A restart makes a new PressureStep in the middle; what came before the last set() and step length is
// forgotten.
TEST(Step, SameBitsAfterARestart) {
  for (const SolverChoice choice : {SolverChoice::automatic, SolverChoice::pcg, SolverChoice::cholmod})
    for (const double dt : {1e-6, 1e-2}) {
      Random random(7);
      Grid grid{{4, 5, 6}, {0.2, 0.3, 0.5}, {true, true, false}};
      Sides sides;
      sides.high[2] = pressure_side(1e3);
      sides.high[2].amplitude = 300, sides.high[2].frequency = 20;
      PressureStep through(grid, sides, {choice}), again(grid, sides, {choice});
      std::vector<double> q(grid.cells(), 0.0), p(q), none(q);
      for (int i = 0; i < 3; ++i) {
        through.set(grid, random_medium(grid, random));
        through.step(i * dt, dt, random_motion(grid, random, 1e-10), q, p);
        through.step(i * dt, 2 * dt, none, q, p);
      }
      const Medium last = random_medium(grid, random);
      through.set(grid, last);
      through.step(1, 3 * dt, none, q, p);
      auto q2 = q, p2 = p;
      again.set(grid, last);
      for (int i = 0; i < 5; ++i) {
        const auto motion = random_motion(grid, random, 1e-10);
        through.step(1 + i * dt, dt, motion, q, p);
        again.step(1 + i * dt, dt, motion, q2, p2);
      }
      EXPECT_EQ(q, q2);
      EXPECT_EQ(p, p2);
    }
}

TEST(Step, NoConvergenceLeavesTheStateAsItWas) {
  Random random(8);
  Grid grid{{6, 5, 7}, {0.2, 0.3, 0.5}, {true, true, false}};
  PressureStep step(grid, Sides{}, {SolverChoice::pcg, 1e-12, 3});
  step.set(grid, random_medium(grid, random));
  std::vector<double> q(grid.cells()), none(q.size(), 0.0), p(q);
  for (std::size_t c = 0; c < q.size(); ++c) q[c] = random(0, 1e4) * step.storage()[c];
  const auto q_before = q, p_before = p;
  expect_error([&] { step.step(0, 1.0, none, q, p); },
               {"pcg, jacobi", "did not converge in 3 iterations", "residual"});
  EXPECT_EQ(q, q_before);
  EXPECT_EQ(p, p_before);
  q[3] = NAN;
  expect_error([&] { step.step(0, 1.0, none, q, p); }, {"right-hand side", "not finite"});
}

// As many iterations are allowed as half the step needs; it is checked that the whole one needs more.
TEST(Step, IsHalvedWhereTheSolverGivesUp) {
  Random random(9);
  Grid grid{{6, 5, 7}, {0.2, 0.3, 0.5}, {true, true, false}};
  Sides sides;
  sides.high[2] = pressure_side(500);
  const Medium medium = random_medium(grid, random);
  const double dt = 1e-5;
  std::vector<double> div_u = random_motion(grid, random, 1e-12), q(grid.cells()), p(q.size(), 0.0);
  PressureStep halves(grid, sides, {SolverChoice::pcg, 1e-12, 500});
  halves.set(grid, medium);
  for (std::size_t c = 0; c < q.size(); ++c) q[c] = random(0, 1e4) * halves.storage()[c];
  const auto q_0 = q, p_0 = p;

  std::vector<double> half = div_u;
  for (double& u : half) u *= 0.5;
  Exchanged in = halves.step(0.5 * dt, 0.5 * dt, half, q, p);
  std::int64_t most = halves.report().iterations;
  const Exchanged rest = halves.step(dt, 0.5 * dt, half, q, p);
  most = std::max(most, halves.report().iterations - most);
  PressureStep whole(grid, sides, {SolverChoice::pcg, 1e-12, 500});
  whole.set(grid, medium);
  auto q_whole = q_0, p_whole = p_0;
  whole.step(dt, dt, div_u, q_whole, p_whole);
  ASSERT_GT(whole.report().iterations, most);

  PressureStep step(grid, sides, {SolverChoice::pcg, 1e-12, static_cast<int>(most)});
  step.set(grid, medium);
  auto q_now = q_0, p_now = p_0;
  const Exchanged volume = step.step(dt, dt, div_u, q_now, p_now);
  EXPECT_EQ(q_now, q);
  EXPECT_EQ(p_now, p);
  EXPECT_NE(q_now, q_whole);
  EXPECT_EQ(volume.high[2], in.high[2] + rest.high[2]);
  EXPECT_EQ(step.dissipation(), halves.dissipation());
}

TEST(Step, RefusesAnImpossibleMedium) {
  Grid grid{{2, 3, 4}, {0.2, 0.3, 0.5}, {true, true, false}};
  PressureStep step(grid, Sides{});
  std::vector<double> v(grid.cells(), 0.0), p(v);
  expect_error([&] { step.step(0, 1, v, v, p); }, {"before porosity and permeability"});
  const auto refused = [&](auto&& spoil, const std::vector<std::string>& parts) {
    Medium m = uniform(grid, 0.4, 1e-12);
    spoil(m);
    expect_error([&] { step.set(grid, m); }, parts);
  };
  refused([](Medium& m) { m.porosity[9] = 0; }, {"porosity 0 ", "cell 9 (1, 1, 1)", "more than 0"});
  refused([](Medium& m) { m.porosity[23] = 1.25; }, {"porosity 1.25", "cell 23 (1, 2, 3)", "at most 1"});
  refused([](Medium& m) { m.porosity[0] = NAN; }, {"porosity nan", "cell 0"});
  refused([](Medium& m) { m.permeability[5] = -1e-12; }, {"permeability -1e-12", "cell 5", "0 or more"});
  refused([](Medium& m) { m.permeability[5] = INFINITY; }, {"permeability inf", "cell 5", "finite"});
  refused([](Medium& m) { m.viscosity = 0; }, {"viscosity 0", "positive"});
  refused([](Medium& m) { m.compressibility = -1; }, {"compressibility -1", "positive"});
  refused([](Medium& m) { m.porosity.pop_back(); }, {"23 porosities", "24 cells"});
  Grid other = grid;
  other.n[0] = 3;
  expect_error([&] { step.set(other, uniform(other, 0.4, 1e-12)); }, {"3 x 3 x 4", "2 x 3 x 4"});
  other = grid, other.length[2] = 0;
  expect_error([&] { step.set(other, uniform(other, 0.4, 1e-12)); }, {"along z", "positive length"});

  step.set(grid, uniform(grid, 0.4, 1e-12));
  expect_error([&] { step.step(0, 0, v, v, p); }, {"step of 0 s"});
  std::vector<double> few(3);
  expect_error([&] { step.step(0, 1, few, v, p); }, {"3 volume changes", "expected 24"});
}

TEST(Step, RefusesContradictorySides) {
  Grid grid{{2, 3, 4}, {0.2, 0.3, 0.5}, {true, true, false}};
  const auto refused = [&](const Side& side, const std::vector<std::string>& parts) {
    Sides sides;
    sides.high[2] = side;
    expect_error([&] { PressureStep(grid, sides); }, parts);
    sides = {};
    sides.low[1] = side;  // of a periodic axis: does not count
    EXPECT_NO_THROW(PressureStep(grid, sides));
  };
  Side side = pressure_side(0);
  side.amplitude = 10;
  refused(side, {"high side of z", "amplitude 10", "no frequency"});
  side.frequency = -2;
  refused(side, {"high side of z", "frequency -2 Hz", "0 or more"});
  side = {}, side.value = 5;
  refused(side, {"high side of z", "closed", "5"});
  side.kind = Side::Kind::flux, side.value = NAN;
  refused(side, {"high side of z", "nan", "finite"});
  expect_error([&] { PressureStep(grid, Sides{}, {SolverChoice::pcg, 0, 10}); }, {"tolerance 0"});
  expect_error([&] { PressureStep(grid, Sides{}, {SolverChoice::pcg, 1e-9, 0}); }, {"0 iterations"});
  grid.n[1] = 0;
  expect_error([&] { PressureStep(grid, Sides{}); }, {"0 cells along y"});
}

}  // namespace
}  // namespace moraine::fluid
