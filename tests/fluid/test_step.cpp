// One implicit step on small grids.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdio>
#include <random>
#include "fluid/step.hpp"
namespace moraine::fluid {
namespace {
TEST(Step, Smoke) {
  Grid g{{8, 8, 8}, {0.2, 0.2, 0.2}, {true, true, false}};
  Sides s;
  s.high[2].kind = Side::Kind::pressure;
  PressureStep st(g, s);
  Medium m;
  m.porosity.assign(512, 0.4);
  m.permeability.assign(512, 1e-12);
  st.set(g, m);
  double D = 1e-12 / (m.viscosity * 0.4 * m.compressibility), dt = 1e-3 * 0.025 * 0.025 / D;
  std::vector<double> d(512), q(512), p(512);
  std::mt19937_64 r(1);
  for (int c = 0; c < 512; ++c) p[c] = 1e4, q[c] = p[c] * st.storage()[c];
  std::vector<std::vector<double>> divs(16, d);
  for (auto& v : divs)
    for (auto& x : v) x = ((r() >> 11) * 0x1p-53 - 0.5) * 1e-3 * q[0];
  auto t0 = std::chrono::steady_clock::now();
  const int N = 5000;
  for (int i = 0; i < N; ++i) st.step(0, dt, divs[i % 16], q, p);
  double us = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count() / N * 1e6;
  std::printf("%g us/step, %g iterations\n", us, double(st.report().iterations) / N);
  for (int c = 0; c < 512; ++c) EXPECT_NEAR(p[c], q[c] / st.storage()[c], 1e-5);
  EXPECT_EQ(st.report().solver, "pcg, jacobi");
}
}  // namespace
}  // namespace moraine::fluid
