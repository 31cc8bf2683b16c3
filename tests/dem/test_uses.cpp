// What a scene does not use is not compiled into its loop, and so costs nothing.
#include "dem/uses.hpp"

#include <gtest/gtest.h>

#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

Scene with(const LinearContact& grain, const LinearContact& wall = {1e7, 0, 0, 0, 0, 0}) {
  Scene s;
  s.with(Material::grain) = grain, s.with(Material::wall) = wall;
  return s;
}
Uses of(const LinearContact& grain, const LinearContact& wall = {1e7, 0, 0, 0, 0, 0}) {
  return uses_of(with(grain, wall));
}

TEST(Uses, FrictionTakesBothMuAndATangentialForce) {
  EXPECT_TRUE(of({1e7, 1e7, 0, 0, 0.5, 0.5}).grains.friction);
  EXPECT_FALSE(of({1e7, 1e7, 0, 0, 0, 0}).grains.friction);
  EXPECT_FALSE(of({1e7, 0, 0, 0, 0.5, 0.5}).grains.friction);
  EXPECT_TRUE(of({1e7, 0, 0, 5, 0.5, 0.5}).grains.friction);
  EXPECT_TRUE(of({1e7, 1e7, 0, 0, 0, 0}, {1e7, 1e7, 0, 0, 0.5, 0.5}).planes.friction);
}

TEST(Uses, DampingTakesAViscosity) {
  EXPECT_FALSE(of({1e7, 1e7, 0, 0, 0.5, 0.5}).grains.damping);
  EXPECT_TRUE(of({1e7, 1e7, 5, 0, 0.5, 0.5}).grains.damping);
  EXPECT_TRUE(of({1e7, 1e7, 0, 5, 0.5, 0.5}).grains.damping);
}

TEST(Uses, SofteningTakesASmallerDynamicFriction) {
  EXPECT_FALSE(of({1e7, 1e7, 0, 0, 0.5, 0.5}).grains.softening);
  EXPECT_TRUE(of({1e7, 1e7, 0, 0, 0.5, 0.3}).grains.softening);
  EXPECT_FALSE(of({1e7, 0, 0, 0, 0.5, 0.3}).grains.softening);  // no friction to soften
}

// Grains get what they ask for and no more; planes, too, where they are smooth and undamped, as in shear.
TEST(Uses, NoMoreThanIsAskedFor) {
  for (const double mu_d : {0.0, 0.3, 0.5})
    for (const double mu_s : {0.0, 0.5})
      for (const double gamma : {0.0, 5.0})
        for (const double wall_gamma : {0.0, 5.0}) {
          const Scene s = with({1e7, 1e7, gamma, 0, mu_s, mu_d}, {1e7, 0, wall_gamma, 0, 0.5, 0.5});
          const Uses asked = asked_by(s), uses = uses_of(s);
          EXPECT_EQ(asked.grains, uses.grains);
          const bool general = uses.grains.softening && uses.grains.damping;
          if (wall_gamma == 0 && uses.grains.friction && !general)
            EXPECT_EQ(asked.planes, uses.planes);
          else
            EXPECT_EQ(wall_gamma > 0 || gamma > 0, uses.planes.damping);
        }
}

// Damped walls, as in settling, leave the pairs of grains without viscous terms.
TEST(Uses, DampedWallsAreNoMatterOfPairs) {
  const Uses u = of({1e7, 1e7, 0, 0, 0.5, 0.5}, {1e7, 0, 100, 0, 0, 0});
  EXPECT_FALSE(u.grains.damping);
  EXPECT_TRUE(u.planes.damping);
  EXPECT_TRUE(u.damping());
}

TEST(Uses, OfWallsCountOnlyWhereThereAreWalls) {
  Scene s = with({1e7, 1e7, 0, 0, 0, 0}, {1e7, 1e7, 100, 100, 0.5, 0.3});
  s.body(BodyId::floor) = {};
  const Uses u = uses_of(s);
  const LawUses plain{.linear = true};
  EXPECT_TRUE(u.grains == plain && u.planes == plain);
  const LawUses most{.friction = true, .softening = true, .damping = true, .linear = true};
  const auto all = [&] { return uses_of(s).planes == most; };
  for (const BodyId id : planes) {
    s.body(id) = plane(2, 1);
    EXPECT_TRUE(all()) << name_of(id);
    s.body(id) = {};
  }
  drive_top_layer(s, Drive::at(1));  // layers are of grains
  EXPECT_FALSE(uses_of(s).damping());
}

// The laws that a scene takes.
struct Taken {
  bool rubs, softens, damps, rubs_at_planes, damps_at_planes, account;
  bool operator==(const Taken&) const = default;
};
Taken taken_by(const Scene& s) {
  Taken t{};
  int times = 0;
  with_laws(s, [&]<class Row, Account account>() {
    using Grains = typename Row::BetweenGrains;
    using Planes = typename Row::AtPlanes;
    t = {Grains::rubs, Grains::softens, Grains::damps,
         Planes::rubs, Planes::damps,   account == Account::energy};
    ++times;
  });
  EXPECT_EQ(times, 1);
  return t;
}

// Just what they use, but where no row has it alone: softening between damped grains is in the general law.
TEST(Laws, HaveWhatTheSceneUsesAndNoMore) {
  for (const double mu_s : {0.0, 0.3, 0.5})
    for (const double gamma : {0.0, 5.0})
      for (const double gamma_wall : {0.0, 5.0})
        for (const bool ledger : {false, true}) {
          Scene s = with({1e7, 1e7, gamma, 0, mu_s, std::min(mu_s, 0.3)}, {1e7, 0, gamma_wall, 0, 0, 0});
          s.ledger = ledger;
          const bool softens = mu_s > 0.3, damps = gamma > 0;
          // Planes take the law of the grains where it is not worth a row to spare them that.
          const bool smooth = gamma_wall == 0 && !(softens && damps) && mu_s > 0;
          EXPECT_EQ(taken_by(s), (Taken{mu_s > 0, softens, damps, mu_s > 0 && !smooth,
                                        !smooth && (damps || gamma_wall > 0), ledger}))
              << mu_s << ' ' << gamma << ' ' << gamma_wall;
        }
}

}  // namespace
}  // namespace moraine::dem
