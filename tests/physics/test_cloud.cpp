// Clouds of grains of one size or so, and of sizes 1:20, against a search of all pairs.
#include "backends.hpp"
#include "dem/grain.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

class Cloud : public OnEveryBackend {};

TEST_P(Cloud, ContactsAndForcesOfAllPairs) {
  const auto engine = make();
  Bed beds[] = {cloud(190, 0.13, 5), cloud(22, 0.065, 5),  // less than three cells wide
                graded_cloud(true, 5), graded_cloud(false, 6)};
  for (Bed& bed : beds) {
    SCOPED_TRACE(&bed - beds);
    const bool large = bed.state.size() > 1000;
    Scene& s = bed.scene;
    s.with(Material::grain).gamma_n = s.with(Material::grain).gamma_t = 2;
    const Sides sides = Sides::of(s);
    std::size_t most = 0;
    engine->load(s, bed.state);
    for (int k = 0; k < (large ? 3 : 10); ++k) {
      if (k > 0) engine->advance(large ? 100 : 40);
      const State now = engine->state();
      std::vector<std::pair<Index, Index>> pairs, found;
      std::vector<Vec3d> force(now.size(), Vec3d{0, 0, 0});
      double largest = 0;
      for (Index i = 0; i < now.size(); ++i)
        for (Index j = i + 1; j < now.size(); ++j)
          if (length(nearest_image(sides, now.x[i] - now.x[j])) < now.r[i] + now.r[j])
            pairs.push_back({i, j});
      for (const Contact& c : now.contacts) found.push_back({c.i, c.j});
      EXPECT_EQ(found, pairs);
      if (k == 0) {  // springs are unstrained yet, velocities known at this very step
        for (const auto& [i, j] : pairs) {
          const Vec3d x = nearest_image(sides, now.x[i] - now.x[j]);
          const auto g = between_grains(x, now.r[i] + now.r[j], now.r[i] - now.r[j]);
          const State& at = bed.state;
          const Motion<double> motion{at.v[i] - at.v[j], at.omega[i], at.omega[j]};
          Spring<double> spring;
          const auto a = contact_law<Linear<Coulomb, Viscosity>, Account::energy>(s.with(Material::grain), 0,
                                                                                  g, motion, spring);
          force[i] += a.f, force[j] -= a.f;
          largest = std::max(largest, length(a.f));
        }
        for (Index i = 0; i < now.size(); ++i) EXPECT_LT(length(now.force[i] - force[i]), 1e-13 * largest);
      }
      most = std::max(most, pairs.size());
    }
    EXPECT_GT(most, large ? 800u : 5u);
  }
}

// The forces of later steps, springs included, add up from the springs that the state shows.
TEST_P(Cloud, ForcesAddUpFromContacts) {
  const auto engine = make();
  for (const Bed& bed : {cloud(190, 0.13, 6), graded_cloud(true, 7)}) {
    const State now = run(*engine, bed.scene, bed.state, bed.state.size() > 1000 ? 100 : 400);
    std::vector<Vec3d> force(now.size(), Vec3d{0, 0, 0});
    double largest = 0;
    for (const ContactForce& c : contact_forces(bed.scene, now)) {
      force[c.i] += c.f_n + c.f_t, force[c.j] -= c.f_n + c.f_t;
      largest = std::max(largest, length(c.f_n));
    }
    for (Index i = 0; i < now.size(); ++i) ASSERT_LT(length(now.force[i] - force[i]), 1e-12 * largest);
  }
}

ON_EVERY_BACKEND(Cloud);

}  // namespace
}  // namespace moraine::dem
