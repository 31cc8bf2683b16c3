// What an engine refuses, and how it says so.
#include "backends.hpp"
#include "dem/sums.hpp"
#include "error.hpp"
#include "physics/scenes.hpp"
#include "thread_ranks.hpp"

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
  for (ContactParameters& p : s.contact) p.k_n = p.k_t = 1e5;
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
  s = good(), s.body(BodyId::top_wall) = wall_pressed_by(1000, 0);
  expect_error(s, two(), {"top wall mass", "positive"});
  s = good(), drive_top_layer(s, Drive::by(1000));
  expect_error(s, two(), {"top layer"});
}

TEST_P(EngineErrors, Bodies) {
  const auto expect = [&](auto&& change, std::initializer_list<const char*> words) {
    Scene s = good();
    change(s);
    expect_error(s, two(), words);
  };
  expect([](Scene& s) { s.body(BodyId::x_low) = plane(0, 1); }, {"periodic along x", "the side wall x_low"});
  expect([](Scene& s) { s.body(BodyId::floor).z = Drive::by(1000); }, {"the floor", "stress", "top wall"});
  expect([](Scene& s) { s.body(BodyId::floor).x.kind = Drive::Kind::free; }, {"the floor", "free along x"});
  expect(
      [](Scene& s) {
        s.body(BodyId::top_layer) = layer(Drive::at(1), true), s.body(BodyId::top_layer).y = Drive::at(1);
      },
      {"layer", "along x only"});
  expect([](Scene& s) { drive_top_layer(s, {}), s.body(BodyId::bottom_layer).x = Drive::by(1000); },
         {"top layer only"});
}

// Something around the grains that fails at some exchange.
struct Failing : FluidCoupling {
  int at;
  bool in_remap;
  int exchanges = 0;
  static constexpr Index grains = 600;

  Failing(int exchange, bool remap) : at(exchange), in_remap(remap) {}
  bool stale() const override { return in_remap && exchanges >= at; }
  void remap(const GrainRow*, const BodyMotion&) override { throw error("no remap"); }
  void displace(Index, const GrainRow*) override {}
  WaterReaction solve(const BodyMotion&, double) override {
    if (++exchanges >= at && !in_remap) throw error("no solution");
    return {};
  }
  void push(Index chunk, const GrainRow*, WaterRow* force) override {
    const Index size = chunk_size(grains);
    std::fill(force + chunk * size, force + std::min(grains, (chunk + 1) * size), WaterRow{});
  }
};

// At any exchange; and an engine is good for another run afterwards. make(): what points to one.
template <class Make>
void expect_its_error(Make&& make) {
  Bed bed = cloud(Failing::grains, 0.26, 3);
  bed.scene.exchange_interval = 1;
  for (const bool in_remap : {false, true})
    for (const int at : {1, 2, 7, 40}) {
      Failing failing(at, in_remap);
      const auto engine = make();
      const auto run = [&] {
        (*engine).load(bed.scene, bed.state, &failing);
        (*engine).advance(40);
      };
      try {
        run();
        ADD_FAILURE() << "exchange " << at;
      } catch (const Error& e) {
        EXPECT_STREQ(e.what(), in_remap ? "no remap" : "no solution");
      }
      failing = Failing(1000, false);
      EXPECT_NO_THROW(run());
    }
}

// Also where several threads are under way.
TEST(SurroundingsThatFail, EndARunByTheirError) {
  for (const Backend backend : both_engines())
    for (const int threads : {1, 2, 4}) {
      SCOPED_TRACE(threads);
      expect_its_error([&] { return make_engine(backend, threads); });
    }
}

// On several ranks rank 0 has it.
TEST(SurroundingsThatFail, EndARunOnRanksByTheirError) {
  for (const int threads : {1, 2}) {
    SCOPED_TRACE(threads);
    expect_its_error([&] { return EngineOnRanks(3, threads); });
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
  for (ContactParameters& p : scene.contact) p.k_n = 1;  // too soft to stop it
  s.v[0].z = -10;
  expect_error(scene, s, {"grain 0 at step", "fell through the floor"}, 1000);
}

TEST_P(EngineErrors, PassedThroughTheTopWall) {
  State s = two();
  s.wall_z() = 0.05;
  s.v[0].z = 1e4;
  Scene scene = good();
  scene.body(BodyId::top_wall) = wall_at_rest();
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
