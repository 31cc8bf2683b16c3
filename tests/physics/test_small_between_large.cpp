// A small grain between two large ones, up to 1:100. An integrator that adds to a friction spring what
// velocities between two steps do across normals of a whole one lets the spring gain a little along the
// contact at each step, far more than a small grain's weight can draw it: such grains stick where they should
// roll (Vyas, Ottino, Lueptow & Umbanhowar 2025, arXiv 2410.14798). What is known here:
//   crevice   on two large grains that touch it rolls down as a pendulum on its head does, whose inertia is
//             that of its spin too;
//   at rest   pressed by two large grains it stays, and comes back to the middle, its springs to zero;
//   in shear  large grains that do not spin roll it between them: it stays at the middle of their centres,
//             turns by d/l of the angle by which the line of centres leans, and friction bears nothing;
//   in a wedge it is held where tan(alpha) < mu, else expelled; alpha: from the plane between the large ones.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double k = 1e5, large = 0.05;
constexpr int small = 0, lower = 1, upper = 2;
constexpr double ratios[] = {1, 10, 30, 100};

// Floor, large grain, small grain, large grain, wall, in equilibrium: each contact of the small grain, which
// stands at angle alpha out of the line of centres, bears k times this overlap.
struct Sandwich {
  Scene scene;
  State state;
  double r, overlap, omega_0;  // m, m, 1/s: of the small grain on one spring

  Sandwich(double ratio, double mu, double alpha = 0) : scene(empty_space(k)), r(large / ratio) {
    overlap = 0.01 * r, omega_0 = std::sqrt(k / mass(scene, r));
    scene.dt = 0.1 / omega_0;
    const double damping = mass(scene, r) * omega_0;  // half the critical one, of two contacts
    scene.contact.fill(LinearContact{k, k, damping, damping, mu, mu});
    scene.with(Material::wall).mu_s = scene.with(Material::wall).mu_d = 0;
    scene.body(BodyId::floor) = floor_at(0);
    // f_t = N tan(alpha) as long as friction allows, and the load is the sum of both along z.
    const double share = std::min(std::tan(alpha), mu), n = k * overlap,
                 load = n * (std::cos(alpha) + share * std::sin(alpha));
    const double d = large + r - overlap, h = d * std::cos(alpha), z = large - load / k + h;
    scene.body(BodyId::top_wall) = wall_pressed_by(load / scene.area(), mass(scene, large));
    state = grains_at_rest({r, large, large}, {{d * std::sin(alpha), 0, z}, {0, 0, z - h}, {0, 0, z + h}});
    state.part_of = {BodyId::none, BodyId::bottom_layer, BodyId::top_layer};
    state.wall_z() = z + h + large - load / k;
    drive_top_layer(scene, Drive::at(0));
    // The spring of the small grain is drawn outwards.
    for (const int other : {lower, upper}) {
      const double up = other == lower ? -1 : 1, out = share * n / k;
      Contact c{small, other, {}};
      c.spring.delta_t = {out * std::cos(alpha), 0, up * out * std::sin(alpha)};
      state.contacts.push_back(c);
    }
  }
  Vec3d off_middle(const State& s) const { return s.x[small] - 0.5 * (s.x[lower] + s.x[upper]); }
};

double largest_spring(const State& s) {
  double most = 0;
  for (const Contact& c : s.contacts) most = std::max(most, length(c.spring.delta_t));
  return most;
}

class SmallBetweenLarge : public OnEveryBackend {};

// Its centre goes round the line of centres of the large ones at rho, at an angle theta from the top:
//   theta'' = g sin(theta)/(rho (1 + K)),  K = 2/5 (large + r)^2/rho^2
// for it rolls on points that are r rho/(large + r) off its axis.
TEST_P(SmallBetweenLarge, RollsOffACrevice) {
  const auto engine = make();
  for (const double ratio : ratios) {
    SCOPED_TRACE(ratio);
    constexpr int steps = 100000;
    constexpr double theta_0 = 0.1, g = 9.81;
    const double r = large / ratio, d = large + r, rho = std::sqrt(d * d - large * large),
                 rate_2 = g / (rho * (1 + 0.4 * d * d / (rho * rho)));
    Scene s = empty_space(k);
    s.body(BodyId::bottom_layer) = layer({}, true);
    s.gravity = g;
    s.dt = 2.5 / std::sqrt(rate_2) / steps;  // until it is at about 0.6
    // Springs such that the step is 0.1 of sqrt(m/k), as always.
    const double m = mass(s, r), soft = m * std::pow(0.1 / s.dt, 2), damping = 0.2 * std::sqrt(m * soft);
    s.contact.fill(LinearContact{soft, soft, damping, damping, 0.5, 0.5});
    // Both contacts bear it. The overlap is 4e-4 of r at most, and rho less by that times d/rho.
    const double overlap = 0.5 * m * g * std::cos(theta_0) * d / rho / soft, at = rho - overlap * d / rho;
    State start =
        grains_at_rest({r, large, large},
                       {{0, at * std::sin(theta_0), at * std::cos(theta_0)}, {-large, 0, 0}, {large, 0, 0}});
    start.part_of = {BodyId::none, BodyId::bottom_layer, BodyId::bottom_layer};
    engine->load(s, start);
    // Springs hold, along its way, half of what makes it spin; and across, their share of what its weight and
    // the turn of its way have taken off the load since it was put there. They turn with the mean spin of
    // both, against the way's own turn about the normal, by which `along` becomes `across`: of that a share
    // (rho/d)^2 stays, what the normal springs do not let go.
    const double weight = m * g / soft, spins = 1 - rate_2 * rho / g;
    const auto along = [&](double way) { return 0.5 * weight * std::sin(way) * spins; };
    double theta = theta_0, speed = 0, turned = 0;  // of the answer, by Runge and Kutta
    for (int part = 0; part < 20; ++part) {
      engine->advance(steps / 20);
      const double h = s.dt * steps / 20 / 100;
      for (int n = 0; n < 100; ++n) {
        const auto pull = [&](double way) { return rate_2 * std::sin(way); };
        const double a1 = pull(theta), a2 = pull(theta + h / 2 * speed),
                     a3 = pull(theta + h / 2 * (speed + h / 2 * a1)),
                     a4 = pull(theta + h * (speed + h / 2 * a2)), before = theta;
        theta += h * (speed + h / 6 * (a1 + a2 + a3)), speed += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
        turned += (theta - before) * (0.5 * d / r - 1) * large / d * along(0.5 * (theta + before));
      }
      const double taken = std::cos(theta_0) - std::cos(theta) + rho * speed * speed / g,
                   across = 0.5 * weight * taken * large / d - turned * rho * rho / (d * d);
      const State now = engine->state();
      ASSERT_EQ(now.contacts.size(), 2u) << part;
      const Vec3d& x = now.x[small];
      // Overlaps take some 1e-4 from rho and lever arms; of springs 1e-5 is left. Wrong normals add 2e-3 to
      // them at 1:100 and 0.5 at 1:10, and more with shorter steps.
      EXPECT_NEAR(std::atan2(x.y, x.z), theta, 2e-4 * theta);
      EXPECT_LT(std::abs(x.x), 1e-12 * r);
      EXPECT_NEAR(largest_spring(now), std::hypot(along(theta), across), 1e-4 * overlap);
    }
  }
}

// Nothing is exact but the symmetry: what has no force along x begins no motion there.
TEST_P(SmallBetweenLarge, RestsWithoutAMotion) {
  const auto engine = make();
  for (const double ratio : ratios) {
    SCOPED_TRACE(ratio);
    Sandwich a(ratio, 0.5);
    a.state.part_of = {BodyId::none, BodyId::none, BodyId::none};  // large ones may roll, too
    a.scene.body(BodyId::bottom_layer) = a.scene.body(BodyId::top_layer) = {};
    const State now = run(*engine, a.scene, a.state, 50000);
    ASSERT_EQ(now.contacts.size(), 2u);
    for (const int i : {small, lower, upper}) {
      EXPECT_EQ((Vec3d{now.x[i].x, now.x[i].y, 0}), (Vec3d{0, 0, 0}));
      EXPECT_EQ(now.rotation[i], (Vec3d{0, 0, 0}));
    }
    // Forces in balance to the roundings of places of 0.1 m: k 1e-17 m against k overlap.
    EXPECT_LT(std::abs(a.off_middle(now).z), 1e-15);
  }
}

// Knocked out of its place, along the contacts and across at once, by a fifth of what would slip.
TEST_P(SmallBetweenLarge, ComesBackToTheMiddle) {
  const auto engine = make();
  for (const double ratio : ratios)
    for (const double damping : {0.0, 0.02}) {
      SCOPED_TRACE(testing::Message() << "1:" << ratio << ", damping " << damping);
      Sandwich a(ratio, 0.5);
      drive_top_layer(a.scene, Drive::at(0), true);  // large ones are held
      a.scene.body(BodyId::floor) = a.scene.body(BodyId::top_wall) = {};
      a.scene.with(Material::grain).gamma_n *= damping, a.scene.with(Material::grain).gamma_t *= damping;
      const double way = 0.1 * a.overlap;  // f_t reaches about 0.1 of the normal force; 0.5 would slip
      a.state.v[small] = way * a.omega_0 * Vec3d{1, 0.5, 1};
      a.state.omega[small] = way * a.omega_0 / a.r * Vec3d{0.3, -0.7, 0.5};
      State now = run(*engine, a.scene, a.state, 20000);
      // Over 250 periods and more, the mean of what is left: no drift. Between 64 samples at odd times the
      // swing itself averages to a tenth.
      Vec3d mean{0, 0, 0}, turned{0, 0, 0};
      engine->load(a.scene, now);
      constexpr int samples = 64;
      for (int s = 0; s < samples; ++s) {
        engine->advance(317);
        now = engine->state();
        mean += (1.0 / samples) * a.off_middle(now), turned += (a.r / samples) * now.rotation[small];
      }
      ASSERT_EQ(now.contacts.size(), 2u);
      const double bound = damping == 0 ? 0.3 * way : 1e-3 * way;
      EXPECT_LT(length(mean), bound);
      turned.z = 0;  // spin about the normal has no spring
      EXPECT_LT(length(turned), bound);
      if (damping > 0) {
        EXPECT_LT(largest_spring(now), bound);
      }
    }
}

// To and fro, by its radius to either side.
TEST_P(SmallBetweenLarge, RollsInShear) {
  const auto engine = make();
  for (const double ratio : ratios) {
    SCOPED_TRACE(ratio);
    Sandwich a(ratio, 0.5);
    constexpr int parts = 200;
    constexpr std::int64_t steps = 20000;
    const double u = a.r / (steps * a.scene.dt);
    State now = a.state;
    double rolled = 0, lean = 0;  // rad
    for (const int leg : {1, -1, -1, 1}) {
      drive_top_layer(a.scene, Drive::at(leg * u));
      const double omega = 0.5 * leg * u / (a.r - 0.5 * a.overlap);
      now.v[small] = {0.5 * leg * u, 0, 0}, now.omega[small] = {0, omega, 0};
      engine->load(a.scene, now);
      for (int part = 0; part < parts; ++part) {
        engine->advance(steps / parts);
        now = engine->state();
        // The large ones swing on it slowly, so that its lever arms change.
        const Vec3d line = now.x[upper] - now.x[lower];
        const double before = lean, d = 0.5 * length(line);
        lean = std::atan2(line.x, line.z), rolled += d / (0.5 * (d + a.r - large)) * (lean - before);
        // Its inertia draws the springs a little, most at 1:1, whose large grains set off as it does.
        ASSERT_EQ(now.contacts.size(), 2u);
        ASSERT_LT(length(a.off_middle(now)), 1e-3 * a.overlap);
        ASSERT_LT(largest_spring(now), 1e-3 * a.overlap);
        // Lever arms are taken at the end of a part here: off by the way they change in one.
        ASSERT_NEAR(rolled, now.rotation[small].y, 1e-3 * a.overlap / a.r);
        ASSERT_EQ(now.rotation[small].x, 0);
        ASSERT_EQ(now.rotation[small].z, 0);
      }
      synchronise(a.scene, now);
      now.step = 0;
    }
  }
}

// The load swings by a fifth; friction of the right size holds, by 5 % less does not.
TEST_P(SmallBetweenLarge, IsHeldByFrictionOrExpelled) {
  const auto engine = make();
  for (const double ratio : ratios)
    for (const bool holds : {true, false}) {
      SCOPED_TRACE(testing::Message() << "1:" << ratio << (holds ? " held" : " expelled"));
      const double mu = 0.5 * std::sqrt(2 / ratio);  // so that the large ones do not touch
      const Sandwich begin(ratio, mu, std::atan((holds ? 0.95 : 1.05) * mu));
      Scene s = begin.scene;
      Drive& load = s.body(BodyId::top_wall).z;
      load.amplitude = 0.2 * load.mean, load.frequency = 1 / (2000 * s.dt);
      const State now = run(*engine, s, begin.state, 100000);
      const double out = begin.off_middle(now).x - begin.off_middle(begin.state).x;
      if (holds) {
        ASSERT_EQ(now.contacts.size(), 2u);
        EXPECT_LT(std::abs(out), begin.overlap);
        // A change of the load comes to the lower contact a little later, and turns it by that.
        EXPECT_LT(length(now.rotation[small]) * begin.r, 1e-4 * begin.overlap);
      } else {
        EXPECT_GT(out, begin.r);
      }
    }
}

ON_EVERY_BACKEND(SmallBetweenLarge);

}  // namespace
}  // namespace moraine::dem
