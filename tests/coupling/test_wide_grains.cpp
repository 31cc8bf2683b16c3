// Grains larger than cells: porosity against points, flow against bounds, and what the coupling keeps.
#include "backends.hpp"
#include "coupling/mapping.hpp"
#include "dem/state_rows.hpp"
#include "strewn.hpp"

namespace moraine::coupling {
namespace {

std::vector<double> radii(double large, int n_large, double small, int n_small) {
  std::vector<double> r(n_large, large);
  r.insert(r.end(), n_small, small);
  return r;
}

// m3/s for a drop of 1 Pa from floor to top: no flow sideways (least) or no resistance to it (most).
double bound(const fluid::Grid& g, const std::vector<double>& phi, const Water& w, bool least) {
  std::vector<double> k(phi.size());
  for (std::size_t c = 0; c < k.size(); ++c) {
    const double p = std::clamp(phi[c], w.porosity_range[0], w.porosity_range[1]);
    k[c] = w.k_c * p * p * p / ((1 - p) * (1 - p)) * g.face_area(2) / (w.viscosity * g.h(2));
  }
  const std::size_t column = g.cell(0, 0, 1);
  std::vector<double> resistance(column, 0);
  double of_layers = 0;
  for (int f = 0; f <= g.n[2]; ++f) {
    double sum = 0;
    for (std::size_t c = 0; c < column; ++c) {
      double r = 0;
      for (const int layer : {f - 1, f})
        if (layer >= 0 && layer < g.n[2]) r += 0.5 / k[layer * column + c];
      resistance[c] += r, sum += 1 / r;
    }
    of_layers += 1 / sum;
  }
  if (!least) return 1 / of_layers;
  double sum = 0;
  for (const double r : resistance) sum += 1 / r;
  return sum;
}

// The steady flow upwards, m3/s.
double steady_flow(const WetBed& bed, const Water& w) {
  const auto water = make_pore_water(w, bed.scene, bed.state, {}, false);
  double before = 0, flow = 0;
  for (int n = 1; n <= 400; ++n) {
    water->solve({}, static_cast<double>(n * water->interval()) * bed.scene.dt);
    const WaterFields f = water->fields();
    before = flow, flow = 0;
    for (std::size_t c = 0; c < f.flux.size(); ++c) flow += f.flux[c].z * f.grid.face_area(2) / f.grid.n[2];
    if (n > 3 && std::abs(flow - before) < 1e-7 * flow) return flow;
  }
  ADD_FAILURE() << "flow " << flow << " m3/s still changes";
  return flow;
}

void expect_exact(const WetBed& bed, Water w, const char* what) {
  w.k_c = 1e-6;
  w.sides.low[2] = {fluid::Side::Kind::pressure, 1};
  const WaterFields f = make_pore_water(w, bed.scene, bed.state, {}, false)->fields();
  const std::vector<double> sampled = sampled_porosity(bed, f.grid, 20);
  const double worst = largest_difference(f.porosity, sampled);
  EXPECT_LT(worst, 0.02) << what;
  std::vector<double> less = sampled, more = sampled;  // by what the points may be off
  for (double& phi : less) phi -= worst;
  for (double& phi : more) phi += worst;
  const double flow = steady_flow(bed, w), low = bound(f.grid, less, w, true),
               high = bound(f.grid, more, w, false);
  EXPECT_GT(flow, low) << what;
  EXPECT_LT(flow, high) << what;
  std::printf("%s: porosity within %.4f of points; flow %.4g m3/s, bounds %.4g to %.4g\n", what, worst, flow,
              low, high);
}

TEST(WideGrains, PorosityOfOneAmongSmallOnes) {
  std::vector<double> r = radii(0.08, 1, 0.01, 7);
  WetBed bed = strewn(r, {0.34, 0.34, 0.3}, 1);
  bed.state.x[0] = {0.17, 0.17, 0.15};
  for (dem::Index i = 1; i < 8; ++i) bed.state.x[i] = {0.05 * i - 0.03, 0.02, 0.02};
  Water w = water_over(bed, 0.3);
  w.cells = {3, 3, 3};
  const WaterFields f = make_pore_water(w, bed.scene, bed.state, {}, false)->fields();
  const std::vector<double> exact = sampled_porosity(bed, f.grid, 100);
  EXPECT_LT(largest_difference(f.porosity, exact), 2e-4);
  std::printf("porosity %.4f; beside %.4f, below %.4f\n", f.porosity[13], f.porosity[12], f.porosity[4]);
  for (const double phi : f.porosity) EXPECT_TRUE(phi > 0 && phi <= 1) << phi;
}

TEST(WideGrains, PorosityAndFlowAtAnySizeRatio) {
  for (const int ratio : {1, 3, 10, 30}) {
    const double small = 0.01, large = ratio * small, side = std::max(0.3, 3 * large);
    const Vec3d box{side, side, std::max(0.3, 2.5 * large)};
    const double grain = dem::sphere_volume(small), of_large = ratio > 1 ? dem::sphere_volume(large) : 0;
    const int n_large = ratio == 1 ? 0 : ratio == 3 ? 20 : ratio == 10 ? 2 : 1;
    const int n_small = int(0.22 * (box.x * box.y * box.z - n_large * of_large) / grain);
    const WetBed bed = strewn(radii(large, n_large, small, n_small), box, 7);
    expect_exact(bed, water_over(bed, box.z), ("1 to " + std::to_string(ratio)).c_str());
  }
}

TEST(WideGrains, PorosityAndFlowOfFiveAmongMany) {
  const WetBed bed = strewn(radii(0.06, 5, 0.01, 1500), {0.34, 0.34, 0.3}, 3);
  expect_exact(bed, water_over(bed, 0.3), "5 of 0.06 m among 1500 of 0.01 m");
}

// Weights take no more of the space about a face than there is.
TEST(WideGrains, FillNoMoreThanTheSpace) {
  const WetBed bed = strewn(radii(0.06, 5, 0.01, 1500), {0.34, 0.34, 0.3}, 3);
  const std::vector<dem::GrainRow> rows = dem::grain_rows(bed.scene, bed.state);
  fluid::Grid grid;
  grid.n = {6, 6, 6}, grid.length = {0.34, 0.34, 0.3};
  Mapping mapping;
  mapping.build(grid, {}, rows.data(), bed.state.x, std::vector<double>(rows.size(), 1),
                std::vector<double>(rows.size(), 0));
  double most = 0;
  for (const auto& axis : mapping.solid_fraction())
    for (const double psi : axis) most = std::max(most, psi);
  EXPECT_GT(most, 0.8);
  EXPECT_LE(most, 1);
}

// The boulders of a pressed bed, sheared.
WetBed sheared(bool damped = true) {
  WetBed bed = boulder_bed();
  if (!damped)
    for (dem::ContactParameters& p : bed.scene.contact) p.gamma_n = p.gamma_t = 0;
  for (dem::Index i = 0; i < bed.state.size(); ++i) {
    const Vec3d& x = bed.state.x[i];
    bed.state.v[i] = {2 * x.z, 0.1 * std::sin(40 * x.x), 0.1 * std::cos(30 * x.y)};
  }
  return bed;
}

TEST(WideGrains, KeepWater) {
  for (const TopSide top : {TopSide::drained, TopSide::impermeable}) {
    Water w = water_under(sheared(), top);
    WetRun run(sheared(), w);
    const double before = run.water->record(false).volume;
    for (int k = 0; k < 5; ++k) {
      run.advance(1000);
      const WaterRecord r = run.water->record(false);
      EXPECT_NEAR(r.balance / before, 0, 1e-12);
      if (top == TopSide::impermeable) {
        EXPECT_NEAR(r.volume / before, 1, 1e-12);
      }
    }
    EXPECT_LT(
        largest_difference(run.water->fields().porosity,
                           sampled_porosity({run.scene, run.engine->state()}, run.water->fields().grid, 20)),
        0.02);
  }
}

TEST(WideGrains, GainTheMomentumThatWaterLoses) {
  expect_momentum_kept(sheared(), [](const State& s, double scale) {
    double boulders = 0;
    for (dem::Index i = 0; i < s.size(); ++i)
      if (s.r[i] > 0.04) boulders += dem::length(s.water_force[i]);
    EXPECT_GT(boulders, 0.01 * scale);
  });
}

TEST(WideGrains, KeepEnergyWithTheWater) {
  WetBed bed = sheared(false);
  Water w = water_over(bed);
  w.top = TopSide::impermeable, w.sides = {}, w.k_c = 1e-10, w.interval = 1;
  bed.scene.dt *= 0.2;
  WetRun run(bed, w);
  const auto total = [&] {
    const State s = run.engine->state();
    return dem::observe(run.scene, s).energy.total() + s.ledger.slip - s.ledger.planes;
  };
  const double start = total() + run.water->record(false).stored;
  run.advance(20000);
  const double given = -run.engine->state().ledger.water;
  ASSERT_GT(given, 1e-3 * start);
  // As for other grains: new weights give cells a new storage, and leapfrog has its residue.
  EXPECT_NEAR((run.water->record(false).stored + run.water->state().dissipated) / given, 1, 1e-3);
  EXPECT_NEAR((total() + given - start) / start, 0, 2e-4);
}

TEST(WideGrains, DisplaceNoWaterInRigidMotion) {
  WetBed bed = boulder_bed();
  bed.scene.contact.fill(dem::LinearContact{1e-3, 0, 0, 0, 0, 0});
  bed.scene.body(dem::BodyId::top_wall) = bed.scene.body(dem::BodyId::floor) = {};
  for (auto& v : bed.state.v) v = {0.3, -0.2, 0};
  Water w = water_over(bed, bed.state.wall_z());
  w.sides = {}, w.top = TopSide::drained;
  WetRun run(bed, w);
  run.advance(20);
  EXPECT_LT(std::max(run.water->record(false).most, -run.water->record(false).least), 1e-5);
}

TEST(WideGrains, SwingStably) {
  WetBed bed = boulder_bed();
  Scene& s = bed.scene;
  for (dem::ContactParameters& p : s.contact) p.gamma_n = p.gamma_t = 0;
  for (dem::ContactParameters& p : s.contact) p.mu_s = p.mu_d = 100;
  for (dem::Index i = 0; i < bed.state.size(); ++i)
    bed.state.v[i] = {1e-5 * std::sin(1e3 * i), 1e-5 * std::sin(2e3 * i), 1e-5 * std::sin(3e3 * i)};
  Water w = water_over(bed);
  w.top = TopSide::impermeable, w.k_c = 1e-20, w.sides = {};
  WetRun run(bed, w);
  const auto kinetic = [&] { return dem::observe(run.scene, run.engine->state()).energy.kinetic; };
  const double start = kinetic();
  for (int k = 0; k < 10; ++k) {
    run.advance(5000);
    EXPECT_LT(kinetic(), 1.05 * start);
  }
}

TEST(WideGrains, GiveTheSameBitsForAnyThreadsAndAfterARestart) {
  const auto bits = [](const State& s, const WaterState& w) {
    std::vector<double> all = w.q;
    for (const auto* list : {&s.x, &s.v, &s.water_force})
      for (const Vec3d& v : *list) all.insert(all.end(), {v.x, v.y, v.z});
    all.insert(all.end(), {s.ledger.water, s.wall_z(), w.drained_top});
    return all;
  };
  for (const int m : {1, 2}) {
    const WetBed bed = sheared();
    Water w = water_over(bed);
    w.interval = m, w.k_c = 1e-11;
    const auto after = [&](dem::Backend backend, int threads) {
      WetRun run(bed, w, {}, backend, threads);
      run.advance(1200);
      return bits(run.engine->state(), run.water->state());
    };
    const std::vector<double> one = after(dem::Backend::cpu, 1);
    EXPECT_EQ(one, after(dem::Backend::cpu, 4));
    for (const dem::Backend backend : gpu_loops()) EXPECT_EQ(one, after(backend, 2));
    for (const int at : {200, 700}) {
      WetRun first(bed, w);
      first.advance(at);
      const State half = first.engine->state();
      const auto water = make_pore_water(w, first.scene, half, first.water->state(), true);
      const auto engine = dem::make_engine(dem::Backend::cpu, 1);
      engine->load(first.scene, half, water.get());
      engine->advance(1200 - at);
      EXPECT_EQ(one, bits(engine->state(), water->state())) << "cut at " << at;
    }
  }
}

}  // namespace
}  // namespace moraine::coupling
