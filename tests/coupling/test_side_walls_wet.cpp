// Water in a bed between four walls.
#include "backends.hpp"
#include "coupling/walls.hpp"
#include "physics/same_bits.hpp"
#include "wet_scenes.hpp"

namespace moraine::coupling {
namespace {

// A bed that swirls, dilates and collides.
WetBed stirred() {
  WetBed bed = walled_bed();
  const Vec3d middle = 0.5 * bed.scene.box;
  for (dem::Index i = 0; i < bed.state.size(); ++i) {
    const Vec3d& x = bed.state.x[i];
    bed.state.v[i] = {-5 * (x.y - middle.y) * x.z, 5 * (x.x - middle.x) * x.z, 0.1 * std::cos(30 * x.y)};
  }
  return bed;
}

void expect_inside(const Scene& scene, const State& s) {
  for (dem::Index i = 0; i < s.size(); ++i)
    for (int a = 0; a < 2; ++a) {
      EXPECT_GT(s.x[i][a], 0.9 * s.r[i]);
      EXPECT_LT(s.x[i][a], scene.box[a] - 0.9 * s.r[i]);
    }
}

TEST(SideWallsInWater, HoldAllGrainsInsideTheGrid) {
  const WetBed bed = walled_bed();
  const Holds holds = held_sides(bed.scene);
  EXPECT_EQ(holds.low, (std::array{true, true, true}));
  EXPECT_EQ(holds.high, (std::array{true, true, true}));
  WetRun run(bed, water_over(bed));
  const WaterFields f = run.water->fields();
  double solids = 0, grains = 0;
  for (const double phi : f.porosity) solids += (1 - phi) * f.grid.cell_volume();
  for (const double r : bed.state.r) grains += dem::sphere_volume(r);
  // Overlaps with walls are inside, too: not a sliver of a grain is lost.
  EXPECT_NEAR(solids / grains, 1, 1e-12);
  EXPECT_EQ(run.water->outside(), "");
}

TEST(SideWallsInWater, KeepWater) {
  for (const TopSide top : {TopSide::impermeable, TopSide::drained}) {
    Water w = water_under(stirred(), top);
    WetRun run(stirred(), w);
    const double before = run.water->record(false).volume;
    for (int k = 0; k < 10; ++k) {
      run.advance(500);
      // Sums of some hundred cells' rounding.
      EXPECT_NEAR(run.water->record(false).balance / before, 0, 1e-12);
      if (top == TopSide::impermeable) {
        EXPECT_NEAR(run.water->record(false).volume / before, 1, 1e-12);
      }
    }
    EXPECT_EQ(run.water->state().drained_sides, 0);
    EXPECT_EQ(run.water->outside(), "");
    expect_inside(run.scene, run.engine->state());
  }
}

// What the grains gain the water and the walls lose: unlike periodic sides, walls bear the pressure at them.
TEST(SideWallsInWater, KeepMomentum) {
  for (const TopSide top : {TopSide::drained, TopSide::impermeable}) {
    Water w = water_under(stirred(), top);
    WetRun run(stirred(), w);
    run.advance(3000);
    const State s = run.engine->state();
    const WaterFields f = run.water->fields();
    Vec3d sum{0, 0, 0}, thrust{0, 0, 0};  // thrust: of the water on the walls, outwards where positive
    double scale = 0;
    for (const Vec3d& force : s.water_force) sum += force, scale += dem::length(force);
    for (int k = 0; k < f.grid.n[2]; ++k)
      for (int j = 0; j < f.grid.n[1]; ++j)
        for (int i = 0; i < f.grid.n[0]; ++i) {
          const double p = f.pressure[f.grid.cell(i, j, k)];
          if (i == 0) thrust.x -= f.grid.face_area(0) * p;
          if (i == f.grid.n[0] - 1) thrust.x += f.grid.face_area(0) * p;
          if (j == 0) thrust.y -= f.grid.face_area(1) * p;
          if (j == f.grid.n[1] - 1) thrust.y += f.grid.face_area(1) * p;
          if (k == 0) thrust.z -= f.grid.face_area(2) * p;
        }
    thrust.z += run.scene.area() * run.water->state().wall_pressure;
    ASSERT_GT(scale, 1);
    for (int a = 0; a < 3; ++a) EXPECT_NEAR((sum[a] + thrust[a]) / scale, 0, 1e-12) << "xyz"[a];
  }
}

TEST(SideWallsInWater, GiveTheSameBits) {
  const WetBed bed = stirred();
  Water w = water_over(bed);
  w.k_c = 1e-11;
  WetRun one(bed, w);
  one.advance(1500);
  const State whole = one.engine->state();
  const auto expect_same = [&](const State& s, const WaterState& water) {
    dem::expect_same_bits(s, whole);
    EXPECT_EQ(std::memcmp(s.water_force.data(), whole.water_force.data(), sizeof(Vec3d) * s.size()), 0);
    EXPECT_EQ(water.q, one.water->state().q);
    EXPECT_EQ(water.p, one.water->state().p);
  };
  std::vector<std::pair<dem::Backend, int>> engines{{dem::Backend::cpu, 3}};
  for (const dem::Backend backend : both_engines()) engines.emplace_back(backend, 2);
  for (const auto& [backend, threads] : engines) {
    WetRun other(bed, w, {}, backend, threads);
    other.advance(1500);
    expect_same(other.engine->state(), other.water->state());
  }
  WetRun first(bed, w);
  first.advance(600);
  const State half = first.engine->state();
  const auto water = make_pore_water(w, first.scene, half, first.water->state(), true);
  const auto engine = dem::make_engine(dem::Backend::cpu, 1);
  engine->load(first.scene, half, water.get());
  engine->advance(whole.step - half.step);
  expect_same(engine->state(), water->state());
}

}  // namespace
}  // namespace moraine::coupling
