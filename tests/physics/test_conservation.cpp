// What a closed system keeps.
#include "backends.hpp"
#include "dem/grain.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

// Six grains that touch and press on towards the origin, with spin.
State swarm() {
  std::mt19937_64 random(7);
  const auto uniform = [&] { return 2 * (static_cast<double>(random() >> 11) * 0x1p-53) - 1; };
  State s = grains_at_rest({0.01, 0.008, 0.012, 0.009, 0.011, 0.01}, {{0.0138, 0, 0},
                                                                      {-0.0138, 0.002, 0},
                                                                      {0, 0.0138, 0.001},
                                                                      {0.001, -0.0138, 0},
                                                                      {0, 0, 0.0138},
                                                                      {0, 0, -0.0138}});
  for (Index i = 0; i < s.size(); ++i) {
    s.v[i] = -10.0 * s.x[i] + 0.1 * Vec3d{uniform(), uniform(), uniform()};
    s.omega[i] = 20.0 * Vec3d{uniform(), uniform(), uniform()};
  }
  return s;
}

Scene periodic_box(double damping) {
  Scene s = empty_space(1e5);
  s.box = {0.2, 0.25, 0.3};
  s.periodic_x = s.periodic_y = s.periodic_z = true;
  s.with(Material::grain).gamma_n = s.with(Material::grain).gamma_t = damping;
  s.with(Material::grain).mu_s = 0.5;
  s.dt = 0.05 * std::sqrt(mass(s, 0.008) / 1e5);
  return s;
}

State moved(const Scene& scene, State s, const Vec3d& shift) {
  for (Vec3d& x : s.x)
    for (int a = 0; a < 3; ++a) {
      x[a] += shift[a];
      x[a] -= scene.box[a] * std::floor(x[a] / scene.box[a]);
    }
  s.x_start = s.x;
  return s;
}

// Nearest image of where grain i stands, as seen from a point.
Vec3d seen_from(const Scene& scene, const Vec3d& point, const Vec3d& x) {
  return nearest_image(Sides::of(scene), x - point);
}

class Conservation : public OnEveryBackend {};

// Momenta of x(n) and v(n-1/2): leapfrog keeps both exactly.
TEST_P(Conservation, MomentumAndAngularMomentum) {
  const auto engine = make();
  for (const double damping : {0.0, 5.0})
    for (const Vec3d& centre :
         {Vec3d{0.1, 0.12, 0.15}, Vec3d{0, 0, 0}}) {  // inside the box, across all its sides
      const Scene s = periodic_box(damping);
      struct Sums {
        Vec3d p{0, 0, 0}, l{0, 0, 0};
        double p_scale = 0, l_scale = 0;
      };
      const auto sums = [&](const State& state) {
        Sums sum;
        for (Index i = 0; i < state.size(); ++i) {
          const Vec3d x = seen_from(s, centre, state.x[i]), p = mass(s, state.r[i]) * state.v[i];
          const Vec3d orbital = cross(x, p), spin = inertia(s, state.r[i]) * state.omega[i];
          sum.p += p, sum.l += orbital + spin;
          sum.p_scale += length(p), sum.l_scale += length(x) * length(p) + length(spin);
        }
        return sum;
      };
      engine->load(s, moved(s, swarm(), centre));
      const Sums start = sums(engine->state());
      std::size_t most_contacts = 0;
      for (int k = 0; k < 100; ++k) {
        engine->advance(10);
        const State now = engine->state();
        most_contacts = std::max(most_contacts, now.contacts.size());
        const Sums at = sums(now);
        EXPECT_LT(length(at.p - start.p), 1e-12 * at.p_scale);
        EXPECT_LT(length(at.l - start.l), 1e-12 * at.l_scale);
      }
      EXPECT_GT(most_contacts, 3u);
    }
}

// Shifted and wrapped, the differences between positions are rounded differently, by 1e-16 of the box; some
// collisions later the trajectories must still agree to 1e-10 of a radius.
TEST_P(Conservation, ShiftedSceneTakesTheSameCourse) {
  const auto engine = make();
  const Scene s = periodic_box(0);
  const Vec3d centre{0.1, 0.125, 0.15};
  const State plain = run(*engine, s, moved(s, swarm(), centre), 800);
  for (const Vec3d& part : {Vec3d{0.37, 0, 0}, Vec3d{0.5, 0.5, 0.5}, Vec3d{0.45, 0.61, 0.83}}) {
    const Vec3d shift{part.x * s.box.x, part.y * s.box.y, part.z * s.box.z};
    const State other = run(*engine, s, moved(s, swarm(), centre + shift), 800);
    for (Index i = 0; i < plain.size(); ++i) {
      EXPECT_LT(length(seen_from(s, plain.x[i] + shift, other.x[i])), 1e-10 * plain.r[i]);
      EXPECT_LT(length(other.v[i] - plain.v[i]), 1e-10);
      EXPECT_LT(length(other.omega[i] - plain.omega[i]) * plain.r[i], 1e-10);
    }
  }
}

ON_EVERY_BACKEND(Conservation);

}  // namespace
}  // namespace moraine::dem
