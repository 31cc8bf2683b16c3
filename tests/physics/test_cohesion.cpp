// Constant cohesion c: a grain hangs from a plane or from a grain that is held until it weighs c.
#include "backends.hpp"
#include "dem/law/hertz.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double r = 0.01;

class CohesionHolds : public OnEveryBackend {
 protected:
  // Where the grain is after a while, m below its place at touch; it begins where its weight balances.
  double fallen(Engine& engine, bool hertz, bool from_grain, double weight_over_cohesion) const {
    Scene s = empty_space(0);
    s.gravity = 9.81;
    ContactParameters p;
    const double weight = mass(s, r) * s.gravity, cohesion = weight / weight_over_cohesion;
    p.k_n = hertz ? 0 : 1e4, p.k_t = 0, p.mu_s = p.mu_d = 0, p.cohesion = cohesion;
    if (hertz) p.E_star = young_star(7e7, 0.25, 7e7, 0.25), p.G_star = shear_star(7e7, 0.25, 7e7, 0.25);
    s.contact.fill(p);
    const double radius = from_grain ? 0.5 * r : r, pull = std::max(0.0, cohesion - weight);
    const double overlap =
        hertz ? std::pow(0.75 * pull / (p.E_star * std::sqrt(radius)), 2.0 / 3) : pull / p.k_n;
    s.dt = hertz ? 1e-5 : 0.02 * std::sqrt(mass(s, r) / p.k_n);
    const double top = 0.5, at = top - r + std::max(overlap, 1e-12);
    State start = grains_at_rest({r}, {{0.5, 0.5, at}});
    if (from_grain) {
      start = grains_at_rest({r, r}, {{0.5, 0.5, at}, {0.5, 0.5, top + r}});
      start.part_of[1] = BodyId::bottom_layer, s.body(BodyId::bottom_layer) = layer({}, true);
    } else {
      s.body(BodyId::top_wall) = wall_at_rest(), start.wall_z() = top;
    }
    const State end = run(engine, s, start, 4000);
    EXPECT_NEAR(overlap > 0 ? end.x[0].z : at, at, 1e-6 * overlap);
    return top - r - end.x[0].z;
  }
};

TEST_P(CohesionHolds, UpToItsPullOffForce) {
  const auto engine = make();
  for (const bool hertz : {false, true})
    for (const bool from_grain : {false, true}) {
      EXPECT_LT(fallen(*engine, hertz, from_grain, 0.99), 0) << hertz << from_grain;
      EXPECT_GT(fallen(*engine, hertz, from_grain, 1.01), 1e-5) << hertz << from_grain;
    }
}

ON_EVERY_BACKEND(CohesionHolds);

}  // namespace
}  // namespace moraine::dem
