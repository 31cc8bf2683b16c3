// Grains at sides that do not hold them back, and beyond.
#include "wet_scenes.hpp"

namespace moraine::coupling {
namespace {

// Settled between periodic sides that are then taken away: the bed slumps.
WetBed slumping() {
  static const WetBed bed = make_bed(216, 6, 0);
  WetBed open{bed.scene, dem::grains_at_rest(bed.state.r, bed.state.x)};  // without contacts across the sides
  open.scene.periodic_x = open.scene.periodic_y = false;
  return open;
}

Water water_with_sides(const WetBed& bed, fluid::Side::Kind kind) {
  Water w = water_over(bed, bed_top(bed.state) + 0.05);
  w.k_c = 1e-8;
  for (auto* sides : {&w.sides.low, &w.sides.high}) (*sides)[0].kind = (*sides)[1].kind = kind;
  return w;
}

// m3, as far as cells know of them.
double solids(const WaterFields& f) {
  double sum = 0;
  for (const double phi : f.porosity) sum += (1 - phi) * f.grid.cell_volume();
  return sum;
}

WetBed one_grain(const Vec3d& x, double r) {
  WetBed bed;
  bed.scene = dem::empty_space(1e5);
  bed.scene.box = {0.2, 0.2, 1}, bed.scene.dt = 1e-6;
  bed.scene.body(dem::BodyId::floor) = dem::floor_at(0);
  bed.state = dem::grains_at_rest({r}, {x});
  return bed;
}

TEST(OpenSides, CountWhatIsInside) {
  for (const double r : {0.01, 0.06}) {
    const double ball = dem::sphere_volume(r);
    const auto inside = [&](const Vec3d& x) {
      const WetBed bed = one_grain(x, r);
      const auto water = make_pore_water(water_over(bed, 0.2), bed.scene, bed.state, {}, false);
      const double sum = solids(water->fields());
      // The account takes as much as the cells.
      EXPECT_NEAR(water->record(false).volume, 0.2 * 0.2 * 0.2 - sum, 1e-15);
      EXPECT_EQ(water->outside().empty(), sum > 0.9999 * ball) << water->outside();
      return sum / ball;
    };
    EXPECT_NEAR(inside({0.1, 0.1, 0.1}), 1, 1e-12);
    EXPECT_NEAR(inside({0, 0.1, 0.1}), 0.5, 1e-12);
    EXPECT_NEAR(inside({0.2, 0.1, 0.1}), 0.5, 1e-12);
    EXPECT_NEAR(inside({0, 0.2, 0.1}), 0.25, 1e-12);
    EXPECT_NEAR(inside({0.2, 0.2, 0.2}), 0.125, 1e-12);               // the grid's top
    EXPECT_NEAR(inside({0.1, -0.5 * r, 0.1}), 5.0 / 32, 1e-12);       // a cap of r/2
    EXPECT_NEAR(inside({0.1, 0.1, 0.2 + 0.5 * r}), 5.0 / 32, 1e-12);  // of a grain above the grid
    EXPECT_NEAR(inside({0.1, 0.1, 0.9 * r}), 1, 1e-12);               // overlaps the floor, which holds it
    for (const Vec3d& x : {Vec3d{50, 0.1, 0.1}, {0.1, -1e9, 0.1}, {0.1, 0.1, 50}, {-50, 1e12, 50}})
      EXPECT_EQ(inside(x), 0);
  }
}

TEST(OpenSides, AGrainFarAwayChangesNothing) {
  WetBed bed = slumping();
  const Water w = water_with_sides(bed, fluid::Side::Kind::pressure);
  const auto without = make_pore_water(w, bed.scene, bed.state, {}, false);
  std::vector<double> r = bed.state.r;
  std::vector<Vec3d> x = bed.state.x;
  r.push_back(0.05), x.push_back({50, 0.05, 0.05});
  bed.state = dem::grains_at_rest(r, x);
  const auto with = make_pore_water(w, bed.scene, bed.state, {}, false);
  EXPECT_EQ(with->fields().porosity, without->fields().porosity);
  EXPECT_EQ(with->fields().permeability, without->fields().permeability);
  EXPECT_NEAR(with->record(false).volume / without->record(false).volume, 1, 1e-12);
  EXPECT_NE(with->outside().find("1 grain beyond x = 0.151 m"), std::string::npos) << with->outside();
}

TEST(OpenSides, WaterTakesThePlaceOfGrainsThatLeave) {
  const WetBed bed = slumping();
  WetRun run(bed, water_with_sides(bed, fluid::Side::Kind::pressure));
  EXPECT_EQ(run.water->outside().find("grain beyond"), std::string::npos) << run.water->outside();
  const double volume = run.water->record(false).volume, at_first = solids(run.water->fields());
  run.advance(30000);
  const WaterFields f = run.water->fields();
  const State s = run.engine->state();
  int left = 0;
  for (dem::Index i = 0; i < s.size(); ++i)
    if (const double r = s.r[i];
        s.x[i].x < -r || s.x[i].x > bed.scene.box.x + r || s.x[i].y < -r || s.x[i].y > bed.scene.box.y + r)
      ++left;
  EXPECT_GT(left, 40);
  EXPECT_LT(largest_difference(f.porosity, sampled_porosity({run.scene, s}, f.grid, 20)), 0.02);
  const WaterRecord r = run.water->record(false);
  EXPECT_NEAR(r.balance / volume, 0, 1e-12);
  // As the pressures are small, the water that came in has the volume of the grains that left.
  const WaterState w = run.water->state();
  const double went = at_first - solids(f);
  EXPECT_NEAR(-(w.drained_sides + w.drained_top) / went, 1, 1e-3);
  EXPECT_NEAR((r.volume - volume) / went, 1, 1e-3);
  const std::string said = run.water->outside();
  for (const char* word : {"beyond x = 0 m", "beyond x = 0.151 m", "beyond y = 0 m", "beyond y = 0.151 m"})
    EXPECT_NE(said.find(word), std::string::npos) << said;
  EXPECT_EQ(said.find("no water"), std::string::npos) << said;
  std::printf("%d of %d grains left: %s\n", left, s.size(), said.c_str());
}

TEST(OpenSides, WhereTheyAreTightTheBalanceLacksTheGrainsThatLeave) {
  const WetBed bed = slumping();
  WetRun run(bed, water_with_sides(bed, fluid::Side::Kind::closed));
  const double at_first = solids(run.water->fields());
  run.advance(30000);
  const double went = at_first - solids(run.water->fields());
  ASSERT_GT(went, 0.05 * at_first);
  EXPECT_NEAR(run.water->record(false).balance / went, 1, 1e-9);
  EXPECT_NE(run.water->outside().find("no water can take their place"), std::string::npos)
      << run.water->outside();
}

TEST(OpenSides, PushNoGrainOutside) {
  WetBed bed = slumping();
  for (dem::Index i = 0; i < bed.state.size(); ++i)
    if (i % 3 == 0) bed.state.x[i].x += 0.3;  // leaving no contact that it was in
  Water w = water_with_sides(bed, fluid::Side::Kind::pressure);
  w.sides.low[2] = {fluid::Side::Kind::pressure, 1000};
  WetRun run(bed, w);
  run.advance(1);
  const State s = run.engine->state();
  double pushed = 0;
  for (dem::Index i = 0; i < s.size(); ++i)
    if (s.x[i].x > bed.scene.box.x + s.r[i])
      EXPECT_EQ(dem::length(s.water_force[i]), 0);
    else
      pushed += dem::length(s.water_force[i]);
  EXPECT_GT(pushed, 0);
}

TEST(OpenSides, GiveTheSameBitsAfterARestart) {
  const WetBed bed = slumping();
  const Water w = water_with_sides(bed, fluid::Side::Kind::pressure);
  WetRun whole(bed, w), first(bed, w);
  whole.advance(9000);
  first.advance(6000);
  const State half = first.engine->state();
  const auto water = make_pore_water(w, first.scene, half, first.water->state(), true);
  const auto engine = dem::make_engine(dem::Backend::cpu, 2);
  engine->load(first.scene, half, water.get());
  engine->advance(whole.engine->state().step - half.step);
  EXPECT_EQ(whole.water->state().q, water->state().q);
  EXPECT_EQ(whole.water->state().drained_sides, water->state().drained_sides);
  EXPECT_EQ(whole.water->outside(), water->outside());
  EXPECT_EQ(whole.water->record(false).balance, water->record(false).balance);
}

}  // namespace
}  // namespace moraine::coupling
