#include "coupling/ball.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace moraine::coupling {
namespace {

constexpr double pi = std::numbers::pi;

TEST(Ball, KnownParts) {
  EXPECT_NEAR(ball_beyond(0), 2 * pi / 3, 1e-15);
  EXPECT_NEAR(ball_beyond(0.5), 5 * pi / 24, 1e-15);
  EXPECT_NEAR(ball_beyond(0, 0), pi / 3, 1e-15);
  EXPECT_NEAR(ball_beyond(0, 0, 0), pi / 6, 1e-15);
  EXPECT_NEAR(ball_beyond(-1, -1, 0.5), ball_beyond(0.5), 1e-15);
  EXPECT_NEAR(ball_beyond(-2, 0, 0), pi / 3, 1e-15);
  EXPECT_EQ(ball_beyond(0.6, 0.6, 0.6), 0);
  EXPECT_NEAR(ball_in_box({-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}), 0.008, 1e-14);  // of eight sums up to 4
  EXPECT_NEAR(ball_in_box({-1, -1, -1}, {1, 1, 1}), 4 * pi / 3, 1e-14);
}

// Columns summed over X and Y; that rule is good to 2e-5 with so many.
TEST(Ball, AnyThreePlanes) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> anywhere(-1, 1);
  constexpr int m = 500;
  for (int n = 0; n < 100; ++n) {
    const double a = anywhere(random), b = anywhere(random), c = anywhere(random);
    double sum = 0;
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < m; ++j) {
        const double x = a + (1 - a) * (i + 0.5) / m, y = b + (1 - b) * (j + 0.5) / m, z2 = 1 - x * x - y * y;
        if (z2 > 0) sum += std::max(std::sqrt(z2) - std::max(c, -std::sqrt(z2)), 0.0);
      }
    EXPECT_NEAR(ball_beyond(a, b, c), sum * (1 - a) * (1 - b) / (m * m), 5e-5) << a << " " << b << " " << c;
  }
}

TEST(Ball, PartsAddUpAndFollowTheBall) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> anywhere(-0.2, 1.2);
  fluid::Grid grid;
  grid.n = {4, 5, 6}, grid.length = {1, 1.1, 0.9};
  const Holds holds{{false, false, true}, {false, false, true}};
  BallParts parts;
  const auto cells = [&](const dem::Vec3d& x, double r) {
    std::vector<double> v(grid.cells(), 0);
    parts.cut(grid, holds, x, r);
    parts.each([&](int i, int j, int k, double part) { v[grid.cell((i + 8) % 4, (j + 10) % 5, k)] += part; });
    return v;
  };
  for (int n = 0; n < 300; ++n) {
    const dem::Vec3d x{anywhere(random), anywhere(random), anywhere(random)};
    const double r = 0.01 * std::pow(60.0, (anywhere(random) + 0.2) / 1.4), ball = 4 * pi / 3 * r * r * r;
    const std::vector<double> v = cells(x, r), moved = cells(x + dem::Vec3d{1e-7, -1e-7, 1e-7}, r);
    double sum = 0;
    for (std::size_t c = 0; c < v.size(); ++c) {
      sum += v[c];
      // No cell's part changes faster than the ball's section passes it, on three pairs of sides, where a
      // wide ball meets itself across the periodic sides.
      EXPECT_LT(std::abs(moved[c] - v[c]), 4 * 6 * pi * r * r * 1e-7);
    }
    EXPECT_NEAR(sum / ball, 1, 1e-12) << r;
  }
}

}  // namespace
}  // namespace moraine::coupling
