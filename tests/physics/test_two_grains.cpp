// Two grains, known answers.
#include "backends.hpp"
#include "dem/law/laws.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double k = 1e5, r1 = 0.01, v0 = 0.1;

struct Collision {
  double time, overlap, v1, v2;  // s, m, m/s along the line of flight
};

// Grain 1 flies at v0 at grain 2, which rests. They begin half a step apart, so that contact begins between
// two steps.
Collision collide(Engine& engine, const Scene& s, double r2) {
  const Vec3d n{1.0 / 3, 2.0 / 3, 2.0 / 3};
  const double gap = 0.5 * v0 * s.dt;
  State start = grains_at_rest({r1, r2}, {Vec3d{0, 0, 0}, (r1 + r2 + gap) * n});
  start.v[0] = v0 * n;
  engine.load(s, start);
  Collision c{};
  double distance = 0;
  std::int64_t steps = 0;
  for (bool closed = true; closed; ++steps) {
    engine.advance(1);
    const State now = engine.state();
    distance = length(now.x[1] - now.x[0]);
    c.overlap = std::max(c.overlap, r1 + r2 - distance);
    c.v1 = dot(now.v[0], n), c.v2 = dot(now.v[1], n);
    closed = steps == 0 || distance < r1 + r2;
  }
  // Flight before and after is uniform.
  c.time = static_cast<double>(steps) * s.dt - gap / v0 - (distance - r1 - r2) / (c.v2 - c.v1);
  return c;
}

double reduced_mass(const Scene& s, double r2) { return 1 / (1 / mass(s, r1) + 1 / mass(s, r2)); }

class TwoGrains : public OnEveryBackend {};

TEST_P(TwoGrains, HeadOnElastic) {
  const auto engine = make();
  for (const double r2 : {r1, 1.7 * r1}) {
    Scene s = empty_space(k);
    const double m1 = mass(s, r1), m2 = mass(s, r2), inverse_omega = std::sqrt(reduced_mass(s, r2) / k);
    s.dt = 1e-3 * inverse_omega;
    const double second_order = 1e-6;  // (omega dt)^2
    const Collision c = collide(*engine, s, r2);
    EXPECT_NEAR(c.time / (std::numbers::pi * inverse_omega), 1, second_order);
    EXPECT_NEAR(c.overlap / (v0 * inverse_omega), 1, second_order);
    EXPECT_NEAR(c.v1 / v0, (m1 - m2) / (m1 + m2), second_order);
    EXPECT_NEAR(c.v2 / v0, 2 * m1 / (m1 + m2), second_order);
  }
}

// m* xi'' + gamma xi' + k xi = 0 from xi = 0, xi' = v0, until the force k xi + gamma xi' is zero and would
// begin to pull (Schwager and Poeschel 2007). With beta = gamma/2m*, w^2 = w0^2 - beta^2 that is at t_c =
// atan2(2 beta w, beta^2 - w^2)/w, or ln((beta + W)/(beta - W))/W with W^2 = beta^2 - w0^2 where it is
// overdamped; then xi' = -v0 exp(-beta t_c).
double restitution(double beta, double w0) {
  const double w = std::sqrt(std::abs(w0 * w0 - beta * beta));
  const double t_c =
      beta < w0 ? std::atan2(2 * beta * w, beta * beta - w * w) / w : std::log((beta + w) / (beta - w)) / w;
  return std::exp(-beta * t_c);
}

TEST_P(TwoGrains, HeadOnDamped) {
  const auto engine = make();
  for (const double r2 : {r1, 1.7 * r1})
    for (const double damping : {0.05, 0.3, 0.8, 1.5}) {  // beta/omega_0
      Scene s = empty_space(k);
      const double m = reduced_mass(s, r2), w0 = std::sqrt(k / m);
      s.with(Material::grain).gamma_n = 2 * damping * w0 * m;
      s.dt = 1e-3 / w0;
      const Collision c = collide(*engine, s, r2);
      // second order: the largest rate is w0 or 2 beta
      const double rate = std::max(1.0, 2 * damping) * 1e-3;
      EXPECT_NEAR((c.v2 - c.v1) / v0, restitution(damping * w0, w0), rate * rate)
          << "beta/omega_0 = " << damping;
    }
}

// A grain is drawn over one that is held, and slips: mu_d = 0.3. It does so where a stage begins, too, and
// does not climb to mu_s = 0.6 again; also where the stage before had but one friction and did not need to
// know.
TEST_P(TwoGrains, WhatSlipsGoesOnSlippingWhereAStageBegins) {
  const auto engine = make();
  for (const double mu_before : {0.6, 0.3}) {
    Scene s = empty_space(k);
    s.with(Material::grain).mu_s = mu_before, s.with(Material::grain).mu_d = 0.3;
    drive_top_layer(s, Drive::at(0.01));
    s.dt = 0.05 * std::sqrt(mass(s, r1) / k);
    // Floor, grain, grain, wall: at each contact the same overlap.
    const double overlap = 1e-3 * r1;
    s.body(BodyId::floor) = floor_at(0);
    s.with(Material::wall).mu_s = s.with(Material::wall).mu_d = 0;
    s.body(BodyId::top_wall) = wall_pressed_by(k * overlap / s.area(), mass(s, r1));
    State grains = grains_at_rest({r1, r1}, {{0, 0, r1 - overlap}, {0, 0, 3 * r1 - 2 * overlap}});
    grains.part_of = {BodyId::bottom_layer, BodyId::top_layer};
    grains.wall_z() = 4 * r1 - 3 * overlap;
    const auto friction = [&](const State& now) {
      return -now.at(BodyId::top_layer).force.x / (k * overlap);
    };
    // To slip takes a way of mu_s overlap.
    const auto steps = static_cast<std::int64_t>(1.5 * 0.6 * overlap / (0.01 * s.dt));
    State before = run(*engine, s, grains, steps);
    ASSERT_NEAR(friction(before), 0.3,
                0.003);  // the normal leans by 9e-6 m in 2e-2 m
    if (s.with(Material::grain).mu_s == s.with(Material::grain).mu_d) mark_slipping(s, before);
    synchronise(s, before);
    s.with(Material::grain).mu_s = 0.6;
    double most = 0;
    engine->load(s, before);
    for (std::int64_t n = 0; n < steps; ++n) {
      engine->advance(1);
      most = std::max(most, friction(engine->state()));
    }
    EXPECT_NEAR(most, 0.3, 0.003) << mu_before;
    // What rests has the static friction to lose.
    grains.v.assign(2, {0, 0, 0});
    most = 0;
    engine->load(s, grains);
    for (std::int64_t n = 0; n < steps; ++n) {
      engine->advance(1);
      most = std::max(most, friction(engine->state()));
    }
    EXPECT_NEAR(most, 0.6, 0.02);  // a step is 0.017 of the way
  }
}

// Two grains of a layer whose velocity varies across y lie in each other's way: one passes through the other,
// at the velocity of its place. A third, which is free, is pushed aside.
TEST_P(TwoGrains, OfALayerThatVariesAcrossItPassEachOther) {
  const auto engine = make();
  Scene s = empty_space(k);
  s.box = {1, 0.4, 1};
  s.dt = 1e-5;
  drive_top_layer(s, Drive::at(0.1));
  s.body(BodyId::top_layer).x.profile = Profile::linear;
  State grains = grains_at_rest({r1, r1, r1}, {{0.5, 0.2, 0.5}, {0.51, 0.19, 0.5}, {0.519, 0.2, 0.5}});
  grains.part_of = {BodyId::top_layer, BodyId::top_layer, BodyId::none};
  const State end = run(*engine, s, grains, 20000);
  EXPECT_NEAR(end.x[0].x - 0.5, 0.5 * 0.1 * 0.2, 1e-9);
  EXPECT_NEAR(end.x[1].x - 0.51, 0.475 * 0.1 * 0.2, 1e-9);
  EXPECT_EQ(end.x[0].z, 0.5);
  EXPECT_GT(end.x[2].x, 0.53);
}

ON_EVERY_BACKEND(TwoGrains);

// A pair with a strained tangential spring, carried round once as one rigid body, about four axes in the four
// lanes of a Pack: two across the normal, along it, oblique. Force and torque must turn with it. The step is
// small because the velocity at the contact is itself of second order in the angle: a pair that turns by one
// radian in steps of theta gathers theta^2/6 of its size.
TEST(RotatedPair, ForcesTurnWithIt) {
  using Vec3p = Vec3<Pack>;
  const double r_i = 0.012, r_j = 0.008, distance = 0.98 * (r_i + r_j), strained = 0.01 * distance;
  const ContactParameters law = LinearContact{k, k, 0, 0, 1, 1};
  const double theta = 5e-7, dt = 1e-6;
  const auto steps = static_cast<std::int64_t>(2 * std::numbers::pi / theta);

  const Vec3d n{1.0 / 3, 2.0 / 3, 2.0 / 3}, t{2.0 / 3, 1.0 / 3, -2.0 / 3}, b = cross(n, t),
                                                                           o = n + 2.0 * t + b;
  const Vec3d axes[4] = {t, b, n, 1 / length(o) * o};
  const auto lanes = [](auto&& a) {  // a(lane) is a vector
    return Vec3p{
        {a(0).x, a(1).x, a(2).x, a(3).x}, {a(0).y, a(1).y, a(2).y, a(3).y}, {a(0).z, a(1).z, a(2).z, a(3).z}};
  };
  const auto lane = [](const Vec3p& a, int l) { return Vec3d{a.x[l], a.y[l], a.z[l]}; };
  const Vec3p axis = lanes([&](int l) { return axes[l]; }), n_0 = lanes([&](int) { return n; });
  const Vec3p across = cross(axis, n_0), along = dot(axis, n_0) * axis, omega = Pack(theta / dt) * axis;
  const auto turned = [&](double angle) {
    return axpy(Pack(std::cos(angle)), n_0 - along, axpy(Pack(std::sin(angle)), across, along));
  };

  for (const double spring : {0.0, strained}) {
    const Vec3d first = spring / std::sqrt(2.0) * (t + b);
    Spring<Pack> s;
    s.delta_t = lanes([&](int) { return first; });
    Action<Pack> a{};
    Pack slip = 0.0;
    for (std::int64_t step = 1; step <= steps; ++step) {
      const double angle = static_cast<double>(step) * theta;
      const auto g = between_grains<Pack>(Pack(distance) * turned(angle), r_i + r_j, r_i - r_j);
      // (x(n) - x(n-1))/dt, without the cancellation
      const Vec3p v =
          Pack(2 * std::sin(0.5 * theta) / dt * distance) * cross(axis, turned(angle - 0.5 * theta));
      const Motion<Pack> motion{v, omega, omega};
      a = contact_law<Linear<Coulomb, Undamped>, Account::energy>(law, dt, g, motion, s);
      slip += a.slip;
    }
    const double end = static_cast<double>(steps) * theta, scale = k * strained;
    for (int l = 0; l < 4; ++l) {
      const auto expected = [&](const Vec3d& c) {  // Rodrigues
        return std::cos(end) * c + std::sin(end) * cross(axes[l], c) +
               (1 - std::cos(end)) * dot(axes[l], c) * axes[l];
      };
      const Vec3d n_end = expected(n), f = lane(a.f, l), f_t = f - dot(f, n_end) * n_end;
      EXPECT_EQ(slip[l], 0);
      EXPECT_NEAR(length(f_t), k * spring, 1e-10 * scale) << "axis " << l;
      EXPECT_LT(length(f_t - expected(-k * first)), 1e-10 * scale) << "axis " << l;
      EXPECT_LT(length(lane(a.f_x_n, l) - expected(cross(-k * first, n))), 1e-10 * scale) << "axis " << l;
      // What the forces do to the pair, the torques undo.
      EXPECT_LT(length(cross(distance * n_end, f) + distance * lane(a.f_x_n, l)),
                1e-14 * distance * length(f));
    }
  }
}

}  // namespace
}  // namespace moraine::dem
