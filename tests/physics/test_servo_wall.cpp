// The wall that keeps a stress, on elastic columns. Each is a chain of n grains (mass m) on the floor with
// half a grain's mass of wall on top, all springs k: its modes are u_j = sin(q j), q = (p - 1/2) pi/(n + 1),
// w = 2 sqrt(k/m) sin(q/2).
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

class ServoWall : public OnEveryBackend {};

TEST_P(ServoWall, SwingsAtItsFrequencyAroundItsStress) {
  const auto engine = make();
  const double r = 0.01, d = 2 * r, k = 1e5;
  const int n = 10, columns = 9;
  Scene s;
  s.box = {3 * d, 3 * d, 1};
  s.gravity = 0;
  s.contact.fill(LinearContact{k, k, 0, 0, 0.3, 0.3});
  const double m = mass(s, r), q = 0.5 * std::numbers::pi / (n + 1),
               w = 2 * std::sqrt(k / m) * std::sin(0.5 * q);
  const double stress = 5000;  // Pa
  s.body(BodyId::top_wall) = wall_pressed_by(stress, columns * 0.5 * m);
  const int per_period = 1000, periods = 5;
  s.dt = 2 * std::numbers::pi / (w * per_period);
  const double squeeze = stress * s.area() / columns / k, amplitude = 0.3 * squeeze;

  std::vector<Vec3d> x;
  for (int z = 0; z < n; ++z)
    for (int c = 0; c < columns; ++c)
      x.push_back({(c % 3 + 0.5) * d, (c / 3 + 0.5) * d,
                   r - squeeze + z * (d - squeeze) + amplitude * std::sin(q * (z + 1))});
  State start = grains_at_rest(std::vector<double>(x.size(), r), x);
  const double rest = n * d - (n + 1) * squeeze;
  start.wall_z() = rest + amplitude;  // sin(q (n + 1)) = 1

  engine->load(s, start);
  double sum = 0, crossing = 0, z_before = start.wall_z();
  int crossings = 0;
  for (int step = 1; step <= periods * per_period; ++step) {
    engine->advance(1);
    const State now = engine->state();
    sum += now.at(BodyId::top_wall).force.z;
    if (z_before > rest && now.wall_z() <= rest) {
      ++crossings;
      crossing = (step - 1 + (z_before - rest) / (z_before - now.wall_z())) * s.dt;
    }
    z_before = now.wall_z();
  }
  // From the turning point to the last crossing: periods - 3/4. Leapfrog and interpolation: (w dt)^2/24
  // = 1.6e-6.
  ASSERT_EQ(crossings, periods);
  EXPECT_NEAR((periods - 0.75) * 2 * std::numbers::pi / (w * crossing), 1, 2e-6);
  // The wall ends where it began, so all momentum it took was the load's.
  EXPECT_NEAR(sum / (periods * per_period) / (stress * s.area()), 1, 1e-6);
}

// A layer of two grains with nothing in its way: a stress T along x gives them, and the mass M that rests on
// them, the same acceleration T A/(2 m + M), and its work is their kinetic energy.
TEST_P(ServoWall, AStressMovesALayerAndTheMassOnIt) {
  const auto engine = make();
  Scene s = empty_space(1e5);
  s.periodic_x = true;
  s.dt = 1e-3;
  const double r = 0.01, heavy = 0.7, stress = 0.2;
  drive_top_layer(s, Drive::by(stress), true);
  State start = grains_at_rest({r, r}, {{0.3, 0.3, 0.5}, {0.7, 0.7, 0.5}});
  start.part_of = {BodyId::top_layer, BodyId::top_layer};
  for (const double on_top : {0.0, heavy}) {
    s.body(BodyId::top_layer).mass = on_top;
    const State now = run(*engine, s, start, 100);
    const double a = stress * s.area() / (2 * mass(s, r) + on_top), t = 100 * s.dt;
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(now.x[i].x - start.x[i].x, 0.5 * a * t * t, 1e-12 * a);
      EXPECT_NEAR(now.v[i].x, a * (t - 0.5 * s.dt), 1e-12 * a);  // staggered
    }
    // Kinetic energies are 1/2 m v(n - 1/2).v(n + 1/2).
    const double squared = a * a * (t * t - 0.25 * s.dt * s.dt);
    const Energy e = observe(s, now).energy;
    EXPECT_NEAR(e.wall_kinetic, 0.5 * on_top * squared, 1e-12 * squared);
    EXPECT_NEAR(e.total(), 0.5 * (2 * mass(s, r) + on_top) * squared, 1e-12 * squared);
    EXPECT_NEAR(now.ledger.layers, stress * s.area() * 0.5 * a * t * t, 1e-12);
  }
}

// On a bed of grains at random, with damping, it comes to rest where the grains bear its load.
TEST_P(ServoWall, RestsOnABedAtItsStress) {
  const auto engine = make();
  Bed bed = settled_bed();
  Scene& s = bed.scene;
  for (Index i = 0; i < bed.state.size(); ++i)
    bed.state.wall_z() = std::max(bed.state.wall_z(), bed.state.x[i].z + bed.state.r[i]);
  const double stress = 2000;  // Pa
  s.body(BodyId::top_wall) = wall_pressed_by(stress, 0.1);
  engine->load(s, bed.state);
  engine->advance(15000);
  double sum = 0;
  const int samples = 100;
  for (int k = 0; k < samples; ++k) {
    engine->advance(10);
    sum += engine->state().at(BodyId::top_wall).force.z;
  }
  EXPECT_NEAR(sum / samples / (stress * s.area()), 1, 1e-4);
}

ON_EVERY_BACKEND(ServoWall);

}  // namespace
}  // namespace moraine::dem
