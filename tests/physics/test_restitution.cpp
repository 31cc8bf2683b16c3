// Damping by a coefficient of restitution: what is measured is what was asked for, with both normal laws, on
// a wall, between like grains and between unlike ones.
#include "backends.hpp"
#include "dem/law/hertz.hpp"
#include "dem/law/restitution.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double r1 = 0.01, v0 = 0.5, steps_a_contact = 2000;

class RestitutionAskedFor : public OnEveryBackend {
 protected:
  // One collision at v0 along an oblique normal; r2 = 0: on the floor.
  double measured(Engine& engine, bool hertz, double r2, double e, int steps) const {
    Scene s = empty_space(0);
    ContactParameters p;
    p.k_n = hertz ? 0 : 1e5, p.k_t = 0, p.mu_s = p.mu_d = 0;
    if (hertz) p.E_star = young_star(7e8, 0.25, 7e8, 0.25), p.G_star = shear_star(7e8, 0.25, 7e8, 0.25);
    p.zeta = damping_ratio(e), p.density_i = p.density_j = s.density[0];
    s.contact.fill(p);
    const double m1 = mass(s, r1), m = r2 > 0 ? m1 * mass(s, r2) / (m1 + mass(s, r2)) : m1;
    const double radius = r2 > 0 ? r1 * r2 / (r1 + r2) : r1;
    const double overlap = std::pow(15 * m * v0 * v0 / (16 * p.E_star * std::sqrt(radius)), 0.4);
    // Without damping a contact lasts 2.94 overlap/v0, or half a swing of the spring.
    s.dt = (hertz ? 2.94 * overlap / v0 : std::numbers::pi * std::sqrt(m / p.k_n)) / steps;
    const double gap = 0.5 * v0 * s.dt;
    const auto far =
        static_cast<std::int64_t>(8 * steps);  // the slowest leaves long after its force has ended
    if (r2 == 0) {
      s.body(BodyId::floor) = floor_at(0);
      State start = grains_at_rest({r1}, {{0.5, 0.5, r1 + gap}});
      start.v[0].z = -v0;
      return run(engine, s, start, far).v[0].z / v0;
    }
    const Vec3d n{1.0 / 3, 2.0 / 3, 2.0 / 3}, at{0.4, 0.4, 0.4};
    State start = grains_at_rest({r1, r2}, {at, at + (r1 + r2 + gap) * n});
    start.v[0] = v0 * n;
    const State end = run(engine, s, start, far);
    const double momentum = m1 * dot(end.v[0], n) + mass(s, r2) * dot(end.v[1], n);
    EXPECT_NEAR(momentum / (m1 * v0), 1, 1e-12);
    return dot(end.v[1] - end.v[0], n) / v0;
  }
};

TEST_P(RestitutionAskedFor, IsMeasured) {
  const auto engine = make();
  for (const bool hertz : {false, true})
    for (const double r2 : {0.0, r1, 1.7 * r1, 0.3 * r1})
      for (const double e : {0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0})
        EXPECT_NEAR(measured(*engine, hertz, r2, e, steps_a_contact), e, 1e-5)
            << (hertz ? "hertz" : "linear") << ", r2 = " << r2 << " m, e = " << e;
}

ON_EVERY_BACKEND(RestitutionAskedFor);

}  // namespace
}  // namespace moraine::dem
