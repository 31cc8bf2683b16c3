// Density scaling by size: a small grain has the inertia of a larger one and its own weight.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double small = 0.002, scaled_to = 0.01;  // m, radii

Scene on_floor() {
  Scene s = empty_space(1e5);
  s.body(BodyId::floor) = floor_at(0);
  s.gravity = 9.81, s.least_inertia = scaled_to;
  for (ContactParameters& p : s.contact) p.k_t = p.mu_s = p.mu_d = 0;
  s.dt = 0.01 * std::sqrt(mass(s, scaled_to) / s.with(Material::wall).k_n);
  return s;
}

class DensityScaling : public OnEveryBackend {};

// m_i x'' = m g - k x from its rest x = m g/k on: it stays.
TEST_P(DensityScaling, LeavesWeightAsItIs) {
  const Scene s = on_floor();
  const double sunk = mass(s, small) * s.gravity / s.with(Material::wall).k_n;
  const auto engine = make();
  const State now = run(*engine, s, grains_at_rest({small}, {Vec3d{0, 0, small - sunk}}), 2000);
  // The acceleration is the difference of two terms of (r/r_s)^3 g, each rounded.
  EXPECT_NEAR(now.x[0].z, small - sunk, 1e-12 * small);
  EXPECT_LT(length(now.v[0]), 1e-12);
}

// Its period is that of the larger grain: m_i x'' = -k x about its rest.
TEST_P(DensityScaling, SwingsAsTheLargerGrain) {
  const Scene s = on_floor();
  const double k = s.with(Material::wall).k_n, sunk = mass(s, small) * s.gravity / k;
  const double period = 2 * std::numbers::pi * std::sqrt(mass(s, scaled_to) / k);
  State start = grains_at_rest({small}, {Vec3d{0, 0, small - sunk - 0.5 * sunk}});
  const auto engine = make();
  const State now = run(*engine, s, start, std::lround(period / s.dt));
  EXPECT_NEAR(now.x[0].z, start.x[0].z, 1e-3 * sunk);  // period/dt rounded: (w dt/2)^2, and that of leapfrog
  engine->load(s, start);
  engine->advance(std::lround(period / s.dt / 2));
  EXPECT_NEAR(engine->state().x[0].z, small - sunk + 0.5 * sunk, 1e-3 * sunk);
}

// The same weight on more inertia.
TEST_P(DensityScaling, FallsSlower) {
  const Scene s = on_floor();
  const auto engine = make();
  const double h = 0.1, g = s.gravity * std::pow(small / scaled_to, 3);
  const int steps = 1000;
  const State now = run(*engine, s, grains_at_rest({small, scaled_to}, {{0, 0, h}, {0.5, 0, h}}), steps);
  const double t = s.dt * steps;
  EXPECT_NEAR(now.x[0].z, h - 0.5 * g * t * t, 1e-12);
  EXPECT_NEAR(now.x[1].z, h - 0.5 * s.gravity * t * t, 1e-12);
}
ON_EVERY_BACKEND(DensityScaling);

// What is no smaller than the scaled radius moves with the same bits as without.
TEST(DensityScalingOfNoGrain, ChangesNothing) {
  Bed bed = sheared_bed();
  const auto engine = make_engine(Backend::cpu, 1);
  const State without = run(*engine, bed.scene, bed.state, 50);
  bed.scene.least_inertia = *std::min_element(bed.state.r.begin(), bed.state.r.end());
  const State with = run(*engine, bed.scene, bed.state, 50);
  for (Index i = 0; i < with.size(); ++i) EXPECT_EQ(with.x[i], without.x[i]);
}

}  // namespace
}  // namespace moraine::dem
