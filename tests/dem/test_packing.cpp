#include "dem/packing.hpp"

#include "error.hpp"
#include "physics/same_bits.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

double largest(const std::vector<double>& r) { return *std::max_element(r.begin(), r.end()); }

TEST(Packing, Radii) {
  Packing p;  // mean 0.02, deviation 9.38e-5, 10000 grains
  const std::vector<double> r = make_loose_grains(p).state.r;
  double mean = 0, log_mean = 0, variance = 0, skew = 0;
  const double n = static_cast<double>(r.size());
  for (const double x : r) mean += x / n, log_mean += std::log(x) / n;
  for (const double x : r) {
    variance += (x - mean) * (x - mean) / n;
    skew += std::pow(std::log(x) - log_mean, 3) / n;
  }
  const double deviation = std::sqrt(variance), relative = p.radius_std / p.radius_mean;
  // Four standard errors.
  EXPECT_NEAR(mean, p.radius_mean, 4 * p.radius_std / std::sqrt(n));
  EXPECT_NEAR(deviation, p.radius_std, 4 * p.radius_std / std::sqrt(2 * n));
  EXPECT_NEAR(skew / std::pow(relative, 3), 0, 4 * std::sqrt(6 / n));  // log r is normal

  p.distribution = Packing::Distribution::uniform;
  p.radius_min = 0.01, p.radius_max = 0.03;
  double sum = 0, sum2 = 0;
  for (const double x : make_loose_grains(p).state.r) {
    EXPECT_TRUE(x >= 0.01 && x <= 0.03) << x;
    sum += x / n, sum2 += x * x / n;
  }
  const double spread = 0.02 / std::sqrt(12);
  EXPECT_NEAR(sum, 0.02, 4 * spread / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(sum2 - sum * sum), spread, 4 * spread / std::sqrt(n));
}

TEST(Packing, BoxOfTheDefaults) {
  Packing p;
  const LooseGrains l = make_loose_grains(p);
  EXPECT_DOUBLE_EQ(l.cell, 2.1 * 2 * largest(l.state.r));
  EXPECT_DOUBLE_EQ(l.box_x, 10 * l.cell);
  EXPECT_NEAR(l.box_x, 0.86, 0.005);
  double top = 0;
  for (const Vec3d& x : l.state.x) top = std::max(top, x.z);
  EXPECT_LT(top, 100 * l.cell);
  EXPECT_GT(top, 99 * l.cell);
}

TEST(Packing, SameSeedSameGrains) {
  Packing p;
  p.count = 500;
  const LooseGrains a = make_loose_grains(p), b = make_loose_grains(p);
  expect_same_bits(a.state, b.state);
  p.seed = 2;
  const LooseGrains c = make_loose_grains(p);
  EXPECT_NE(a.state.r, c.state.r);
  EXPECT_NE(a.state.x, c.state.x);
}

// Also across the periodic sides, and however tight the cells are.
TEST(Packing, NoOverlaps) {
  for (const double cell : {1.05, 1.3, 2.1}) {
    Packing p;
    p.count = 300, p.columns_x = 4, p.columns_y = 6, p.cell = cell;
    p.distribution = Packing::Distribution::uniform, p.radius_min = 0.005, p.radius_max = 0.02;
    const LooseGrains l = make_loose_grains(p);
    const State& s = l.state;
    for (Index i = 0; i < s.size(); ++i) {
      EXPECT_GE(s.x[i].z, s.r[i]);
      for (Index j = 0; j < i; ++j) {
        Vec3d d = s.x[i] - s.x[j];
        d.x -= l.box_x * std::rint(d.x / l.box_x), d.y -= l.box_y * std::rint(d.y / l.box_y);
        ASSERT_GT(length(d), s.r[i] + s.r[j]);
      }
    }
  }
}

TEST(Packing, RefusesCellsThatAreTooSmall) {
  Packing p;
  p.count = 100, p.cell = 1.0;
  EXPECT_THROW(make_loose_grains(p), Error);
  p.cell = 2.1, p.box_x = 0.3;  // ten columns of 0.04 m grains
  try {
    make_loose_grains(p);
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("overlap at the start"), std::string::npos) << e.what();
  }
}

// At random places none touch, also across periodic sides, and all are inside.
TEST(Packing, RandomPlacesAreFree) {
  for (const bool periodic : {true, false}) {
    Packing p;
    p.count = 3000, p.placement = Packing::Placement::random;
    p.distribution = Packing::Distribution::ranges, p.ranges = {{0.001, 0.02, 2.6, 1}};  // 1:20
    p.box_x = 0.12, p.box_y = 0.1, p.periodic_x = p.periodic_y = periodic;
    const LooseGrains l = make_loose_grains(p);
    ASSERT_EQ(l.state.size(), 3000);
    double volume = 0, height = 0;
    for (Index i = 0; i < l.state.size(); ++i) {
      const Vec3d& x = l.state.x[i];
      const double r = l.state.r[i];
      volume += sphere_volume(r), height = std::max(height, x.z + r);
      EXPECT_GT(x.z, r);
      if (!periodic) {
        EXPECT_GT(x.x, r);
        EXPECT_LT(x.x, 0.12 - r);
        EXPECT_GT(x.y, r);
        EXPECT_LT(x.y, 0.1 - r);
      }
      for (Index j = 0; j < i; ++j) {
        Vec3d d = x - l.state.x[j];
        if (periodic) d.x -= 0.12 * std::round(d.x / 0.12), d.y -= 0.1 * std::round(d.y / 0.1);
        ASSERT_GT(dot(d, d), std::pow(r + l.state.r[j], 2)) << i << ' ' << j;
      }
    }
    EXPECT_NEAR(volume / (0.12 * 0.1 * height), 0.25, 0.02);
    EXPECT_EQ(make_loose_grains(p).state.x, l.state.x);
    p.seed = 2;
    EXPECT_NE(make_loose_grains(p).state.x, l.state.x);
  }
}

// With z periodic the sides that are not given follow from the space that grains are to fill.
TEST(Packing, RandomPlacesInAPeriodicBox) {
  Packing p;
  p.count = 1500, p.placement = Packing::Placement::random, p.periodic_z = true;
  p.distribution = Packing::Distribution::ranges, p.ranges = {{0.002, 0.02, 2.6, 1}};
  for (const double given : {0.0, 0.11}) {
    p.box_y = given;
    const LooseGrains l = make_loose_grains(p);
    const Vec3d side{l.box_x, l.box_y, l.box_z};
    EXPECT_EQ(side.x, side.z);
    EXPECT_EQ(side.y, given > 0 ? given : side.x);
    double volume = 0;
    bool across = false;
    for (Index i = 0; i < l.state.size(); ++i) {
      const Vec3d& x = l.state.x[i];
      const double r = l.state.r[i];
      volume += sphere_volume(r);
      across = across || x.z < r;
      for (Index j = 0; j < i; ++j) {
        Vec3d d = x - l.state.x[j];
        for (int a = 0; a < 3; ++a) d[a] -= side[a] * std::round(d[a] / side[a]);
        ASSERT_GT(dot(d, d), std::pow(r + l.state.r[j], 2)) << i << ' ' << j;
      }
    }
    EXPECT_TRUE(across);
    EXPECT_NEAR(volume / (side.x * side.y * side.z), 0.25, 1e-12);
  }
  p.box_x = p.box_z = 0.2;  // a box that is given says how loose the grains are
  const LooseGrains l = make_loose_grains(p);
  EXPECT_EQ(l.box_z, 0.2);
}

TEST(Packing, RandomPlacesMayRunOut) {
  Packing p;
  p.count = 2000, p.placement = Packing::Placement::random, p.solid_fraction = 0.6;
  p.box_x = p.box_y = 0.5;
  EXPECT_THROW(make_loose_grains(p), Error);
  p.box_x = 0;
  EXPECT_THROW(make_loose_grains(p), Error);
}

TEST(Packing, LimitsOfLognormalRadii) {
  Packing p;
  p.count = 5000, p.radius_mean = 0.02, p.radius_std = 0.01, p.radius_min = 0.015, p.radius_max = 0.03;
  const std::vector<double> r = make_loose_grains(p).state.r;
  EXPECT_GE(*std::min_element(r.begin(), r.end()), 0.015);
  EXPECT_LE(*std::max_element(r.begin(), r.end()), 0.03);
  p.radius_min = 1, p.radius_max = 2;
  EXPECT_THROW(make_loose_grains(p), Error);
}

// Radii outside of the limits are drawn again: what is inside keeps its shape. ln r is normal, with mean
// ln(mean) - s^2/2 and s^2 = ln(1 + (std/mean)^2); the share below r within the limits follows from that.
TEST(Packing, LognormalBetweenLimits) {
  Packing p;
  p.count = 20000, p.columns_x = p.columns_y = 20, p.radius_mean = 0.01, p.radius_std = 0.004, p.seed = 2;
  p.radius_min = 0.006, p.radius_max = 0.018;
  std::vector<double> r = make_loose_grains(p).state.r;
  std::sort(r.begin(), r.end());
  EXPECT_GE(r.front(), p.radius_min);
  EXPECT_LE(r.back(), p.radius_max);
  const double s2 = std::log(1 + 0.16), mean = std::log(0.01) - s2 / 2;
  const auto below = [&](double radius) {
    return 0.5 * std::erfc((mean - std::log(radius)) / std::sqrt(2 * s2));
  };
  const double low = below(p.radius_min), all = below(p.radius_max) - low;
  double worst = 0;  // Kolmogorov and Smirnov: 1.95/sqrt(n) once in a thousand
  for (std::size_t k = 0; k < r.size(); ++k)
    worst = std::max(worst, std::abs((k + 0.5) / r.size() - (below(r[k]) - low) / all));
  EXPECT_LT(worst, 1.95 / std::sqrt(20000.0));
}

}  // namespace
}  // namespace moraine::dem
