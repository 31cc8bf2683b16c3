// A box that is deformed: what its contacts bear, what that costs, and what the springs see of it.
#include "dem/deform.hpp"

#include <gtest/gtest.h>

#include "dem/engine.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr double r = 0.01, k = 1e5, depth = 1e-5;  // m, N/m, m: overlap

// 4 x 4 x 4 equal grains on a simple cubic lattice, each pressed against six others, all sides periodic.
struct Lattice {
  Scene scene;
  State state;
  Lattice() {
    const double d = 2 * r - depth;
    std::vector<Vec3d> x;
    for (int i = 0; i < 64; ++i) x.push_back({d * (i % 4), d * (i / 4 % 4), d * (i / 16)});
    state = grains_at_rest(std::vector<double>(64, r), x);
    scene.box = {4 * d, 4 * d, 4 * d};
    scene.periodic_z = true, scene.body(BodyId::floor) = {}, scene.gravity = 0;
    scene.contact.fill(LinearContact{k, k, 0, 0, 0.5, 0.5});
    scene.dt = 1e-5;
    evaluate();
  }
  void evaluate() {
    const auto engine = make_engine(Backend::cpu, 1);
    engine->load(scene, state);
    state = engine->state();
  }
};

TEST(Deform, StressOfALattice) {
  const Lattice l;
  ASSERT_EQ(l.state.contacts.size(), 192u);
  const BoxStress s = box_stress(l.scene, l.state);
  const double d = 2 * r - depth, stress = k * depth / (d * d);  // one chain of grains for each d^2
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(s.normal[a], stress, 1e-9 * stress);
  EXPECT_NEAR(s.stiffness, k / d, 1e-9 * k / d);
}

// The stress answers a small strain of all sides as `stiffness` says, and a strain of one side along it
// alone.
TEST(Deform, StressFollowsTheStrain) {
  for (const Vec3d factor : {Vec3d{1 - 1e-5, 1 - 1e-5, 1 - 1e-5}, Vec3d{1, 1 - 1e-5, 1}}) {
    Lattice l;
    const BoxStress before = box_stress(l.scene, l.state);
    const double springs = spring_energy(l.scene, l.state).normal, volume = box_volume(l.scene);
    deform(l.scene, l.state, factor);
    EXPECT_FALSE(l.state.staggered);
    l.evaluate();
    const BoxStress after = box_stress(l.scene, l.state);
    double work = 0;
    for (int a = 0; a < 3; ++a) {
      const double strain = 1 - factor[a];
      const double mean = 0.5 * (before.normal[a] + after.normal[a]);
      // Sides that shorten make the area smaller, too: twice the overlap over d, 1e-3.
      EXPECT_NEAR(after.normal[a] - before.normal[a], before.stiffness * strain,
                  2e-3 * before.stiffness * 1e-5);
      work += volume * mean * strain;
    }
    EXPECT_NEAR(spring_energy(l.scene, l.state).normal - springs, work, 1e-4 * work);
    EXPECT_NEAR(kinetic_energy(l.scene, l.state), 0, 1e-12 * work);  // all forces balance, still
  }
}

// A pair across a corner of the box, at 45 degrees: a strain along x moves the contact along its tangent,
// too.
TEST(Deform, SpringsFollowTheTangent) {
  const double d = 2 * r - depth, c = std::sqrt(0.5);
  State s = grains_at_rest({r, r}, {{0.001, 0.05, 0.001}, {0.1 + 0.001 - c * d, 0.05, 0.1 + 0.001 - c * d}});
  Scene scene = Lattice().scene;
  scene.box = {0.1, 0.1, 0.1};
  const auto engine = make_engine(Backend::cpu, 1);
  engine->load(scene, s);
  s = engine->state();
  ASSERT_EQ(s.contacts.size(), 1u);
  const double strain = 1e-7;
  State all = s, one = s;
  Scene smaller = scene, flatter = scene;
  deform(smaller, all, {1 - strain, 1 - strain, 1 - strain});
  EXPECT_NEAR(length(all.contacts[0].spring.delta_t), 0, 1e-12 * d);
  deform(flatter, one, {1 - strain, 1, 1});
  EXPECT_NEAR(length(one.contacts[0].spring.delta_t), 0.5 * strain * d, 1e-3 * strain * d);
  EXPECT_NEAR(dot(one.contacts[0].spring.delta_t, Vec3d{1, 0, 1}), 0, 1e-3 * strain * d);
  EXPECT_EQ(flatter.box.x, 0.1 * (1 - strain));
  EXPECT_EQ(flatter.box.z, 0.1);
}

}  // namespace
}  // namespace moraine::dem
