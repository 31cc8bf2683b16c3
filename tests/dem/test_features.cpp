// What a scene does not use is not compiled into its loop, and so costs nothing.
#include "dem/features.hpp"

#include <gtest/gtest.h>

namespace moraine::dem {
namespace {

Features of(const ContactParameters& grain, const ContactParameters& wall = {1e7, 0, 0, 0, 0, 0}) {
  Scene s;
  s.grain = grain, s.wall = wall;
  return features_of(s);
}

TEST(Features, FrictionTakesBothMuAndATangentialForce) {
  EXPECT_TRUE(of({1e7, 1e7, 0, 0, 0.5, 0.5}).friction);
  EXPECT_FALSE(of({1e7, 1e7, 0, 0, 0, 0}).friction);
  EXPECT_FALSE(of({1e7, 0, 0, 0, 0.5, 0.5}).friction);
  EXPECT_TRUE(of({1e7, 0, 0, 5, 0.5, 0.5}).friction);
  EXPECT_TRUE(of({1e7, 1e7, 0, 0, 0, 0}, {1e7, 1e7, 0, 0, 0.5, 0.5}).friction);
}

TEST(Features, DampingTakesAViscosity) {
  EXPECT_FALSE(of({1e7, 1e7, 0, 0, 0.5, 0.5}).viscous);
  EXPECT_TRUE(of({1e7, 1e7, 5, 0, 0.5, 0.5}).viscous);
  EXPECT_TRUE(of({1e7, 1e7, 0, 5, 0.5, 0.5}).viscous);
}

TEST(Features, SofteningTakesASmallerDynamicFriction) {
  EXPECT_FALSE(of({1e7, 1e7, 0, 0, 0.5, 0.5}).softening);
  EXPECT_TRUE(of({1e7, 1e7, 0, 0, 0.5, 0.3}).softening);
  EXPECT_FALSE(of({1e7, 0, 0, 0, 0.5, 0.3}).softening);  // no friction to soften
}

// Damped walls, as in settling, leave the pairs of grains without viscous terms.
TEST(Features, DampedWallsAreNoMatterOfPairs) {
  const Features f = of({1e7, 1e7, 0, 0, 0.5, 0.5}, {1e7, 0, 100, 0, 0, 0});
  EXPECT_FALSE(f.viscous);
  EXPECT_TRUE(f.damped);
  EXPECT_FALSE(between_grains(f).damped);
  EXPECT_TRUE(at_walls(f).viscous);
}

TEST(Features, OfWallsCountOnlyWhereThereAreWalls) {
  Scene s;
  s.grain = {1e7, 1e7, 0, 0, 0, 0}, s.wall = {1e7, 1e7, 100, 100, 0.5, 0.3};
  s.floor = false;
  const Features f = features_of(s);
  EXPECT_FALSE(f.damped || f.friction || f.softening);
  s.top_wall.drive = TopWall::Drive::velocity;
  EXPECT_TRUE(features_of(s).damped && features_of(s).friction && features_of(s).softening);
  s.top_wall.drive = TopWall::Drive::none, s.floor = true;
  EXPECT_TRUE(features_of(s).damped && features_of(s).friction && features_of(s).softening);
}

}  // namespace
}  // namespace moraine::dem
