// The operator by itself: its matrix-free sweep against sums over faces, on grids with every kind of side.
#include "fluid/darcy.hpp"

#include "error.hpp"
#include "fluid/linear_solver.hpp"
#include "fluid/problems.hpp"

namespace moraine::fluid {
namespace {

struct Setting {
  Grid grid;
  Sides sides;
};

std::vector<Setting> settings() {
  Side pressure = pressure_side(3), flux, wave = pressure_side(1);
  flux.kind = Side::Kind::flux, flux.value = 2e-6;
  wave.amplitude = 2, wave.frequency = 0.3, wave.phase = 0.4;
  std::vector<Setting> all;
  for (const std::array<int, 3> n :
       {std::array{1, 1, 1}, {2, 1, 3}, {1, 2, 2}, {2, 2, 2}, {3, 4, 5}, {7, 1, 4}})
    for (int axes = 0; axes < 8; ++axes)
      for (int kind = 0; kind < 3; ++kind) {
        Setting s{{n, {0.3, 0.5, 0.4}, {(axes & 1) != 0, (axes & 2) != 0, (axes & 4) != 0}}, {}};
        s.sides.low = {kind == 0 ? Side{} : pressure, kind == 1 ? flux : Side{}, kind == 2 ? wave : flux};
        s.sides.high = {kind == 2 ? flux : Side{}, kind == 1 ? pressure : wave, kind == 0 ? Side{} : wave};
        all.push_back(s);
      }
  return all;
}

Medium random_medium(const Grid& grid, Random& random) {
  Medium m = uniform(grid, 0.4, 1e-9);
  m.porosity = random.vector(grid.cells(), 0.2, 0.9);
  for (double& k : m.permeability) k = std::pow(10.0, random(-12, -9));
  return m;
}

TEST(Darcy, OutflowIsTheDivergenceOfTheFluxes) {
  Random random(1);
  for (const auto& [grid, sides] : settings()) {
    Darcy darcy(grid, sides);
    darcy.set(grid, random_medium(grid, random));
    const double t = 0.7;
    const auto p = random.vector(grid.cells(), -10, 10);
    std::vector<double> out(grid.cells()), expected(grid.cells(), 0.0);
    Exchanged in;
    double drops = 0, scale = 0;
    for (int a = 0; a < 3; ++a) {
      std::vector<double> f(grid.face_count(a));
      darcy.flux(a, t, p.data(), f.data());
      scale = std::max(scale, largest(f));
      for (int k = 0; k < grid.n[2]; ++k)
        for (int j = 0; j < grid.n[1]; ++j)
          for (int i = 0; i < grid.n[0]; ++i) {
            std::array<int, 3> up{i, j, k};
            ++up[a];
            if (grid.periodic[a]) up[a] %= grid.n[a];
            const std::size_t low = grid.face(a, i, j, k), high = grid.face(a, up[0], up[1], up[2]);
            const std::size_t c = grid.cell(i, j, k);
            expected[c] += f[high] - f[low];
            drops += p[c] * (f[high] - f[low]);
            if (grid.periodic[a]) continue;
            const bool first = std::array{i, j, k}[a] == 0, last = std::array{i, j, k}[a] == grid.n[a] - 1;
            if (first) in.low[a] += f[low];
            if (last) in.high[a] -= f[high];
            // Work of a side of given pressure, so that drops becomes the dissipation.
            if (first && sides.low[a].kind == Side::Kind::pressure) drops += sides.low[a].at(t) * f[low];
            if (last && sides.high[a].kind == Side::Kind::pressure) drops -= sides.high[a].at(t) * f[high];
            if (first && sides.low[a].kind == Side::Kind::flux) drops += p[c] * f[low];
            if (last && sides.high[a].kind == Side::Kind::flux) drops -= p[c] * f[high];
          }
    }
    darcy.outflow(t, p.data(), out.data());
    // Rounding: a few sums of at most seven terms of the largest flux.
    EXPECT_LE(largest_difference(out, expected), 1e-14 * scale);
    const Exchanged through = darcy.inflow(t, p.data());
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(through.low[a], in.low[a], 1e-13 * scale);
      EXPECT_NEAR(through.high[a], in.high[a], 1e-13 * scale);
    }
    EXPECT_NEAR(darcy.dissipation(t, p.data(), out.data()), drops, 1e-11 * scale * grid.cells());
  }
}

TEST(Darcy, OperatorIsSymmetricAndMatchesOutflow) {
  Random random(2);
  for (const auto& [grid, sides] : settings()) {
    Darcy darcy(grid, sides);
    darcy.set(grid, random_medium(grid, random));
    const std::size_t n = grid.cells();
    const double s = 0.01, t = 1.3;
    const auto p = random.vector(n, -10, 10), r = random.vector(n, -10, 10);
    std::vector<double> Ap(n), Ar(n), b(n, 0.0), out(n), diagonal(n);
    darcy.apply(s, p.data(), Ap.data());
    darcy.apply(s, r.data(), Ar.data());
    darcy.add_sides(s, t, b.data());
    darcy.outflow(t, p.data(), out.data());
    darcy.diagonal(s, diagonal.data());
    double pr = 0, rp = 0, size = 0;
    for (std::size_t c = 0; c < n; ++c) {
      pr += p[c] * Ar[c], rp += r[c] * Ap[c], size += std::abs(p[c] * Ar[c]);
      // Rounding of sums of up to eight terms, as large as the diagonal's and the sides'.
      EXPECT_NEAR(Ap[c] - b[c], darcy.storage()[c] * p[c] + s * out[c],
                  1e-14 * (20 * diagonal[c] + std::abs(b[c])));
      std::vector<double> unit(n, 0.0), column(n);
      unit[c] = 1;
      darcy.apply(s, unit.data(), column.data());
      EXPECT_NEAR(column[c], diagonal[c], 1e-14 * diagonal[c]);
    }
    EXPECT_NEAR(pr, rp, 1e-13 * size);
  }
}

// Every solver on every kind of side; the residual is what is asked for, seen through another route.
TEST(Darcy, SolversSolve) {
  Random random(3);
  for (const auto& [grid, sides] : settings())
    for (const SolverChoice choice : {SolverChoice::automatic, SolverChoice::pcg, SolverChoice::cholmod}) {
      Darcy darcy(grid, sides);
      LinearSolver solver(darcy, {choice, 1e-12, 500});
      const std::size_t n = grid.cells();
      for (const double s : {1e-6, 1.0, 1.0, 1e3}) {
        if (s != 1e3) darcy.set(grid, random_medium(grid, random));
        const auto wanted = random.vector(n, -10, 10);
        std::vector<double> b(n), x = random.vector(n, -10, 10), again(n);
        darcy.apply(s, wanted.data(), b.data());
        solver.solve(s, b.data(), x.data());
        darcy.apply(s, x.data(), again.data());
        EXPECT_LE(largest_difference(again, b), 3e-12 * std::sqrt(n) * largest(b)) << name(solver.method());
      }
    }
}

TEST(Darcy, FluxIsOfTheHarmonicMeanOverTheDistance) {
  Grid grid{{1, 1, 2}, {0.5, 0.25, 0.4}, {true, true, false}};
  Sides sides;
  sides.low[2] = pressure_side(0);
  Medium m = uniform(grid, 0.4, 1e-10);
  m.permeability = {1e-10, 3e-10};
  Darcy darcy(grid, sides);
  darcy.set(grid, m);
  const double per_k = 0.5 * 0.25 / (m.viscosity * 0.2);
  // By hand; rounding.
  EXPECT_DOUBLE_EQ(darcy.transmissibility(2)[0], 2e-10 * per_k);
  EXPECT_DOUBLE_EQ(darcy.transmissibility(2)[1], 1.5e-10 * per_k);
  EXPECT_EQ(darcy.transmissibility(2)[2], 0);
  EXPECT_DOUBLE_EQ(darcy.storage()[0], m.compressibility * 0.4 * 0.5 * 0.25 * 0.2);
}

// A bed of two layers and a gap without resistance, as cells see it: the flux that their resistances in
// series let through, and no other along the wall.
TEST(Darcy, GapBesideAWallIsInSeries) {
  const double k = 1e-10, mu = 1e-3, h = 0.1, width = 0.03, factor = 0.6, drop = 5;
  for (const int n : {1, 3})
    for (int a = 0; a < 3; ++a) {
      Grid grid{{2, 2, 2}, {0.2, 0.2, 0.2}, {true, true, true}};
      grid.n[a] = n, grid.length[a] = n * h, grid.periodic[a] = false;
      Sides sides;
      sides.high[a].kind = sides.low[a].kind = Side::Kind::pressure;
      sides.low[a].value = drop;
      Darcy darcy(grid, sides);
      Medium m = uniform(grid, 0.4, k);
      m.viscosity = mu;
      m.gap[a][1] = {factor, width};
      darcy.set(grid, m);
      // Steady: cells below the last as they are, the last with the bed's k and a shorter way.
      const double resistance = mu * ((n - 1) * h / k + (h - width) / (factor * k)), q = drop / resistance;
      std::vector<double> p(grid.cells());
      for (std::size_t c = 0; c < p.size(); ++c) {
        std::array<std::size_t, 3> at{c % grid.n[0], c / grid.n[0] % grid.n[1], c / grid.n[0] / grid.n[1]};
        const bool last = at[a] + 1 == static_cast<std::size_t>(n);
        p[c] = last ? q * mu * (0.5 * h - width) / (factor * k) : drop - q * mu * (at[a] + 0.5) * h / k;
      }
      std::vector<double> flux(grid.face_count(a));
      darcy.flux(a, 0, p.data(), flux.data());
      for (const double f : flux) EXPECT_NEAR(f / (q * grid.face_area(a)), 1, 1e-12) << n << " " << a;
      const int along = (a + 1) % 3;
      EXPECT_DOUBLE_EQ(darcy.transmissibility(along)[0], grid.face_area(along) * k / (mu * grid.h(along)));
    }
}

TEST(Darcy, RefusesAGapThatIsWiderThanHalfACell) {
  Grid grid{{2, 2, 2}, {1, 1, 1}, {true, true, false}};
  Darcy darcy(grid, {});
  Medium m = uniform(grid, 0.4, 1e-10);
  m.gap[2][0].width = 0.25;
  EXPECT_THROW(darcy.set(grid, m), Error);
}

}  // namespace
}  // namespace moraine::fluid
