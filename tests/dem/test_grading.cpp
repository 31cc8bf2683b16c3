// Radii against the gradings that they are drawn from.
#include "dem/grading.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "error.hpp"

namespace moraine::dem {
namespace {

// Share of the mass that is finer than a sieve.
double finer(const std::vector<double>& r, double size) {
  double below = 0, all = 0;
  for (const double radius : r) {
    all += radius * radius * radius;
    if (2 * radius < size) below += radius * radius * radius;
  }
  return below / all;
}

const std::vector<Sieve> till = {{0.5e-3, 0}, {1e-3, 0.2}, {2e-3, 0.5}, {4e-3, 0.55}, {10e-3, 1}};

TEST(Grading, PassesItsSieves) {
  Random random(3);
  const std::vector<double> r = draw_radii(ranges_of(till), 200000, random);
  ASSERT_EQ(r.size(), 200000u);
  EXPECT_TRUE(std::is_sorted(r.rbegin(), r.rend()));
  for (const Sieve& s : till) EXPECT_NEAR(finer(r, s.size), s.passing, 0.004) << s.size;
  EXPECT_NEAR(finer(r, std::sqrt(2e-3 * 1e-3)), 0.35, 0.004);  // evenly over log size between two sieves
  EXPECT_GE(2 * r.back(), 0.5e-3);
  EXPECT_LE(2 * r.front(), 10e-3);
}

// Even of few grains: one comes from each n-th part of the distribution.
TEST(Grading, FewGrainsPassThemToo) {
  Random random(4);
  const std::vector<double> r = draw_radii(ranges_of(till), 5000, random);
  for (const Sieve& s : till) EXPECT_NEAR(finer(r, s.size), s.passing, 0.05) << s.size;
}

TEST(Grading, FractalNumbers) {
  for (const double D : {0.5, 2.6, 3.0}) {
    Random random(1);
    const double low = 1e-3, high = 20e-3;
    const std::vector<double> r = draw_radii({{low, high, D, 1}}, 100000, random);
    for (const double at : {2e-3, 5e-3, 15e-3}) {
      const auto larger = std::count_if(r.begin(), r.end(), [&](double x) { return x > at; });
      const double expected =
          (std::pow(at, -D) - std::pow(high, -D)) / (std::pow(low, -D) - std::pow(high, -D));
      EXPECT_NEAR(larger / 1e5, expected, 2e-5) << D << ' ' << at;
    }
  }
  // D = 3: the same mass in each class of sizes.
  Random random(2);
  const std::vector<double> r = draw_radii({{1e-3, 8e-3, 3, 1}}, 300000, random);
  for (const int k : {1, 2}) EXPECT_NEAR(finer(r, 2 * 1e-3 * (1 << k)), k / 3.0, 0.01);
}

// One grain comes from each n-th part, so that a sieve is missed by a grain or two of about its size.
TEST(Grading, WideTablesAreDrawnToAGrain) {
  const std::vector<std::vector<Sieve>> tables = {
      {{1e-3, 0}, {2e-3, 0.2}, {5e-3, 0.5}, {10e-3, 0.75}, {20e-3, 1}},      // 1:20
      {{1e-3, 0}, {1.5e-3, 0.4}, {10e-3, 0.4}, {20e-3, 1}},                  // bimodal: none between
      {{0.1e-3, 0}, {0.2e-3, 0.1}, {0.5e-3, 0.3}, {1e-3, 0.6}, {2e-3, 1}}};  // finer
  for (const auto& table : tables)
    for (const std::uint64_t seed : {1, 2, 3}) {
      Random random(seed);
      const std::vector<double> r = draw_radii(ranges_of(table), 50000, random);
      double all = 0;
      for (const double radius : r) all += std::pow(2 * radius, 3);
      for (const Sieve& s : table)
        EXPECT_NEAR(finer(r, s.size), s.passing, 3 * std::pow(s.size, 3) / all + 2e-3) << s.size;
      for (std::size_t k = 1; k < table.size(); ++k)
        if (table[k].passing == table[k - 1].passing) {
          const auto between = std::count_if(r.begin(), r.end(), [&](double radius) {
            return 2 * radius > table[k - 1].size * (1 + 1e-12) && 2 * radius < table[k].size * (1 - 1e-12);
          });
          EXPECT_EQ(between, 0);
        }
    }
}

// Slope of log(number in a class of sizes) over log(size): -D. Of 2e5 grains the rarest class has some
// hundred, of which one or so is a matter of chance.
TEST(Grading, FractalDimensionByRegression) {
  for (const double D : {1.5, 2.6, 3.0}) {
    Random random(5);
    const double low = 1e-3, high = D < 2 ? 20e-3 : 10e-3;
    const std::vector<double> r = draw_radii({{low, high, D, 1}}, 200000, random);
    constexpr int classes = 10;
    std::vector<double> count(classes, 0);
    for (const double radius : r)
      ++count[std::min(classes - 1, int(classes * std::log(radius / low) / std::log(high / low)))];
    double sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (int k = 0; k < classes; ++k) {
      const double x = (k + 0.5) / classes * std::log(high / low), y = std::log(count[k]);
      sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    EXPECT_NEAR((classes * sxy - sx * sy) / (classes * sxx - sx * sx), -D, 0.01);
  }
}

TEST(Grading, OneSize) {
  Random random(1);
  EXPECT_EQ(draw_radii({{0.01, 0.01, 2.6, 1}}, 3, random), (std::vector<double>{0.01, 0.01, 0.01}));
}

TEST(Grading, Summary) {
  const GradingSummary s = summary_of({0.002, 0.001, 0.001, 0.004});  // volumes 8, 1, 1, 64
  EXPECT_EQ(s.smallest, 0.002);
  EXPECT_EQ(s.largest, 0.008);
  EXPECT_EQ(s.d10, 0.004);  // 7.4 of 74
  EXPECT_EQ(s.d50, 0.008);
  EXPECT_EQ(s.d90, 0.008);
  EXPECT_DOUBLE_EQ(s.mean, 0.004);
  EXPECT_DOUBLE_EQ(s.sauter, 2 * 0.001 * 74 / 22);
}

void expect_refused(std::vector<Sieve> sieves, const char* words) {
  try {
    ranges_of(sieves);
    ADD_FAILURE() << words;
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find(words), std::string::npos) << e.what();
  }
}

TEST(Grading, RefusesWhatIsNone) {
  expect_refused({{1e-3, 0}}, "1 sieves; expected two or more");
  expect_refused({{1e-3, 0}, {2e-3, 0.9}}, "the coarsest sieve, 0.002 m, has 90 % finer; expected 100");
  expect_refused({{1e-3, 0.1}, {2e-3, 1}}, "the finest sieve, 0.001 m, has 10 % finer; expected 0");
  expect_refused({{-1e-3, 0}, {2e-3, 1}}, "sieve 1: size -0.001 m; expected more than 0");
  expect_refused({{1e-3, 0}, {2e-3, 0.6}, {3e-3, 0.5}, {4e-3, 1}}, "sieve 3");
  expect_refused({{2e-3, 0}, {1e-3, 1}}, "sieve 2");
  expect_refused({{1e-3, 0}, {2e-3, 1.2}}, "120 % finer; expected 0 to 100");
}

// Two populations: mass of each, means and spreads, and the same for few grains.
TEST(Grading, MixturesHaveTheirFractions) {
  const LogNormal coarse{10e-3, 1e-3, 0, 0}, fine{2e-3, 0.4e-3, 0, 0};
  for (const double fraction : {0.1, 0.3, 0.7}) {
    Random random(5);
    const std::vector<double> r = draw_mixture(coarse, fine, fraction, 50000, random);
    ASSERT_EQ(r.size(), 50000u);
    EXPECT_TRUE(std::is_sorted(r.rbegin(), r.rend()));
    EXPECT_NEAR(finer(r, 10e-3), fraction, 0.003);
    double sum = 0, squares = 0, n = 0;
    for (const double radius : r)
      if (radius < 5e-3) sum += radius, squares += radius * radius, ++n;
    EXPECT_NEAR(sum / n, 2e-3, 1e-6);
    EXPECT_NEAR(std::sqrt(squares / n - sum / n * sum / n), 0.4e-3, 2e-6);
    EXPECT_NEAR(finer(draw_mixture(coarse, fine, fraction, 2000, random), 10e-3), fraction, 0.03);
  }
}

TEST(Grading, MixturesOfEqualGrains) {
  Random random(6);
  const std::vector<double> r = draw_mixture({8e-3, 0, 0, 0}, {1e-3, 0, 0, 0}, 0.25, 15370, random);
  EXPECT_EQ(std::count(r.begin(), r.end(), 8e-3), 90);  // of 0.75/512 to 0.25
  EXPECT_EQ(std::count(r.begin(), r.end(), 1e-3), 15280);
}

// Limits cut both, and the fraction is of what is left.
TEST(Grading, MixturesKeepTheirLimits) {
  const double low = 1.5e-3, high = 11e-3;
  Random random(7);
  const std::vector<double> r =
      draw_mixture({10e-3, 3e-3, low, high}, {2e-3, 1e-3, low, high}, 0.4, 50000, random);
  EXPECT_LE(r.front(), high);
  EXPECT_GE(r.back(), low);
  EXPECT_GT(r.front(), 0.99 * high);
  EXPECT_LT(r.back(), 1.01 * low);
  // What each makes alone has the mass that the fraction says: so many are of the coarse.
  Random again(7);
  double coarse = 0, fine = 0;
  const auto alone = [&](double mean, double std, double& mass) {  // drawn again where outside
    const double variance = std::log1p(std * std / mean / mean);
    std::int64_t n = 0;
    for (int k = 0; k < 400000; ++k) {
      const double x = std::exp(std::log(mean) - variance / 2 + std::sqrt(variance) * again.normal());
      if (x >= low && x <= high) mass += x * x * x, ++n;
    }
    mass /= static_cast<double>(n);
  };
  alone(10e-3, 3e-3, coarse), alone(2e-3, 1e-3, fine);
  double all = 0;
  for (const double radius : r) all += radius * radius * radius;
  // n_f V_f + n_c V_c = all, n_f + n_c = n, and n_f V_f = 0.4 all.
  const double n = 50000, n_f = (n * coarse - all) / (coarse - fine);
  EXPECT_NEAR(n_f * fine / all, 0.4, 0.01);
}

TEST(Grading, WhatIsNoMixture) {
  Random random(1);
  const auto fault = [&](const LogNormal& coarse, const LogNormal& fine, double fraction, std::int64_t n) {
    try {
      draw_mixture(coarse, fine, fraction, n, random);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(fault({10e-3, 0, 0, 0}, {1e-3, 0, 0, 0}, 0.5, 100),
            "of 100 grains 0 would be of the coarse population and 100 of the fine one; expected at least "
            "one of each: "
            "1001 grains or more (grains.count), or another grains.fine_fraction than 0.5");
  EXPECT_NE(fault({10e-3, 1e-4, 0, 8e-3}, {1e-3, 0, 0, 8e-3}, 0.5, 100)
                .find("no radius around 0.01 m lies between"),
            std::string::npos);
  EXPECT_NE(fault({10e-3, 0, 2e-3, 0}, {1e-3, 0, 2e-3, 0}, 0.5, 100).find("no radius around 0.001 m"),
            std::string::npos);
}

}  // namespace
}  // namespace moraine::dem
