// Bodies as scenes describe them.
#include "dem/body/body.hpp"

#include <gtest/gtest.h>

#include "dem/body/motion.hpp"

namespace moraine::dem {
namespace {

TEST(Bodies, AFloorAloneUnlessToldOtherwise) {
  const Scene s;
  for (int k = 0; k < body_ids; ++k) {
    const auto id = static_cast<BodyId>(k);
    EXPECT_EQ(s.body(id), id == BodyId::floor ? floor_at(0) : Body{}) << name_of(id);
  }
  EXPECT_TRUE(s.has_planes());
}

TEST(Bodies, HaveTheShapeOfTheirName) {
  EXPECT_EQ(shape_of(BodyId::none), Body::Shape::absent);
  EXPECT_EQ(shape_of(BodyId::bottom_layer), layer({}, true).shape);
  EXPECT_EQ(shape_of(BodyId::top_layer), layer({}, true).shape);
  for (const BodyId id : planes) EXPECT_EQ(shape_of(id), Body::Shape::plane) << name_of(id);
}

TEST(Bodies, AStressSwingsAboutItsMean) {
  Drive d = Drive::by(1000);
  EXPECT_EQ(d.stress(0.3), 1000);
  d.amplitude = 200, d.frequency = 2, d.phase = 0.5;
  EXPECT_DOUBLE_EQ(d.stress(0.3), 1000 + 200 * std::sin(4 * std::numbers::pi * 0.3 + 0.5));
}

// A held plane is where the scene has it, one that moves where the state does.
TEST(Bodies, WhereAPlaneStands) {
  Scene scene;
  State state;
  scene.body(BodyId::x_high) = plane(0, -1, 0.7);
  scene.body(BodyId::top_wall) = top_wall();
  scene.body(BodyId::top_wall).z = Drive::at(0);
  state.wall_z() = 0.2;
  EXPECT_EQ(place_of(scene, state, BodyId::floor), 0);
  EXPECT_EQ(place_of(scene, state, BodyId::x_high), 0.7);
  EXPECT_EQ(place_of(scene, state, BodyId::top_wall), 0.2);
  const BodyMotion bodies = motion_of(scene, state);
  ASSERT_NE(bodies.find(BodyId::x_high), nullptr);
  EXPECT_DOUBLE_EQ(bodies.find(BodyId::x_high)->gap({0.5, 0, 0}, 0.1), 0.1);
  EXPECT_EQ(bodies.find(BodyId::y_low), nullptr);
}

}  // namespace
}  // namespace moraine::dem
