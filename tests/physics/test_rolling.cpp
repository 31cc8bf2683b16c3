// Resistance to rolling, known answers. Contact is at the lever arm l = r - overlap/2; the couple is at most
// R mu_roll f_n, R = r at a plane.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double r = 0.01, g = 9.81;

Scene on_floor(double k, double mu, double mu_roll) {
  Scene s = empty_space(k);
  s.body(BodyId::floor) = floor_at(0), s.gravity = g;
  for (ContactParameters& p : s.contact) p.mu_s = p.mu_d = mu, p.k_roll = k, p.mu_roll = mu_roll;
  s.dt = 0.02 * std::sqrt(mass(s, r) / k);
  return s;
}

class RollingOnFloor : public OnEveryBackend {};

// What moves stops. With v = l omega the couple takes all the energy: m v0^2 (1 + 0.4 r^2/l^2)/2 = C (s/l -
// yield/2), where C = r mu_roll m g is the couple, s the way and yield = C/(r^2 k_roll) what turns before it
// yields. From then on the grain rocks by as much.
TEST_P(RollingOnFloor, StopsAfterItsWay) {
  const auto engine = make();
  for (const double mu_roll : {0.05, 0.2}) {
    Scene s = on_floor(1e6, 0.6, mu_roll);
    const double weight = mass(s, r) * g, sunk = weight / 1e6, l = r - 0.5 * sunk, v0 = 0.1;
    const double couple = r * mu_roll * weight, yield = couple / (r * r * 1e6),
                 inertia = 1 + 0.4 * r * r / (l * l);
    const double way = l * (0.5 * mass(s, r) * v0 * v0 * inertia / couple + 0.5 * yield);
    State start = grains_at_rest({r}, {{0.5, 0.5, r - sunk}});
    const Vec3d along{0.6, 0.8, 0};
    start.v[0] = v0 * along, start.omega[0] = v0 / l * Vec3d{-along.y, along.x, 0};
    const double time = 2 * way / v0;
    const State end = run(*engine, s, start, static_cast<std::int64_t>(1.2 * time / s.dt));
    const Vec3d gone = end.x[0] - start.x[0];
    // The tangential spring, too, is loaded to m a before the grain slows down as it should.
    EXPECT_NEAR(dot(gone, along) / way, 1, 1e-3) << mu_roll;
    EXPECT_NEAR(length(cross(gone, along)), 0, 1e-9 * way);
    EXPECT_LT(length(end.v[0]), 0.02 * v0) << mu_roll;
  }
}

// One that spins about the normal of the floor: resistance to twisting stops it after an angle, with I
// omega^2/2 = C (angle - yield/2), and what rolls does not feel it.
TEST_P(RollingOnFloor, TwistingStopsASpinAboutTheNormal) {
  const auto engine = make();
  Scene s = on_floor(1e6, 0.6, 0);
  for (ContactParameters& p : s.contact) p.k_roll = 0, p.k_twist = 1e6, p.mu_twist = 0.1;
  const double weight = mass(s, r) * g, couple = r * 0.1 * weight, omega = 20;
  State start = grains_at_rest({r}, {{0.5, 0.5, r - weight / 1e6}});
  start.omega[0].z = omega;
  const double angle = 0.5 * inertia(s, r) * omega * omega / couple + 0.5 * couple / (r * r * 1e6);
  const double time = 2 * angle / omega;
  const State end = run(*engine, s, start, static_cast<std::int64_t>(1.2 * time / s.dt));
  EXPECT_NEAR(end.rotation[0].z / angle, 1, 1e-3);
  EXPECT_LT(std::abs(end.omega[0].z), 0.02 * omega);
  EXPECT_EQ(end.x[0], start.x[0]);
}

// On a slope tan(theta) the weight turns the grain about its contact with m g sin(theta) l, the couple holds
// it with r mu_roll m g cos(theta) at most: it stands up to tan(theta) = mu_roll r/l. Beyond, it rolls with a
// = (g sin(theta) - mu_roll g cos(theta) r/l)/(1 + 0.4 r^2/l^2).
struct LetGo {
  double way, acceleration;  // m, m/s2, once the slope has its angle
};
LetGo let_go(Engine& engine, double tangent, double mu_roll, double k) {
  const double theta = std::atan(tangent);
  Scene s = on_floor(k, 1, mu_roll);
  const Vec3d start{0.5, 0.5, r - mass(s, r) * g / k};
  State now = grains_at_rest({r}, {start});
  double before = 0;
  for (int part = 1; part <= 100; ++part) {  // it leans over slowly, lest the grain swings
    const double lean = theta * part / 100;
    s.down = {std::sin(lean), 0, -std::cos(lean)};
    before = now.v[0].x;
    now = run(engine, s, now, part < 100 ? 100 : 10000);
    synchronise(s, now);
  }
  return {now.x[0].x - start.x, (now.v[0].x - before) / (10000 * s.dt)};
}

TEST_P(RollingOnFloor, StandsOnASlopeUpToItsAngle) {
  const auto engine = make();
  const double k = 1e6, weight = mass(on_floor(k, 1, 0), r) * g;
  for (const double mu_roll : {0.05, 0.3}) {
    const auto ratio = [&](double tangent) {  // r/l
      return 1 / (1 - 0.5 * weight / std::hypot(1, tangent) / k / r);
    };
    const double steepest = mu_roll * ratio(mu_roll);
    // What its springs yield.
    EXPECT_LT(std::abs(let_go(*engine, 0.999 * steepest, mu_roll, k).way), 10 * weight / k) << mu_roll;
    for (const double tangent : {1.01 * steepest, 1.5 * steepest}) {
      const double theta = std::atan(tangent), q = ratio(tangent);
      const double a = (g * std::sin(theta) - mu_roll * g * std::cos(theta) * q) / (1 + 0.4 * q * q);
      // Springs without dampers go on rocking a little.
      EXPECT_NEAR(let_go(*engine, tangent, mu_roll, k).acceleration, a, 1e-4 * g * mu_roll) << mu_roll;
    }
  }
}

// Three like spheres: two on the floor, their centres 2 c apart, and one on top. With sin(alpha) = c/(2 r),
// the normal force N and the tangential force T between the upper and a lower one, and P and F at the floor:
//   upper one, upwards:      2 (N cos(alpha) + T sin(alpha)) = m g
//   lower one, upwards:      P = m g + N cos(alpha) + T sin(alpha) = 3/2 m g
//   lower one, sideways:     N sin(alpha) - T cos(alpha) = F
//   lower one, its spin:     F r = T r + C,  C = mu_roll (P r + N r/2) at most (R = r at the floor, r/2
//   between)
// The lower ones roll apart where T would have to be more than mu N. With P = 3 (N cos(alpha) + T
// sin(alpha)):
//   without C:  mu = tan(alpha/2);  else  mu_roll = (sin(alpha) - mu (1 + cos(alpha)))/(3 cos(alpha) + 3 mu
//   sin(alpha) + 1/2)
class StackOfThree : public OnEveryBackend {
 protected:
  // Whether they stand. Weight comes on slowly, and dampers keep what is left of a swing small.
  bool stands(Engine& engine, double alpha, double mu, double mu_roll) const {
    const double k = 1e5, c = 2 * r * std::sin(alpha);
    Scene s = on_floor(k, mu, mu_roll);
    s.with(Material::wall).mu_s = s.with(Material::wall).mu_d = 1;
    for (ContactParameters& p : s.contact) p.gamma_n = p.gamma_t = 0.3 * std::sqrt(k * mass(s, r));
    s.dt = 0.1 * std::sqrt(mass(s, r) / k);
    State now = grains_at_rest(
        {r, r, r}, {{0.5 - c, 0.5, r}, {0.5 + c, 0.5, r}, {0.5, 0.5, r + 2 * r * std::cos(alpha)}});
    for (int part = 1; part <= 50; ++part) {
      s.gravity = part * g / 50;
      now = run(engine, s, now, part < 50 ? 200 : 20000);
      synchronise(s, now);
    }
    return now.x[2].z > r + 1.99 * r * std::cos(alpha);
  }
};

TEST_P(StackOfThree, StandsUpToItsLimit) {
  const auto engine = make();
  const double alpha = std::asin(0.55), sine = std::sin(alpha), cosine = std::cos(alpha);
  const double by_friction = std::tan(0.5 * alpha);
  EXPECT_TRUE(stands(*engine, alpha, 1.02 * by_friction, 0));
  EXPECT_FALSE(stands(*engine, alpha, 0.98 * by_friction, 0));
  for (const double mu : {0.0, 0.1, 0.2}) {
    const double by_rolling = (sine - mu * (1 + cosine)) / (3 * cosine + 3 * mu * sine + 0.5);
    EXPECT_TRUE(stands(*engine, alpha, mu, 1.02 * by_rolling)) << mu;
    EXPECT_FALSE(stands(*engine, alpha, mu, 0.98 * by_rolling)) << mu;
  }
}

ON_EVERY_BACKEND(RollingOnFloor);
ON_EVERY_BACKEND(StackOfThree);

}  // namespace
}  // namespace moraine::dem
