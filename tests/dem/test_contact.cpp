// The contact law by itself.
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "dem/body/plane_contact.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

using Smooth = Linear<Frictionless, Undamped>;
using SmoothViscous = Linear<Frictionless, Viscosity>;
using Plain = Linear<Coulomb, Undamped>;
using Softening = Linear<SofteningCoulomb, Undamped>;
using Viscous = Linear<Coulomb, Viscosity>;
constexpr Account energy = Account::energy;
constexpr double k = 1e5, r = 0.01;

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double operator()(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  Vec3d vector(double size) { return {(*this)(-size, size), (*this)(-size, size), (*this)(-size, size)}; }

 private:
  std::mt19937_64 engine_;
};

struct Input {
  Vec3d x;
  double r_i, r_j;
  Motion<double> before;
  Spring<double> spring;
};
Input any_input(Random& random) {
  Input q;
  q.r_i = random(0.008, 0.012), q.r_j = random(0.008, 0.012);
  const Vec3d n = random.vector(1);
  q.x = (random(0.98, 1.005) * (q.r_i + q.r_j) / length(n)) * n;  // one in five is open
  q.before = {random.vector(1), random.vector(100), random.vector(100)};
  if (random(0, 1) < 0.8) q.spring.delta_t = random.vector(1e-4);
  q.spring.slipping = random(0, 1) < 0.5 ? 1 : 0;
  q.spring.a_before = random(0, 3e-3), q.spring.rolled = random.vector(1e-4),
  q.spring.twisted = random(-1, 1) * 1e-4;
  if (random(0, 1) < 0.7) q.spring.v_before = random.vector(1), q.spring.f_viscous = random.vector(k * 1e-4);
  return q;
}

template <class L>
void expect_lanes_equal_doubles(const ContactParameters& law = LinearContact{k, 0.7 * k, 5, 3, 0.5, 0.4}) {
  Random random(11);
  const double dt = 1e-5;
  for (int round = 0; round < 500; ++round) {
    Input q[4];
    for (Input& one : q) one = any_input(random);
    const auto lanes = [&](auto value) { return Pack(value(q[0]), value(q[1]), value(q[2]), value(q[3])); };
    const auto vectors = [&](auto value) {
      return Vec3<Pack>{lanes([&](const Input& i) { return value(i).x; }),
                        lanes([&](const Input& i) { return value(i).y; }),
                        lanes([&](const Input& i) { return value(i).z; })};
    };
    const Motion<Pack> motion{vectors([&](const Input& i) { return i.before.v; }),
                              vectors([&](const Input& i) { return i.before.omega_i; }),
                              vectors([&](const Input& i) { return i.before.omega_j; })};
    const auto g = between_grains<Pack>(vectors([](const Input& i) { return i.x; }),
                                        lanes([](const Input& i) { return i.r_i + i.r_j; }),
                                        lanes([](const Input& i) { return i.r_i - i.r_j; }));
    Spring<Pack> spring;
    for (int l = 0; l < 4; ++l)
      for_each_named(spring, q[l].spring, [l](const char*, auto& to, const auto& from) {
        if constexpr (std::is_same_v<std::remove_cvref_t<decltype(from)>, double>)
          to.v[l] = from;
        else
          to.x.v[l] = from.x, to.y.v[l] = from.y, to.z.v[l] = from.z;
      });
    const Action<Pack> a = contact_law<L, energy>(law, dt, g, motion, spring);

    for (int l = 0; l < 4; ++l) {
      Spring<double> s = q[l].spring;
      const auto g1 = between_grains(q[l].x, q[l].r_i + q[l].r_j, q[l].r_i - q[l].r_j);
      const Action<double> b = contact_law<L, energy>(law, dt, g1, q[l].before, s);
      const auto same = [&](const Pack& lane, double number, const char* what) {
        const double got = lane[l];
        ASSERT_EQ(std::memcmp(&got, &number, 8), 0) << what << ' ' << got << ' ' << number;
      };
      const auto equal = [&](const char* what, const auto& lanes, const auto& number) {
        if constexpr (std::is_same_v<std::remove_cvref_t<decltype(number)>, double>)
          same(lanes, number, what);
        else
          same(lanes.x, number.x, what), same(lanes.y, number.y, what), same(lanes.z, number.z, what);
      };
      equal("f", a.f, b.f), equal("f_x_n", a.f_x_n, b.f_x_n), equal("couple", a.couple, b.couple);
      equal("slip", a.slip, b.slip), equal("viscous", a.viscous, b.viscous);
      for_each_named(spring, s, equal);
    }
  }
}

// Hertz and Mindlin's law with all parts.
ContactParameters everything() {
  ContactParameters p = LinearContact{0, 0, 5, 3, 0.5, 0.4};
  p.E_star = 1e8, p.G_star = 4e7, p.zeta = 0.2, p.density_i = p.density_j = 2600, p.least_inertia = 0.009;
  p.k_roll = 0.5 * k, p.mu_roll = 0.1, p.k_twist = 0.3 * k, p.mu_twist = 0.05, p.cohesion = 3;
  return p;
}

TEST(ContactLaw, LanesOfAPackGiveTheBitsOfDoubles) {
  expect_lanes_equal_doubles<Plain>();
  expect_lanes_equal_doubles<Softening>();
  expect_lanes_equal_doubles<Viscous>();
  expect_lanes_equal_doubles<GeneralLaw>();
  expect_lanes_equal_doubles<GeneralLaw>(everything());
  expect_lanes_equal_doubles<HertzMindlin<Coulomb, Restitution, Rolling>>(everything());
  expect_lanes_equal_doubles<Smooth>();
  expect_lanes_equal_doubles<SmoothViscous>();
}

// Whatever moves: no pull, no more friction than mu_s allows, no force and no memory when open, no negative
// slip.
TEST(ContactLaw, StaysWithinItsLimits) {
  Random random(12);
  const ContactParameters law = LinearContact{k, 0.7 * k, 5, 3, 0.5, 0.4};
  for (int round = 0; round < 20000; ++round) {
    const Input q = any_input(random);
    const auto g = between_grains(q.x, q.r_i + q.r_j, q.r_i - q.r_j);
    Spring<double> s = q.spring;
    const Action<double> a = contact_law<GeneralLaw, energy>(law, 1e-5, g, q.before, s);
    const double f_n = dot(a.f, g.n);
    const Vec3d f_t = a.f - f_n * g.n;
    EXPECT_GE(f_n, -1e-12);
    EXPECT_LE(length(f_t), law.mu_s * std::max(f_n, 0.0) + 1e-12 * k * r);
    EXPECT_NEAR(dot(s.delta_t, g.n), 0, 0.02 * length(s.delta_t) + 1e-18);
    if (g.delta_n < 0) continue;
    EXPECT_EQ(length(a.f), 0);
    EXPECT_EQ(length(s.delta_t), 0);
    EXPECT_EQ(s.slipping, 0);
    EXPECT_EQ(length(s.v_before), 0);
    EXPECT_EQ(length(s.f_viscous), 0);
  }
}

// An open contact that held no spring has nothing to dissipate, exactly: or the ledger would depend on which
// pairs are near.
TEST(ContactLaw, OpenPairsDissipateNothing) {
  Random random(13);
  for (int round = 0; round < 1000; ++round) {
    Input q = any_input(random);
    q.spring = {};
    const auto g = between_grains(1.05 * q.x, q.r_i + q.r_j, q.r_i - q.r_j);
    const ContactParameters law = LinearContact{k, k, 0, 0, 0.5, 0.5};
    const ContactParameters viscous = LinearContact{k, k, 5, 3, 0.5, 0.5};
    ASSERT_EQ((contact_law<Plain, energy>(law, 1e-5, g, q.before, q.spring).slip), 0);
    ASSERT_EQ((contact_law<Viscous, energy>(viscous, 1e-5, g, q.before, q.spring).viscous), 0);
  }
}

// What damping dissipates is the mean of its force before and after the step, times the way of the contact:
// also in the step in which it opens.
TEST(ContactLaw, DampingDissipatesItsMeanForceTimesTheWay) {
  const ContactParameters law = LinearContact{k, 0, 5, 0, 0, 0};
  const double dt = 1e-5, overlap = 1e-4;
  const auto step = [&](double overlap_now, double v, Spring<double>& spring) {
    const auto g = between_grains(Vec3d{0, 0, 2 * r - overlap_now}, 2 * r, 0.0);
    return contact_law<SmoothViscous, energy>(law, dt, g, {{0, 0, v}, {0, 0, 0}, {0, 0, 0}}, spring).viscous;
  };
  Spring<double> spring;
  EXPECT_NEAR(step(overlap, -0.1, spring), 0.5 * dt * (5 * 0.1) * 0.1, 1e-18);  // no force before it closed
  const double foreseen = -0.3 + 0.5 * (-0.3 + 0.1);
  EXPECT_NEAR(step(overlap, -0.3, spring), 0.5 * dt * (5 * 0.1 + 5 * -foreseen) * 0.3, 1e-18);
  EXPECT_NEAR(step(-overlap, 0.2, spring), -0.5 * dt * (5 * -foreseen) * 0.2, 1e-18);
  EXPECT_EQ(step(-overlap, 0.2, spring), 0);
}

// The velocity at the step is exact where a contact is uniformly accelerated; in its first step, and where
// velocities belong to the step already, it is what it is.
TEST(ContactLaw, ForeseesTheVelocity) {
  const Vec3d a{1, -2, 3}, v{0.1, 0.2, -0.3};
  const double dt = 1e-3;
  Spring<double> spring;
  spring.v_before = v;
  const Vec3d next = v + dt * a;
  EXPECT_LT(length(velocity_at_step<Viscous>(dt, next, spring) - (next + 0.5 * dt * a)), 1e-16);
  EXPECT_EQ(velocity_at_step<Viscous>(0, next, spring), next);
  spring.v_before = {};
  EXPECT_EQ(velocity_at_step<Viscous>(dt, next, spring), next);
}

// Two grains held at a constant overlap, one pulled sideways at a constant speed.
template <class L>
std::vector<double> pulled_sideways(const ContactParameters& law, double overlap, double step_length,
                                    int steps) {
  const auto g = between_grains(Vec3d{0, 0, 2 * r - overlap}, 2 * r, 0.0);
  const double dt = 1e-5;
  const Motion<double> m{{step_length / dt, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  Geometry<double> held = g;
  held.curvature = 0;  // no turning: a plane test
  Spring<double> s;
  std::vector<double> f_t;
  for (int step = 0; step < steps; ++step) f_t.push_back(-contact_law<L, energy>(law, dt, held, m, s).f.x);
  return f_t;
}

TEST(ContactLaw, SticksThenSlips) {
  const double overlap = 1e-4, f_n = k * overlap;
  const std::vector<double> f =
      pulled_sideways<Plain>(LinearContact{k, k, 0, 0, 0.3, 0.3}, overlap, 1e-7, 1000);
  for (std::size_t step = 0; step < f.size(); ++step)
    EXPECT_NEAR(f[step], std::min(k * 1e-7 * (step + 1.0), 0.3 * f_n), 1e-12 * f_n);
}

// It holds up to mu_s, then carries mu_d for as long as it slides; once it has stood still it holds up to
// mu_s again.
TEST(ContactLaw, SoftensWhenItSlips) {
  const double overlap = 1e-4, f_n = k * overlap;
  const ContactParameters law = LinearContact{k, k, 0, 0, 0.5, 0.3};
  const std::vector<double> f = pulled_sideways<Softening>(law, overlap, 1e-7, 2000);
  const auto peak = std::max_element(f.begin(), f.end());
  EXPECT_NEAR(*peak, 0.5 * f_n, k * 1e-7);
  for (auto later = peak + 1; later != f.end(); ++later) EXPECT_NEAR(*later, 0.3 * f_n, 1e-12 * f_n);

  auto g = between_grains(Vec3d{0, 0, 2 * r - overlap}, 2 * r, 0.0);
  g.curvature = 0;
  const double dt = 1e-5;
  const auto moving = [](double v) { return Motion<double>{{v, 0, 0}, {0, 0, 0}, {0, 0, 0}}; };
  Spring<double> s;
  const auto pull = [&](double v) { return -contact_law<Softening, energy>(law, dt, g, moving(v), s).f.x; };
  for (int step = 0; step < 1000; ++step) pull(0.01);
  EXPECT_EQ(s.slipping, 1);
  pull(0);
  EXPECT_EQ(s.slipping, 0);
  double again = 0;
  for (int step = 0; step < 1000; ++step) again = std::max(again, pull(0.01));
  EXPECT_NEAR(again, 0.5 * f_n, k * 1e-7);
}

TEST(ContactLaw, ViscousWallWithoutSpring) {
  const double overlap = 1e-4, f_n = k * overlap;
  Scene s;
  s.with(Material::wall) = LinearContact{k, 0, 0, 20, 0.3, 0.3};
  const Plane floor{.id = BodyId::floor};
  for (const double v : {0.01, 0.1, 0.149, 0.151, 1.0}) {
    Spring<double> spring;
    const GrainRow grain{{0, 0, r - overlap}, r, {v, 0, 0}, r, {0, 0, 0}, 0, {}, 0};
    for (int step = 0; step < 100; ++step) {  // the same at every step
      const auto a = plane_action<Viscous, energy>(s, 1e-5, floor, grain, spring);
      EXPECT_NEAR(a.f.x, -std::min(20 * v, 0.3 * f_n), 1e-12 * f_n);
      EXPECT_NEAR(a.f.z, f_n, 1e-12 * f_n);
    }
  }
}

// The same plane from below and from above.
TEST(ContactLaw, TopWallMirrorsTheFloor) {
  Scene s;
  s.with(Material::wall) = LinearContact{k, k, 5, 3, 0.3, 0.3};
  Spring<double> below, above;
  const Plane floor{.id = BodyId::floor}, top{.id = BodyId::top_wall, .facing = -1, .place = 1};
  const Vec3d v{0.1, -0.2, -0.05}, omega{3, 4, 5};
  const GrainRow low{{0, 0, 0.99 * r}, r, v, r, omega, 0, {}, 0};
  const Vec3d v_up{v.x, v.y, -v.z}, omega_up{-omega.x, -omega.y, omega.z};
  const GrainRow high{{0, 0, 1 - 0.99 * r}, r, v_up, r, omega_up, 0, {}, 0};
  const auto a = plane_action<Viscous, energy>(s, 1e-5, floor, low, below);
  const auto b = plane_action<Viscous, energy>(s, 1e-5, top, high, above);
  EXPECT_LT(length(b.f - Vec3d{a.f.x, a.f.y, -a.f.z}), 1e-12 * length(a.f));
}

// A side wall is a floor that stands upright: all turns with it.
TEST(ContactLaw, PlanesAreAlikeAlongEveryAxis) {
  Scene s;
  s.with(Material::wall) = LinearContact{k, k, 5, 3, 0.3, 0.3};
  const Vec3d v{0.1, -0.2, -0.05}, omega{3, 4, 5}, plane_v{0.01, 0.02, 0};
  const auto action = [&](int axis, double facing) {
    const auto turned = [&](const Vec3d& a) {  // from normal z to normal `axis`
      Vec3d out{};
      for (int k = 0; k < 3; ++k) out[(k + axis + 1) % 3] = a[k];
      return out;
    };
    const Plane plane{
        .id = BodyId::x_low, .axis = axis, .facing = facing, .place = 0.5, .v = turned(plane_v)};
    Spring<double> spring;
    spring.delta_t = turned({1e-6, 2e-6, 0});
    const GrainRow grain{
        turned({0.3, 0.4, 0.5 + facing * 0.99 * r}), r, turned(v), r, turned(omega), 0, {}, 0};
    const auto a = plane_action<Viscous, energy>(s, 1e-5, plane, grain, spring);
    const auto back = [&](const Vec3d& b) {
      Vec3d out{};
      for (int k = 0; k < 3; ++k) out[k] = b[(k + axis + 1) % 3];
      return out;
    };
    return std::array{back(a.f), back(a.torque), back(spring.delta_t)};
  };
  for (const double facing : {1.0, -1.0}) {
    const auto level = action(2, facing);
    EXPECT_GT(facing * level[0].z, 0);
    for (const int axis : {0, 1}) {
      const auto upright = action(axis, facing);
      for (int q = 0; q < 3; ++q)
        EXPECT_LT(length(upright[q] - level[q]), 1e-13 * length(level[q])) << axis << ' ' << q;
    }
  }
}

}  // namespace
}  // namespace moraine::dem
