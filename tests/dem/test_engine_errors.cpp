// What an engine refuses, and how it says so.
#include "backends.hpp"
#include "error.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

class EngineErrors : public OnEveryBackend {
 protected:
  void expect_error(const Scene& s, const State& state, std::initializer_list<const char*> words,
                    std::int64_t steps = 0) {
    const auto engine = make();
    try {
      engine->load(s, state);
      engine->advance(steps);
      ADD_FAILURE() << "no error that names " << *words.begin();
    } catch (const Error& e) {
      for (const char* word : words)
        EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
    }
  }
};

Scene good() {
  Scene s;
  s.box = {0.1, 0.1, 1};
  s.grain.k_n = s.grain.k_t = s.wall.k_n = s.wall.k_t = 1e5;
  s.dt = 1e-5;
  return s;
}
State two() { return grains_at_rest({0.01, 0.01}, {{0.03, 0.03, 0.02}, {0.07, 0.07, 0.02}}); }

TEST_P(EngineErrors, Scenes) {
  Scene s = good();
  const auto engine = make();
  EXPECT_NO_THROW(engine->load(s, two()));
  expect_error(s, State{}, {"no grains"});
  s.dt = 0;
  expect_error(s, two(), {"time step", "positive"});
  s.dt = std::nan("");
  expect_error(s, two(), {"time step"});
  s = good(), s.box.x = 0.0405;  // two diameters, but too little margin
  expect_error(s, two(), {"box.x", "0.0405", "too narrow"});
  s.periodic_x = false;  // an open side may be as narrow as it likes
  EXPECT_NO_THROW(engine->load(s, two()));
  s = good(), s.periodic_z = true;
  expect_error(s, two(), {"periodic", "floor"});
  s = good(), s.top_wall.drive = TopWall::Drive::stress;
  expect_error(s, two(), {"top wall mass", "positive"});
  s = good(), s.shear.drive = Shear::Drive::stress;
  expect_error(s, two(), {"top layer"});
}

// Something around the grains that fails at some exchange.
struct Failing : Surroundings {
  int at;
  bool in_remap;
  int exchanges = 0;
  static constexpr Index grains = 600;

  Failing(int exchange, bool remap) : at(exchange), in_remap(remap) {}
  bool stale() const override { return in_remap && exchanges >= at; }
  void remap(const GrainRow*, const Drive&) override { throw error("no remap"); }
  void displace(Index, const GrainRow*) override {}
  WaterReaction solve(const Drive&, double) override {
    if (++exchanges >= at && !in_remap) throw error("no solution");
    return {};
  }
  void push(Index chunk, const GrainRow*, WaterRow* force) override {
    const Index size = chunk_size(grains);
    std::fill(force + chunk * size, force + std::min(grains, (chunk + 1) * size), WaterRow{});
  }
};

// Also where several threads are under way; and an engine is good for another run afterwards.
TEST(SurroundingsThatFail, EndARunByTheirError) {
  auto [scene, state] = cloud(Failing::grains, 0.26, 3);
  scene.exchange_interval = 1;
  for (const Backend backend : {Backend::cpu, Backend::reference})
    for (const int threads : {1, 2, 4})
      for (const bool in_remap : {false, true})
        for (const int at : {1, 2, 7, 40}) {
          Failing failing(at, in_remap);
          const auto engine = make_engine(backend, threads);
          const auto run = [&] {
            engine->load(scene, state, &failing);
            engine->advance(40);
          };
          try {
            run();
            ADD_FAILURE() << threads << " threads, exchange " << at;
          } catch (const Error& e) {
            EXPECT_STREQ(e.what(), in_remap ? "no remap" : "no solution");
          }
          failing = Failing(1000, false);
          EXPECT_NO_THROW(run());
        }
}

TEST_P(EngineErrors, NameTheLostGrainAndTheStep) {
  for (const std::int64_t steps : {1, 7, 1000}) {
    State s = two();
    s.id = {5, 3};
    s.v[1].y = std::nan("");
    expect_error(good(), s, {"grain 3 at step", "not a finite number"}, steps);
    s.v[1].y = std::numeric_limits<double>::infinity();
    expect_error(good(), s, {"grain 3 at step", "not a finite number"}, steps);
  }
}

TEST_P(EngineErrors, FellThroughTheFloor) {
  State s = two();
  s.v[0].z = -1e4;  // ten radii in a step
  Scene scene = good();
  expect_error(scene, s, {"grain 0 at step 1 ", "fell through the floor"}, 1);
  scene.grain.k_n = scene.wall.k_n = 1;  // too soft to stop it
  s.v[0].z = -10;
  expect_error(scene, s, {"grain 0 at step", "fell through the floor"}, 1000);
}

TEST_P(EngineErrors, PassedThroughTheTopWall) {
  State s = two();
  s.wall_z = 0.05;
  s.v[0].z = 1e4;
  Scene scene = good();
  scene.top_wall.drive = TopWall::Drive::velocity;
  expect_error(scene, s, {"grain 0 at step 1 ", "passed through the top wall"}, 1);
}

// A step far beyond the stable one must end in words, not in numbers.
TEST_P(EngineErrors, UnstableStep) {
  Bed bed = sheared_bed();
  bed.scene.dt *= 40;
  expect_error(bed.scene, bed.state, {"grain ", " at step ", "try a smaller"}, 20000);
}

ON_EVERY_BACKEND(EngineErrors);

TEST(MakeEngine, SaysWhatIsMissing) {
  if (cuda_device_present()) GTEST_SKIP() << "nothing is missing";
  try {
    make_engine(Backend::cuda);
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find(cuda_built() ? "no NVIDIA GPU" : "no CUDA"), std::string::npos)
        << e.what();
  }
}

}  // namespace
}  // namespace moraine::dem
