// Contact networks with known spectra, and what a run does on either side of the critical step.
#include "dem/spectrum.hpp"

#include <gtest/gtest.h>

#include "error.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double r = 0.01, d = 2 * r, k = 1e5, overlap = 1e-5;
constexpr double pi = std::numbers::pi;

// Between the floor and a wall that stands still unless told otherwise; one column wide.
Scene column() {
  Scene s;
  s.box = {10 * d, 10 * d, 1};
  s.gravity = 0;
  s.contact.fill(LinearContact{k, k, 0, 0, 0, 0});
  s.body(BodyId::top_wall) = wall_at_rest();
  return s;
}
State stack(int n, double closed = overlap) {
  std::vector<Vec3d> x;
  for (int i = 0; i < n; ++i) x.push_back({d, d, r - closed + i * (d - closed)});
  State s = grains_at_rest(std::vector<double>(x.size(), r), x);
  s.wall_z() = n * d - (n + 1) * closed;
  return s;
}
void stick(Scene& s) {
  for (ContactParameters& p : s.contact) p.mu_s = p.mu_d = 1e6;
}

// With the contacts that the engine finds.
State touching(Scene s, const State& start) {
  if (!(s.dt > 0)) s.dt = 1e-9;
  return run(*make_engine(Backend::cpu, 1), s, start, 0);
}
double stiffness(const Scene& s, const State& start) { return spectrum(s, touching(s, start)).stiffness; }

// From above, by the residual's 1 % at most.
void expect_just_above(double found, double exact) {
  EXPECT_GE(found, exact * (1 - 1e-9));
  EXPECT_LE(found, exact * 1.01);
}

// u_j = sin(q j), q = n pi/(n + 1).
TEST(Spectrum, ChainBetweenFixedEnds) {
  const Scene s = column();
  for (const int n : {1, 2, 7, 40})
    expect_just_above(stiffness(s, stack(n)),
                      4 * k / mass(s, r) * std::pow(std::sin(0.5 * n * pi / (n + 1)), 2));
}

// u_j = cos(q (j - 1/2)), q = (n - 1) pi/n.
TEST(Spectrum, ChainWithFreeEnds) {
  Scene s = column();
  s.body(BodyId::floor) = s.body(BodyId::top_wall) = {};
  for (const int n : {2, 7, 40})
    expect_just_above(stiffness(s, stack(n)),
                      4 * k / mass(s, r) * std::pow(std::sin(0.5 * (n - 1) * pi / n), 2));
}

// A ring through the periodic sides: u_j = (-1)^j for an even number, q = pi (n - 1)/n for an odd one.
TEST(Spectrum, PeriodicChain) {
  Scene s = empty_space(k);
  s.with(Material::grain).mu_s = s.with(Material::grain).mu_d = 0;
  s.periodic_x = true;
  for (const int n : {8, 9}) {
    s.box.x = n * (d - overlap);
    std::vector<Vec3d> x;
    for (int i = 0; i < n; ++i) x.push_back({i * (d - overlap), 0, 0});
    const double q = n % 2 ? pi * (n - 1) / n : pi;
    expect_just_above(stiffness(s, grains_at_rest(std::vector<double>(x.size(), r), x)),
                      4 * k / mass(s, r) * std::pow(std::sin(0.5 * q), 2));
  }
}

// One spring between two masses; sticking, the contact point moves by l^2/I for either as well.
TEST(Spectrum, TwoGrainsOfUnequalMass) {
  Scene s = empty_space(k);
  s.with(Material::grain).k_t = 0.9 * k;
  const double r1 = 0.01, r2 = 0.025, distance = r1 + r2 - overlap;
  const State pair = grains_at_rest({r1, r2}, {{0, 0, 0}, {0.6 * distance, 0, 0.8 * distance}});
  const double normal = 1 / mass(s, r1) + 1 / mass(s, r2);
  const double l1 = r1 - 0.5 * overlap, l2 = r2 - 0.5 * overlap;
  expect_just_above(stiffness(s, pair),
                    0.9 * k * (normal + l1 * l1 / inertia(s, r1) + l2 * l2 / inertia(s, r2)));
  s.with(Material::grain).mu_s = s.with(Material::grain).mu_d = 0;
  expect_just_above(stiffness(s, pair), k * normal);
}

// Simple cubic, periodic all round, sticking: where all grains spin alike, every contact across the axis
// slips by 2 l omega, so the moment on a grain is 4 contacts x 2 l^2 k_t. That is 20 k_t/m; grains that
// alternate along all three axes have 4 (k_n + 2 k_t)/m = 12 k/m.
TEST(Spectrum, CubicLatticeWithRotations) {
  const int n = 4;
  Scene s = empty_space(k);
  s.with(Material::grain).mu_s = s.with(Material::grain).mu_d = 0.5;
  const double spacing = d - overlap;
  s.box = {n * spacing, n * spacing, n * spacing};
  s.periodic_x = s.periodic_y = s.periodic_z = true;
  std::vector<Vec3d> x;
  for (int i = 0; i < n * n * n; ++i)
    x.push_back({i % n * spacing, i / n % n * spacing, i / (n * n) * spacing});
  const State lattice = grains_at_rest(std::vector<double>(x.size(), r), x);
  expect_just_above(stiffness(s, lattice), 8 * k * std::pow(0.5 * spacing, 2) / inertia(s, r));
  s.with(Material::grain).mu_s = s.with(Material::grain).mu_d = 0;
  expect_just_above(stiffness(s, lattice), 4 * k / mass(s, r));
}

// Grain on the floor under a wall of mass M: m u'' = -2 k u + k w, M w'' = k u - k w.
TEST(Spectrum, WallWithMass) {
  Scene s = column();
  const double m = mass(s, r);
  for (const double M : {0.01 * m, m, 100 * m}) {
    s.body(BodyId::top_wall) = wall_pressed_by(0, M);
    const double trace = 2 * k / m + k / M, determinant = k * k / (m * M);
    expect_just_above(stiffness(s, stack(1)), 0.5 * (trace + std::sqrt(trace * trace - 4 * determinant)));
  }
}

// Two held layers and a free grain between them, sticking. The top one, driven by stress, has its mass along
// x and keeps its height; the free grain's spin and both displacements along x make a matrix of three.
// a = l^2 k/I, b = l k/sqrt(m I), c = k/m: (u, omega, layer) = ((2c, 0, -c), (0, 2a, -b), (-c, -b, c)).
TEST(Spectrum, LayerDrivenByStress) {
  Scene s = column();
  stick(s);
  s.body(BodyId::floor) = s.body(BodyId::top_wall) = {};
  drive_top_layer(s, Drive::by(100), true);
  State three = stack(3);
  three.part_of = {BodyId::bottom_layer, BodyId::none, BodyId::top_layer};
  const double l = r - 0.5 * overlap, a = l * l * k / inertia(s, r), c = k / mass(s, r), b = std::sqrt(a * c);
  // Newton on the cubic from above its largest root.
  double root = 4 * (a + c);
  for (int i = 0; i < 100; ++i) {
    const double p = (2 * c - root) * ((2 * a - root) * (c - root) - b * b) - c * c * (2 * a - root);
    const double h = 1e-6 * root, q = root + h;
    const double p_h = (2 * c - q) * ((2 * a - q) * (c - q) - b * b) - c * c * (2 * a - q);
    root -= p * h / (p_h - p);
  }
  expect_just_above(stiffness(s, three), root);
}

TEST(Spectrum, SameStateSameBits) {
  const Bed bed = sheared_bed();
  const State s = touching(bed.scene, bed.state);
  EXPECT_EQ(spectrum(bed.scene, s).stiffness, spectrum(bed.scene, s).stiffness);
  EXPECT_EQ(critical_step(spectrum(bed.scene, s)), critical_step(spectrum(bed.scene, s)));
}

TEST(Spectrum, NoContactsNoLimit) {
  const Scene s = empty_space(k);
  const State two = grains_at_rest({r, r}, {{0, 0, 0}, {3 * r, 0, 0}});
  EXPECT_EQ(critical_step(spectrum(s, two)), std::numeric_limits<double>::infinity());
  EXPECT_DOUBLE_EQ(one_contact_step(s, two), 2 / std::sqrt(7 * k / mass(s, r)));
}

// How much a small jolt grows in 1500 steps of so many critical ones: long, because damped modes grow slowly
// just beyond the limit; small, so that no contact opens before; and along the stack only where grains do not
// stick, for a pressed stack without friction buckles at any step.
double growth(Scene s, double share) {
  State start = stack(6, 1e-6);
  s.dt = share * critical_step(spectrum(s, touching(s, start)));
  const double jolt = 1e-14 / s.dt, sideways = s.with(Material::grain).mu_s > 0 ? 0.3 * jolt : 0;
  for (int i = 0; i < 6; ++i) {
    const double sign = i % 2 ? -1 : 1;
    start.v[i] = {sign * sideways, 0, sign * jolt};
    start.omega[i] = {0, sideways > 0 ? jolt / r : 0, 0};
  }
  State now;
  try {
    now = run(*make_engine(Backend::cpu, 1), s, start, 1500);
  } catch (const Error&) {  // a grain was lost
    return std::numeric_limits<double>::infinity();
  }
  double largest = 0;
  for (int i = 0; i < 6; ++i)
    largest = std::max({largest, length(now.v[i]) / jolt, r * length(now.omega[i]) / jolt});
  return largest;
}

// The estimate is at most 1 % of w^2, 0.5 % of dt_c, on the safe side, so 1.02 is beyond the limit itself.
TEST(CriticalStep, OneHoldsTheOtherBlowsUp) {
  Scene s = column();
  EXPECT_LT(growth(s, 0.98), 20);
  EXPECT_GT(growth(s, 1.02), 1e3);
  stick(s);
  EXPECT_LT(growth(s, 0.98), 20);
  EXPECT_GT(growth(s, 1.02), 1e3);
}

// Damping shortens the stable step of an explicit scheme. The ratio gamma/k is one for all, so the bound is
// exact; where it is not, it stays on the safe side.
TEST(CriticalStep, Damped) {
  Scene s = column();
  for (const double damping : {0.1, 1.0, 5.0}) {
    const double gamma = damping * std::sqrt(k * mass(s, r));
    s.contact.fill(LinearContact{k, k, gamma, gamma, 0, 0});
    EXPECT_LT(growth(s, 0.98), 20) << damping;
    EXPECT_GT(growth(s, 1.02), 1e3) << damping;
    stick(s);
    EXPECT_LT(growth(s, 0.98), 20) << damping;
    EXPECT_GT(growth(s, 1.02), 1e3) << damping;
    for (ContactParameters& p : s.contact) p.gamma_t = 0;
    EXPECT_LT(growth(s, 0.98), 20) << damping;
  }
}

// A stack that swings under a load that swings, with a new step in the middle: second order, and the time of
// the load goes on where it was.
TEST(ChangeStep, IsSecondOrder) {
  Scene s = column();
  s.body(BodyId::top_wall) = wall_pressed_by(k * overlap / s.area(), 6 * mass(s, r));
  Drive& load = s.body(BodyId::top_wall).z;
  load.amplitude = 0.3 * load.mean, load.frequency = 200;
  const double end = 8e-3;
  const auto height = [&](int steps) {
    const auto engine = make_engine(Backend::cpu, 1);
    Scene now = s;
    now.dt = 0.5 * end / steps;
    State state = run(*engine, now, stack(6), steps);
    change_step(now, state, 0.5 * end / (3 * steps));
    EXPECT_DOUBLE_EQ(now.time(state.step), 0.5 * end);
    state = run(*engine, now, state, 3 * steps);
    EXPECT_NEAR(now.time(state.step), end, 1e-15);
    return state.wall_z();
  };
  std::vector<double> step, error;
  const double exact = height(64000);
  for (const int steps : {500, 1000, 2000})
    step.push_back(1.0 / steps), error.push_back(std::abs(height(steps) - exact));
  for (const double slope : orders(step, error)) EXPECT_NEAR(slope, 2, 0.1);
}

}  // namespace
}  // namespace moraine::dem
