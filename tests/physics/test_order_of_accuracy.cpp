// Second order in the time step while no contact opens, closes or slips.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

class OrderOfAccuracy : public OnEveryBackend {};

// Two grains pressed into one another by a few per cent, moving obliquely, spinning about all axes.
TEST_P(OrderOfAccuracy, ObliqueContact) {
  const auto engine = make();
  for (const double gamma : {0.0, 3.0}) {
    Scene s = empty_space(1e5);
    s.with(Material::grain) = LinearContact{1e5, 6e4, gamma, 0.5 * gamma, 100, 100};
    const double r1 = 0.01, r2 = 0.013,
                 w = std::sqrt(s.with(Material::grain).k_n * (1 / mass(s, r1) + 1 / mass(s, r2)));
    State start =
        grains_at_rest({r1, r2}, {Vec3d{0, 0, 0}, 0.97 * (r1 + r2) * Vec3d{1.0 / 3, 2.0 / 3, 2.0 / 3}});
    const double v = 0.02 * r1 * w;
    start.v[0] = v * Vec3d{1.0, -0.3, 0.9}, start.v[1] = v * Vec3d{0.2, -0.7, 0.1};
    start.omega[0] = v / r1 * Vec3d{1, 2, -3}, start.omega[1] = v / r1 * Vec3d{0.5, -2, 1.5};
    const double end = 1.2 / w;  // it opens later
    const auto at_end = [&](int steps) {
      s.dt = end / steps;
      State now = run(*engine, s, start, steps);
      EXPECT_EQ(now.contacts.size(), 1u);
      EXPECT_EQ(now.ledger.slip, 0);
      synchronise(s, now);
      return now;
    };
    const State exact = at_end(51200);
    std::vector<double> dt, error[4];
    for (const int steps : {25, 50, 100, 200, 400}) {
      const State now = at_end(steps);
      dt.push_back(s.dt);
      const auto off = [&](const std::vector<Vec3d> State::*q) {
        return length((now.*q)[0] - (exact.*q)[0]) + length((now.*q)[1] - (exact.*q)[1]);
      };
      error[0].push_back(off(&State::x)), error[1].push_back(off(&State::v));
      error[2].push_back(off(&State::omega)), error[3].push_back(off(&State::rotation));
    }
    for (const auto& e : error)
      for (const double slope : orders(dt, e)) EXPECT_NEAR(slope, 2, 0.1) << "gamma = " << gamma;
  }
}

ON_EVERY_BACKEND(OrderOfAccuracy);

}  // namespace
}  // namespace moraine::dem
