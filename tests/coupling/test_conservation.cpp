// What the coupling keeps exactly, whatever it is used for.
#include "wet_scenes.hpp"

namespace moraine::coupling {
namespace {

// A sheared bed that dilates and collides in a shut box.
WetBed sheared() {
  WetBed bed = pressed_bed();
  for (dem::Index i = 0; i < bed.state.size(); ++i) {
    const Vec3d& x = bed.state.x[i];
    bed.state.v[i] = {2 * x.z, 0.1 * std::sin(40 * x.x), 0.1 * std::cos(30 * x.y)};
  }
  return bed;
}

TEST(ClosedBox, KeepsItsWater) {
  Water w = water_over(sheared());
  w.top = TopSide::impermeable, w.sides = {};
  WetRun run(sheared(), w);
  const double before = run.water->record(false).volume;
  for (int k = 0; k < 20; ++k) {
    run.advance(500);
    // Sums of some hundred cells' rounding; 1e-10 is asked for.
    EXPECT_NEAR(run.water->record(false).volume / before, 1, 1e-12);
    EXPECT_NEAR(run.water->record(false).balance / before, 0, 1e-12);
  }
  EXPECT_GT(run.water->state().moved + run.water->state().exchanges, 0);
}

// Grains leave through that side with the flow of the shear, water comes in where they do not fill it.
TEST(DrainedBox, BooksWhatLeavesAtTheSides) {
  WetBed bed = sheared();
  bed.scene.periodic_x = false, bed.scene.dt *= 0.5;
  Water w = water_over(bed);
  for (auto* sides : {&w.sides.low, &w.sides.high}) (*sides)[0].kind = fluid::Side::Kind::pressure;
  WetRun run(bed, w);
  const double before = run.water->record(false).volume;
  run.advance(2000);
  EXPECT_GT(std::abs(run.water->state().drained_sides), 1e-6 * before);
  EXPECT_NEAR(run.water->record(false).balance / before, 0, 1e-12);
}

TEST(Pressures, AreCarriedToAnotherGrid) {
  const WetBed bed = pressed_bed();
  Water w = water_over(bed);
  w.top = TopSide::impermeable, w.sides = {};
  ASSERT_EQ(w.cells, (std::array{4, 4, 2}));
  WaterState before = under_pressure(bed, w, 5e3);
  for (std::size_t c = 0; c < before.p.size(); ++c) before.p[c] = c < before.p.size() / 2 ? 5e3 : 2e3;
  w.cells = {3, 4, 3};
  const auto water = make_pore_water(w, bed.scene, bed.state, before, false);
  const std::vector<double> p = water->fields().pressure;
  ASSERT_EQ(p.size(), 36u);
  for (std::size_t c = 0; c < p.size(); ++c)
    EXPECT_NEAR(p[c], c < 12 ? 5e3 : c < 24 ? 3.5e3 : 2e3, 1e-9) << c;
}

TEST(OneCell, IsPressedByNoMotion) {
  WetBed bed = pressed_bed();
  bed.scene.body(dem::BodyId::top_wall) = dem::wall_at_rest();
  Water w = water_over(bed);
  w.top = TopSide::impermeable, w.sides = {}, w.cells = {1, 1, 1};
  EXPECT_EQ(make_pore_water(w, bed.scene, bed.state, {}, false)->stability().w_f, 0);
}

TEST(DrainedBox, BooksWhatLeaves) {
  WetRun run(sheared(), water_over(sheared()));
  const double before = run.water->record(false).volume;
  run.advance(10000);
  EXPECT_NE(run.water->state().drained_top, 0);
  EXPECT_NEAR(run.water->record(false).balance / before, 0, 1e-12);
}

TEST(Momentum, OfGrainsIsTheLossOfTheWater) {
  expect_momentum_kept(sheared(), [](const State&, double) {});
}

TEST(Energy, OfGrainsAndWaterIsKept) {
  WetBed bed = sheared();
  for (dem::ContactParameters& p : bed.scene.contact) p.gamma_n = p.gamma_t = 0;
  for (const TopSide top : {TopSide::drained, TopSide::impermeable}) {
    Water w = water_under(bed, top);
    w.k_c = 1e-10;
    w.interval = 1;
    bed.scene.dt *= 0.2;
    WetRun run(bed, w);
    const auto total = [&] {
      const State s = run.engine->state();
      const dem::Ledger& l = s.ledger;
      return dem::observe(run.scene, s).energy.total() + l.slip - l.planes;
    };
    const double start = total() + run.water->record(false).stored;
    run.advance(20000);
    const WaterState water = run.water->state();
    const double given = -run.engine->state().ledger.water, stored = run.water->record(false).stored;
    ASSERT_GT(given, 1e-3 * start);
    // Dissipation is booked by the mean of the pressures before and after a step, and new weights give cells
    // a new storage: a thousandth.
    EXPECT_NEAR((stored + water.dissipated) / given, 1, 1e-3);
    // What grains lose is what the water takes: to the leapfrog's own residue.
    EXPECT_NEAR((total() + given - start) / start, 0, 2e-4);
  }
}

TEST(RigidMotion, DisplacesNoWater) {
  WetBed bed = pressed_bed();
  bed.scene.contact.fill(dem::LinearContact{1e-3, 0, 0, 0, 0, 0});
  bed.scene.body(dem::BodyId::top_wall) = bed.scene.body(dem::BodyId::floor) = {};
  for (auto& v : bed.state.v) v = {0.3, -0.2, 0};
  Water w = water_over(bed, bed.state.wall_z());
  w.sides = {}, w.top = TopSide::drained;
  WetRun run(bed, w);
  run.advance(20);  // 0.1 mm
  // Rounding, 1e-16, of 0.1 mm over a cell of 5 cm, over phi beta = 2e-10; real motion would give 1e7 Pa.
  EXPECT_LT(std::max(run.water->record(false).most, -run.water->record(false).least), 1e-5);
}

TEST(OneGrain, InHydrostaticWaterIsBuoyant) {
  WetBed bed;
  bed.scene = dem::empty_space(1e5);
  bed.scene.gravity = 9.8, bed.scene.dt = 1e-5, bed.scene.fluid_density = 1000;
  bed.scene.box = {0.2, 0.2, 1};
  bed.scene.periodic_x = bed.scene.periodic_y = true;
  bed.state = dem::make_loose_grains({.count = 1, .radius_mean = 0.01, .radius_std = 0}).state;
  bed.state.x[0] = {0.1, 0.1, 0.5};
  const auto engine = dem::make_engine(dem::Backend::cpu, 1);
  State s = dem::run(*engine, bed.scene, bed.state, 1000);
  dem::synchronise(bed.scene, s);
  const double a = -s.v[0].z / (1000 * 1e-5);
  EXPECT_NEAR(a / ((1 - 1000 / bed.scene.density_of(dem::Material::grain)) * 9.8), 1, 1e-12);
}

TEST(LinearPressure, PushesAGrainAlikeWhereverItIs) {
  for (const Closure closure : {Closure::full, Closure::pressure_gradient}) {
    double first = 0;
    for (const double at : {0.0, 0.011, 0.02, 0.037, 0.049}) {
      WetBed bed;
      bed.scene = dem::empty_space(1e5);
      bed.scene.gravity = 0, bed.scene.dt = 1e-6, bed.scene.box = {0.2, 0.2, 1};
      bed.scene.periodic_x = bed.scene.periodic_y = true;
      bed.state = dem::make_loose_grains({.count = 1, .radius_mean = 0.01, .radius_std = 0}).state;
      bed.state.x[0] = {0.05 + at, 0.08 - at, 0.25 + at};
      Water w = water_over(bed, 0.5);
      w.closure = closure;
      w.sides.low[2] = {fluid::Side::Kind::pressure, 1000};
      WaterState before = under_pressure(bed, w, 1);
      const double h = 0.05;
      for (std::size_t c = 0; c < before.q.size(); ++c)
        before.q[c] *= 1000 * (1 - (static_cast<double>(c / 16) + 0.5) * h / 0.5);
      WetRun run(bed, w, before);
      const Vec3d f = run.engine->state().water_force.at(0);
      const double expected = dem::sphere_volume(bed.state.r[0]) * 1000 / 0.5 /
                              (closure == Closure::full ? 0.1 : 1.0);  // by the floor of the solid fraction
      EXPECT_NEAR(f.z / expected, 1, 1e-12);
      EXPECT_NEAR(f.x / expected, 0, 1e-12);
      if (first == 0) first = f.z;
      EXPECT_NEAR(f.z / first, 1, 1e-12);
    }
  }
}

}  // namespace
}  // namespace moraine::coupling
