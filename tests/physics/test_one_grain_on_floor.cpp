// One grain on a plane, known answers. Contact is at the lever arm l = R - overlap/2, which the textbook's
// rigid sphere knows as R; where l is constant the answers are compared with l in place, and with the
// textbook to overlap/R.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double R = 0.01;

class OneGrain : public OnEveryBackend {};

Scene on_floor(double k, double mu) {
  Scene s = empty_space(k);
  s.body(BodyId::floor) = floor_at(0);
  s.with(Material::wall).mu_s = s.with(Material::wall).mu_d = mu;
  return s;
}

// Contact is an oscillator whose centre is the static overlap: it lasts 2 (pi - atan(v1 w/g))/w.
TEST_P(OneGrain, BouncesOffTheFloor) {
  Scene s = on_floor(1e4, 0);
  s.gravity = 9.81;
  const double w = std::sqrt(s.with(Material::wall).k_n / mass(s, R)), h = 0.002,
               v1 = std::sqrt(2 * s.gravity * h);
  s.dt = 1e-3 / w;
  const double contact = 2 * (std::numbers::pi - std::atan(v1 * w / s.gravity)) / w;
  const double apex = 2 * v1 / s.gravity + contact;
  const double g_w2 = s.gravity / (w * w), deepest = g_w2 + std::hypot(g_w2, v1 / w);

  const auto engine = make();
  const auto to_contact = static_cast<std::int64_t>(v1 / s.gravity / s.dt);
  State now = run(*engine, s, grains_at_rest({R}, {Vec3d{0, 0, R + h}}), to_contact);
  double overlap = 0;
  for (; static_cast<double>(now.step) * s.dt < v1 / s.gravity + contact; now = engine->state()) {
    overlap = std::max(overlap, R - now.x[0].z);
    engine->advance(1);
  }
  synchronise(s, now);  // free flight from here
  const double v = now.v[0].z, t = static_cast<double>(now.step) * s.dt + v / s.gravity;
  const double height = now.x[0].z - R + v * v / (2 * s.gravity);
  const double second_order = 1e-6;  // (w dt)^2
  EXPECT_NEAR(overlap / deepest, 1, second_order);
  EXPECT_NEAR(t / apex, 1, second_order);
  EXPECT_NEAR(height / h, 1, 2 * second_order);  // goes with v^2
}

// Wall damping settles the spring once rolling has begun; while it slips the force is Coulomb's alone.
TEST_P(OneGrain, SlidesThenRolls) {
  const double u0 = 0.1, mu = 0.3;
  Scene s = on_floor(1e6, mu);
  s.gravity = 9.81;
  s.with(Material::wall).gamma_t = 50;
  s.dt = 0.02 * std::sqrt(mass(s, R) / s.with(Material::wall).k_n);
  const double sunk = mass(s, R) * s.gravity / s.with(Material::wall).k_n, l = R - 0.5 * sunk,
               l2 = l * l / (R * R);
  const Vec3d along{0.6, 0.8, 0};

  const auto engine = make();
  State now = grains_at_rest({R}, {Vec3d{0, 0, R - sunk}});
  now.v[0] = u0 * along;
  engine->load(s, now);
  const auto slip = [&](const State& state) {  // m/s at the contact
    return dot(state.v[0], along) - l * dot(state.omega[0], Vec3d{-along.y, along.x, 0});
  };
  double before = u0, at = u0;
  for (; at > 0; at = slip(now)) {
    before = at;
    engine->advance(1);
    now = engine->state();
  }
  // Velocities belong to n - 1/2. The spring takes mu m g/(k_t u0) = 0.15 dt to load.
  const double end = (static_cast<double>(now.step) - 0.5 - at / (at - before)) * s.dt;
  EXPECT_NEAR(end, u0 / (mu * s.gravity * (1 + 2.5 * l2)), 0.5 * s.dt);
  EXPECT_NEAR(end, 2 * u0 / (7 * mu * s.gravity), 0.5 * s.dt);

  engine->advance(5000);
  now = engine->state();
  const double u = dot(now.v[0], along), omega = dot(now.omega[0], Vec3d{-along.y, along.x, 0});
  EXPECT_NEAR(u / u0, 1 / (1 + 0.4 / l2), 1e-12);
  EXPECT_NEAR(omega * l / u, 1, 1e-12);
  EXPECT_NEAR(u / u0, 5.0 / 7, sunk / R);
  EXPECT_NEAR(omega * R / u, 1, sunk / R);
  EXPECT_NEAR(length(cross(now.omega[0], Vec3d{-along.y, along.x, 0})), 0, 1e-12 * omega);  // no other spin
}

// Impulses are in Coulomb's ratio in every step that slips, so e_t follows from e to rounding. The spin's
// lever arm is R - xi/2 with xi = (v_n/w) sin(wt): its mean, weighted with the force, is R - (pi/8) v_n/w.
TEST_P(OneGrain, ObliqueImpactSlidesThroughout) {
  const auto engine = make();
  for (const double gamma : {0.0, 10.0}) {
    Scene s = on_floor(1e5, 0.2);
    s.with(Material::wall).gamma_n = s.with(Material::wall).gamma_t =
        gamma;  // gamma_t: it slides at once, where a spring alone must load first
    const double w = std::sqrt(s.with(Material::wall).k_n / mass(s, R)), v_n = 0.1, tan_theta = 3,
                 v_t = v_n * tan_theta;
    s.dt = 1e-3 / w;
    const Vec3d along{0.6, -0.8, 0}, axis{0.8, 0.6, 0};
    State now = grains_at_rest({R}, {Vec3d{0, 0, R + 0.5 * v_n * s.dt}});
    now.v[0] = {v_t * along.x, v_t * along.y, -v_n};
    now = run(*engine, s, now, 4000);
    ASSERT_GT(now.x[0].z, R);

    const double e = now.v[0].z / v_n, mu = s.with(Material::wall).mu_d;
    const double beta = 0.5 * gamma / mass(s, R), damped = std::sqrt(w * w - beta * beta);
    EXPECT_NEAR(e, std::exp(-beta / damped * std::atan2(2 * beta * damped, beta * beta - damped * damped)),
                1e-6);
    EXPECT_NEAR(dot(now.v[0], along) / v_t, 1 - mu * (1 + e) / tan_theta, 1e-12);
    const double spin = 2.5 * mu * (1 + e) * v_n / R, deepest = v_n / w;
    EXPECT_NEAR(dot(now.omega[0], axis) / spin, 1, deepest / R);
    if (gamma == 0) {
      EXPECT_NEAR(dot(now.omega[0], axis) / spin, 1 - std::numbers::pi / 8 * deepest / R, 1e-6 * deepest / R);
    }
    EXPECT_NEAR(dot(now.v[0], axis), 0, 1e-14);
  }
}

struct Incline {
  double acceleration, spin_acceleration;  // m/s2, rad/s2
};
// On ground that slopes by theta. Starts as it would roll or slip for ever.
Incline roll_down(Engine& engine, double theta, double mu, double l_expected) {
  Scene s = on_floor(1e6, mu);
  s.gravity = 9.81, s.down = {std::sin(theta), 0, -std::cos(theta)};
  s.dt = 0.02 * std::sqrt(mass(s, R) / s.with(Material::wall).k_n);
  const double weight = mass(s, R) * s.gravity, normal = weight * std::cos(theta);
  const double share = 1 / (1 + 2.5 * l_expected * l_expected / (R * R));
  const double hold = std::min(share * weight * std::sin(theta), mu * normal);
  State start = grains_at_rest({R}, {Vec3d{0, 0, R - normal / s.with(Material::wall).k_n}});
  Spring<double> spring;
  spring.delta_t.x = hold / s.with(Material::wall).k_t;
  start.wall_contacts = {{0, BodyId::floor, spring}};
  const int steps = 5000;
  engine.load(s, start);
  const double before = observe(s, engine.state()).energy.total();
  engine.advance(steps);
  State now = engine.state();
  EXPECT_NEAR(observe(s, now).energy.total() - before + now.ledger.slip, 0,
              1e-9 * weight * std::sin(theta) * now.x[0].x);
  synchronise(s, now);
  const double time = steps * s.dt;
  return {now.v[0].x / time, now.omega[0].y / time};
}

TEST_P(OneGrain, RollsDownASlopeOrSlips) {
  const auto engine = make();
  const double g = 9.81, mu = 0.2, critical = std::atan(3.5 * mu);
  Scene s = on_floor(1e6, mu);
  for (const double theta : {0.2, 0.999 * critical, 1.001 * critical, 0.8}) {
    const double sunk = mass(s, R) * g * std::cos(theta) / 1e6, l = R - 0.5 * sunk;
    const Incline got = roll_down(*engine, theta, mu, l);
    const bool rolls = theta < critical;
    const double a = rolls ? 5.0 / 7 * g * std::sin(theta) : g * (std::sin(theta) - mu * std::cos(theta));
    const double spin = rolls ? a / R : 2.5 * mu * g * std::cos(theta) / R;
    EXPECT_NEAR(got.acceleration / a, 1, sunk / R) << "theta = " << theta;
    EXPECT_NEAR(got.spin_acceleration / spin, 1, sunk / R) << "theta = " << theta;
    if (rolls) {
      EXPECT_NEAR(got.acceleration / (g * std::sin(theta) / (1 + 0.4 * R * R / (l * l))), 1, 1e-9);
    } else {
      EXPECT_NEAR(got.acceleration / a, 1, 1e-9);
    }
  }
}

ON_EVERY_BACKEND(OneGrain);

}  // namespace
}  // namespace moraine::dem
