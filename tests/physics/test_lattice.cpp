// Simple cubic lattice of equal grains between floor and wall. Columns do not touch one another across, so
// each is a chain. A wall twice as stiff as a contact is half a spacing of the same medium.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double r = 0.01, d = 2 * r, k = 1e5;

Scene columns(double wall_stiffness) {
  Scene s;
  s.box = {3 * d, 3 * d, 1};
  s.gravity = 0;
  s.with(Material::grain) = LinearContact{k, k, 0, 0, 0.3, 0.3};
  s.with(Material::wall) = LinearContact{wall_stiffness, 0, 0, 0, 0, 0};
  s.dt = 0.05 * std::sqrt(mass(s, r) / k);
  return s;
}

// 3 x 3 columns of n grains, each contact closed by `overlap`, each wall contact by `at_wall`.
State lattice(int n, double overlap, double at_wall) {
  std::vector<Vec3d> x;
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < 3; ++y)
      for (int c = 0; c < 3; ++c)
        x.push_back({(c + 0.5) * d, (y + 0.5) * d, r - at_wall + z * (d - overlap)});
  State s = grains_at_rest(std::vector<double>(x.size(), r), x);
  s.wall_z() = n * d - (n - 1) * overlap - 2 * at_wall;
  return s;
}
int layer(Index i) { return i / 9; }

class CubicLattice : public OnEveryBackend {};

// Brought to rest under two loads by damping. 1e-9: what the damping leaves.
TEST_P(CubicLattice, ModulusIsStiffnessOverSpacing) {
  const auto engine = make();
  const int n = 5;
  Scene s = columns(2 * k);
  const double m = mass(s, r);
  for (ContactParameters& p : s.contact) p.gamma_n = 1.5 * std::sqrt(k * m);
  double height[2];
  State now = lattice(n, 0, 0);
  for (const int load : {0, 1}) {
    s.body(BodyId::top_wall) = wall_pressed_by(load == 0 ? 1000 : 3000, 9 * m);  // strains of 2e-4, 6e-4
    now = run(*engine, s, now, 12000);
    synchronise(s, now);
    now.step = 0;
    height[load] = now.wall_z();
  }
  const double modulus = 2000 / ((height[0] - height[1]) / (n * d));
  EXPECT_NEAR(modulus / (k / d), 1, 1e-9);
}

// A hump of velocity splits in two. The speed of its centre is that of infinitely long waves, whatever the
// lattice does to its shape; 1e-4 is what the tails of the hump and the step leave.
TEST_P(CubicLattice, CompressionWaveSpeed) {
  const auto engine = make();
  const int n = 280;
  Scene s = columns(k);
  s.body(BodyId::top_wall) = wall_at_rest();
  State start = lattice(n, 1e-4, 1e-4);
  const auto hump = [&](int z) { return std::exp(-0.5 * std::pow((z - 0.5 * (n - 1)) / 8.0, 2)); };
  for (Index i = 0; i < start.size(); ++i) start.v[i].z = 0.01 * hump(layer(i));
  const auto centre = [&](const State& now) {  // of the upper half, m
    double sum = 0, weighted = 0;
    for (Index i = 0; i < now.size(); ++i)
      if (layer(i) >= n / 2) sum += now.v[i].z, weighted += now.v[i].z * start.x[i].z;
    return weighted / sum;
  };
  State now = run(*engine, s, start, 1000);
  const double first = centre(now);
  engine->advance(1000);
  now = engine->state();
  // Each grain is (d - overlap) from the next.
  const double speed = (centre(now) - first) / (1000 * s.dt) * d / (d - 1e-4);
  EXPECT_NEAR(speed / (d * std::sqrt(k / mass(s, r))), 1, 1e-4);
}

// Modes of a chain of n between fixed ends: u_j = sin(q j), q = p pi/(n + 1), frequency 2 sqrt(k/m) sin(q/2).
double mode_frequency(const Scene& s, int n, int p) {
  return 2 * std::sqrt(k / mass(s, r)) * std::sin(0.5 * p * std::numbers::pi / (n + 1));
}
State mode(int n, int p, double amplitude) {
  State s = lattice(n, 1e-4, 1e-4);
  for (Index i = 0; i < s.size(); ++i)
    s.x[i].z += amplitude * std::sin(p * std::numbers::pi / (n + 1) * (layer(i) + 1));
  return s;
}

TEST_P(CubicLattice, Frequencies) {
  const auto engine = make();
  const int n = 12;
  Scene s = columns(k);
  s.body(BodyId::top_wall) = wall_at_rest();
  for (const int p : {1, 2, n}) {
    const double w = mode_frequency(s, n, p);
    s.dt = 2 * std::numbers::pi / (200.25 * w);  // ends beside a turning point, where the phase shows
    const State start = mode(n, p, 2e-5), still = lattice(n, 1e-4, 1e-4);
    const State now = run(*engine, s, start, 50 * 200);
    // Leapfrog runs at w_d: sin(w_d dt/2) = w dt/2.
    const double phase = 10000 * 2 * std::asin(0.5 * w * s.dt);
    for (Index i = 0; i < now.size(); ++i)
      EXPECT_NEAR(now.x[i].z - still.x[i].z, std::cos(phase) * (start.x[i].z - still.x[i].z),
                  1e-9 * 2e-5 * 50);
  }
}

// The largest frequency sets the longest stable step, 2/w_max; for a long chain that is sqrt(m/k).
TEST_P(CubicLattice, CriticalStep) {
  const auto engine = make();
  const int n = 40;
  Scene s = columns(k);
  s.body(BodyId::top_wall) = wall_at_rest();
  const double critical = 2 / mode_frequency(s, n, n);
  EXPECT_NEAR(critical / std::sqrt(mass(s, r) / k), 1, 1e-3);
  const auto growth = [&](double dt) {
    s.dt = dt;
    const State now = run(*engine, s, mode(n, n, 1e-8), 300), still = lattice(n, 1e-4, 1e-4);
    double largest = 0;
    for (Index i = 0; i < now.size(); ++i) largest = std::max(largest, std::abs(now.x[i].z - still.x[i].z));
    return largest / 1e-8;
  };
  EXPECT_LT(growth(0.999 * critical), 2);
  EXPECT_GT(growth(1.001 * critical), 1e3);
}

ON_EVERY_BACKEND(CubicLattice);

}  // namespace
}  // namespace moraine::dem
