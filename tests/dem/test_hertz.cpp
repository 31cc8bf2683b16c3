// Hertz and Mindlin's law, rolling, twisting and cohesion by themselves.
#include <gtest/gtest.h>

#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

using Elastic = HertzMindlin<Coulomb, Undamped>;
constexpr Account energy = Account::energy;
constexpr double r = 0.01;

ContactParameters elastic(double mu) {
  ContactParameters p = LinearContact{0, 0, 0, 0, mu, mu};
  p.E_star = 5e8, p.G_star = 1e8;
  return p;
}
Geometry<double> pressed(double overlap) { return between_grains(Vec3d{0, 0, 2 * r - overlap}, 2 * r, 0.0); }

// Johnson (1985), eqs. 4.22 to 4.24 and 7.42, of glass on glass: E = 70 GPa, nu = 0.2.
TEST(Hertz, ForceStiffnessAndEnergy) {
  const double E = 70e9, nu = 0.2, E_star = young_star(E, nu, E, nu), G = E / (2 * (1 + nu));
  EXPECT_NEAR(E_star, E / (2 * (1 - nu * nu)), 1e-12 * E);
  EXPECT_NEAR(shear_star(E, nu, E, nu), G / (2 * (2 - nu)), 1e-12 * G);
  ContactParameters p = elastic(0);
  p.E_star = E_star;
  const double overlap = 1e-6, R = r / 2, a = std::sqrt(R * overlap);
  const Geometry<double> g = pressed(overlap);
  const auto at = Hertz::at(p, g, reduced_radius(g));
  const double f = 4.0 / 3 * E_star * std::sqrt(R) * std::pow(overlap, 1.5);
  EXPECT_NEAR(at.a, a, 1e-9 * a);
  EXPECT_NEAR(Hertz::force(p, g, at), f, 1e-8 * f);
  EXPECT_NEAR(Hertz::stiffness(p, at), 1.5 * f / overlap, 1e-8 * f / overlap);
  EXPECT_NEAR(Hertz::stored(p, g, at), 0.4 * f * overlap, 1e-8 * f * overlap);
  const Geometry<double> wall = at_plane({0, 0, r - overlap}, r, 2, 0, 1);
  EXPECT_NEAR(Hertz::at(p, wall, reduced_radius(wall)).a, std::sqrt(r * overlap), 1e-9 * a);
}

// Between spheres of unlike size and material.
TEST(Hertz, OfUnlikeSpheres) {
  const Geometry<double> g = between_grains(Vec3d{0, 0, 0.03 - 1e-6}, 0.03, 0.01);  // 2 and 1 cm
  EXPECT_NEAR(reduced_radius(g).radius, 0.02 / 3, 1e-12);
  EXPECT_NEAR(1 / young_star(2e9, 0.3, 5e9, 0.1), 0.91 / 2e9 + 0.99 / 5e9, 1e-20);
}

struct Cycle {
  double work, slip, stored;  // J
};
// A contact that is taken round a loop of (overlap, shear): `steps` a side.
Cycle cycle(const std::vector<std::pair<double, double>>& corners, int steps) {
  const ContactParameters p = elastic(100);
  Spring<double> spring;
  double x = 0, u = 0;
  const double dt = 1;
  Cycle out{};
  const auto energy_in = [&](double overlap) {
    return GeneralLaw::stored_tangential(p, pressed(overlap), spring);
  };
  double f_before = 0;
  for (const auto& [x_end, u_end] : corners) {
    const double x_0 = x, u_0 = u;
    for (int k = 1; k <= steps; ++k) {
      const double x_new = x_0 + (x_end - x_0) * k / steps, u_new = u_0 + (u_end - u_0) * k / steps;
      const Geometry<double> g = pressed(x_new);
      const Motion<double> m{{(u_new - u) / dt, 0, -(x_new - x) / dt}, {0, 0, 0}, {0, 0, 0}};
      // The pair does not turn: its normal is held.
      Geometry<double> held = g;
      held.curvature = 1e-300;
      const Action<double> a = contact_law<Elastic, energy>(p, dt, held, m, spring);
      out.work += -0.5 * (f_before + a.f.x) * (u_new - u);
      out.slip += a.slip;
      f_before = a.f.x, x = x_new, u = u_new;
    }
  }
  out.stored = energy_in(x);
  return out;
}

// What shear gives is stored or booked, and no loop of normal and shear force creates energy: with the
// spring's force kept in unloading, or its displacement in loading, one of these loops would.
TEST(Mindlin, NoCycleCreatesEnergy) {
  const double x = 1e-5, u = 2e-6;
  for (const auto& corners : {std::vector<std::pair<double, double>>{{x, 0}, {x, u}, {3 * x, u}, {3 * x, 0}},
                              {{3 * x, 0}, {3 * x, u}, {x, u}, {x, 0}},
                              {{x, 0}, {3 * x, u}, {2 * x, -u}, {x, 0}},
                              {{x, 0}, {x, u}, {0, u}}}) {
    const Cycle c = cycle(corners, 400);
    EXPECT_NEAR(c.work, c.stored + c.slip, 1e-9 * std::abs(c.slip));
    EXPECT_GT(c.slip, 0);
    EXPECT_GE(c.work, c.stored);
  }
}

// Loading keeps the force of the spring, unloading its displacement (Elata & Berryman 1996).
TEST(Mindlin, LoadingKeepsTheForceUnloadingTheDisplacement) {
  const ContactParameters p = elastic(100);
  Spring<double> spring;
  const auto go = [&](double overlap, double shear) {
    Geometry<double> g = pressed(overlap);
    g.curvature = 1e-300;
    return contact_law<Elastic, energy>(p, 1, g, {{shear, 0, 0}, {0, 0, 0}, {0, 0, 0}}, spring).f.x;
  };
  go(1e-6, 0);
  const double f = go(1e-6, 1e-8);
  EXPECT_NEAR(f, -8 * p.G_star * std::sqrt(0.005 * 1e-6) * 1e-8, 1e-7 * std::abs(f));
  EXPECT_NEAR(go(4e-6, 0), f, 1e-12 * std::abs(f));
  EXPECT_NEAR(spring.delta_t.x, 0.5e-8, 1e-13);
  EXPECT_NEAR(go(1e-6, 0), 0.5 * f, 1e-6 * std::abs(f));
  EXPECT_NEAR(spring.delta_t.x, 0.5e-8, 1e-13);
  EXPECT_EQ(go(-1e-6, 0), 0);
  EXPECT_EQ(spring.delta_t.x, 0);
}

TEST(Restitution, DampingRatioIsItsInverse) {
  EXPECT_EQ(damping_ratio(1), 0);
  for (double e = 0.05; e <= 1; e += 0.05) EXPECT_NEAR(restitution_of(damping_ratio(e)), e, 1e-12);
  EXPECT_NEAR(restitution_of(0.01), std::exp(-0.01 * std::numbers::pi), 1e-3);  // as if it could pull
  EXPECT_NEAR(restitution_of(1 - 1e-9), std::exp(-2), 1e-6);
  EXPECT_NEAR(restitution_of(1 + 1e-9), std::exp(-2), 1e-6);
}

// A couple against the relative spin along the contact plane, up to mu_roll R f_n; on j the opposite.
TEST(Rolling, ElasticThenPlastic) {
  using L = Linear<Coulomb, Undamped, Rolling>;
  ContactParameters p = LinearContact{1e5, 0, 0, 0, 0.5, 0.5};
  p.k_roll = 2e4, p.mu_roll = 0.1;
  Spring<double> spring;
  Geometry<double> g = pressed(1e-5);
  const double R = r / 2, f_n = 1e5 * 1e-5;
  const auto turn = [&](double angle) {
    return contact_law<L, energy>(p, 1, g, {{0, 0, 0}, {0.5 * angle, 0, 3}, {-0.5 * angle, 0, -3}}, spring);
  };
  const double most = p.mu_roll * f_n / (p.k_roll * R);  // rad
  Action<double> a = turn(0.5 * most);
  EXPECT_NEAR(a.couple.x, -0.5 * p.mu_roll * R * f_n, 1e-9 * R * f_n);
  EXPECT_NEAR(a.couple.z, 0, 1e-12 * R * f_n);  // twisting is another part
  EXPECT_EQ(a.slip, 0);
  a = turn(most);
  EXPECT_NEAR(a.couple.x, -p.mu_roll * R * f_n, 1e-9 * R * f_n);
  EXPECT_NEAR(a.slip, 0.75 * p.mu_roll * R * f_n * 0.5 * most, 1e-6 * R * f_n * most);
  EXPECT_NEAR(a.torque_on_i(g).x + a.torque_on_j(g).x, 0, 1e-12 * R * f_n);
  g.delta_n = 1e-6;  // open
  a = turn(most);
  EXPECT_EQ(length(a.couple), 0);
  EXPECT_EQ(length(spring.rolled), 0);
}

TEST(Twisting, ElasticThenPlastic) {
  ContactParameters p = LinearContact{1e5, 0, 0, 0, 0.5, 0.5};
  p.k_twist = 2e4, p.mu_twist = 0.1;
  Spring<double> spring;
  const Geometry<double> g = pressed(1e-5);
  const double R = r / 2, f_n = 1e5 * 1e-5, most = p.mu_twist * f_n / (p.k_twist * R);
  const auto turn = [&](double angle) {
    return contact_law<GeneralLaw, energy>(p, 1, g, {{0, 0, 0}, {0, 2, 0.5 * angle}, {0, -2, -0.5 * angle}},
                                           spring);
  };
  EXPECT_NEAR(turn(0.5 * most).couple.z, -0.5 * p.mu_twist * R * f_n, 1e-9 * R * f_n);
  EXPECT_NEAR(turn(most).couple.z, -p.mu_twist * R * f_n, 1e-9 * R * f_n);
  EXPECT_NEAR(turn(-4 * most).couple.z, p.mu_twist * R * f_n, 1e-9 * R * f_n);
}

// The impulse of the pull over the steps of a passing contact is c times the time that it lasted.
TEST(Cohesion, ImpulseOfAPassingContact) {
  const double c = 2, dt = 1e-4, v = 0.3;  // N, s, m/s: 3e-5 m a step
  const auto impulse = [&](double first_gap) {
    double sum = 0, gap = first_gap;
    for (const double speed : {-v, v})
      for (int k = 0; k < 10; ++k) {
        gap += speed * dt;
        const double closing = -speed * dt;
        if (gap < 0) sum += c * Cohesion::share(gap, closing) * dt;
      }
    return sum;
  };
  // It touches from -first_gap/v on, turns back after ten steps, and opens as long after.
  for (const double gap : {1e-6, 7e-6, 1.4e-5, 2e-5, 2.9e-5})
    EXPECT_NEAR(impulse(gap), 2 * c * (10 * dt - gap / v), 1e-9 * c * dt) << gap;
}

}  // namespace
}  // namespace moraine::dem
