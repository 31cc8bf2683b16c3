// The same bits for any number of threads, on the GPU's loop, and after a restart.
#include <cstring>

#include "backends.hpp"
#include "dem/sums.hpp"
#include "thread_ranks.hpp"
#include "wet_scenes.hpp"

namespace moraine::coupling {
namespace {

struct End {
  State state;
  WaterState water;
};

struct Kind {
  int interval;
  bool damped;          // without damping pushes are not kept from step to step
  bool graded = false;  // sizes 1:20, permeability by the grains of each cell
};
constexpr Kind kinds[] = {{1, true}, {2, true}, {1, false}, {2, true, true}, {1, false, true}};

WetBed sheared(bool damped, bool graded = false) {
  WetBed bed = graded ? pressed_graded() : pressed_bed();
  if (!damped)
    for (dem::ContactParameters& p : bed.scene.contact) p.gamma_n = p.gamma_t = 0;
  if (graded) return bed;
  for (dem::Index i = 0; i < bed.state.size(); ++i) bed.state.v[i] = {2 * bed.state.x[i].z, 0.1, 0};
  return bed;
}

void expect_same(const End& a, const End& b) {
  const auto same = [](const auto& p, const auto& q) {
    return p.size() == q.size() && std::memcmp(p.data(), q.data(), p.size() * sizeof p[0]) == 0;
  };
  EXPECT_TRUE(same(a.state.x, b.state.x));
  EXPECT_TRUE(same(a.state.v, b.state.v));
  EXPECT_TRUE(same(a.state.omega, b.state.omega));
  EXPECT_TRUE(same(a.state.force, b.state.force));
  EXPECT_TRUE(same(a.state.water_force, b.state.water_force));
  EXPECT_TRUE(same(a.water.q, b.water.q));
  EXPECT_TRUE(same(a.water.p, b.water.p));
  EXPECT_EQ(a.state.ledger.water, b.state.ledger.water);
  EXPECT_EQ(a.state.ledger.viscous, b.state.ledger.viscous);
  EXPECT_EQ(a.state.wall_z(), b.state.wall_z());
  EXPECT_EQ(a.water.drained_top, b.water.drained_top);
}

End after(WetRun&& run, int steps) {
  run.advance(steps);
  return {run.engine->state(), run.water->state()};
}

TEST(SameBitsInWater, ForAnyThreadsAndOnTheGpusLoop) {
  for (const auto& [m, damped, graded] : kinds) {
    const WetBed bed = sheared(damped, graded);
    Water w = water_over(bed);
    w.interval = m, w.k_c = graded ? 0 : 1e-11;
    if (graded) w.cells = {3, 3, 2};
    const int steps = graded ? 300 : 1500, many = graded ? 3 : 4;
    const End one = after(WetRun(bed, w), steps);
    EXPECT_GT(one.water.exchanges, 100);
    expect_same(one, after(WetRun(bed, w, {}, dem::Backend::cpu, 2), steps));
    expect_same(one, after(WetRun(bed, w, {}, dem::Backend::cpu, many), steps));
    for (const dem::Backend backend : gpu_loops())
      expect_same(one, after(WetRun(bed, w, {}, backend, 2), steps));
  }
}

TEST(SameBitsInWater, ForAnyRanks) {
  for (const auto& [m, damped, graded] : kinds) {
    const WetBed bed = sheared(damped, graded);
    Water w = water_over(bed);
    w.interval = m, w.k_c = graded ? 0 : 1e-11;
    if (graded) w.cells = {3, 3, 2};
    const int steps = graded ? 150 : 600;
    const End one = after(WetRun(bed, w), steps);
    for (const int ranks : {2, 3}) {
      if (ranks > dem::chunk_count(bed.state.size())) continue;
      EngineOnRanks engine(ranks, ranks % 2 + 1);
      const WetRun run(bed, w, *engine);
      engine->advance((steps + m - 1) / m * m);
      expect_same(one, {engine->state(), run.water->state()});
    }
  }
}

TEST(SameBitsInWater, StepByStep) {
  for (const int m : {2, 3}) {
    const WetBed bed = sheared(m == 2);
    Water w = water_over(bed);
    w.interval = m, w.k_c = 1e-11, w.compressibility = 1e-7;
    const End whole = after(WetRun(bed, w), 600);
    std::vector<std::pair<dem::Backend, int>> engines{{dem::Backend::cpu, 2}};
    for (const dem::Backend backend : both_engines()) engines.emplace_back(backend, 1);
    for (const auto& [backend, threads] : engines) {
      WetRun run(bed, w, {}, backend, threads);
      for (int k = 0; k < 600; ++k) run.engine->advance(1), (void)run.engine->state();
      expect_same(whole, {run.engine->state(), run.water->state()});
    }
  }
}

TEST(SameBitsInWater, AfterARestart) {
  for (const auto& [m, damped, graded] : kinds) {
    const WetBed bed = sheared(damped, graded);
    Water w = water_over(bed);
    if (graded) w.cells = {3, 3, 2};
    w.interval = m, w.k_c = graded ? 0 : 1e-11, w.top = TopSide::impermeable, w.sides = {};
    const End whole = after(WetRun(bed, w), 1500);
    for (const int at : {100, 300, 900}) {
      WetRun first(bed, w);
      first.advance(at);
      const End half{first.engine->state(), first.water->state()};
      const auto water = make_pore_water(w, first.scene, half.state, half.water, true);
      const auto engine = dem::make_engine(dem::Backend::cpu, 1);
      engine->load(first.scene, half.state, water.get());
      engine->advance(1500 - at);
      expect_same(whole, {engine->state(), water->state()});
    }
  }
}

}  // namespace
}  // namespace moraine::coupling
