// The same scene gives the same bits, whatever computes it.
#include "backends.hpp"
#include "physics/named_beds.hpp"
#include "physics/same_bits.hpp"

namespace moraine::dem {
namespace {

constexpr std::int64_t steps = 800;  // some neighbour searches, many near lists

const std::vector<NamedBed>& scenes() {
  static const std::vector<NamedBed> all = named_beds(settled_bed(), walled_bed(), graded_bed());
  return all;
}
State one_thread(const Bed& bed) { return run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, steps); }

class Determinism : public OnEveryBackend {};

TEST_P(Determinism, EveryBackendGivesTheSameBits) {
  const auto engine = make();
  for (const NamedBed& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    expect_same_bits(run(*engine, scene.bed.scene, scene.bed.state, steps), one_thread(scene.bed));
  }
}

// A state taken on the way into a new engine goes on as if nothing had been. In pieces, too.
TEST_P(Determinism, RunAndRestart) {
  for (const NamedBed& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State whole = run(*make(), scene.bed.scene, scene.bed.state, steps);
    const State part = run(*make(), scene.bed.scene, scene.bed.state, steps / 3);
    const auto second = make();
    second->load(scene.bed.scene, part);
    expect_same_bits(second->state(), part);
    second->advance(100);
    expect_same_bits(run(*make(), scene.bed.scene, second->state(), steps - steps / 3 - 100), whole);
  }
}

TEST_P(Determinism, NeighbourMargin) {
  for (const NamedBed& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State usual = run(*make(), scene.bed.scene, scene.bed.state, steps);
    double mean = 0;
    for (const double r : usual.r) mean += r / usual.size();
    for (const double factor : {0.5, 2.0}) {
      Scene s = scene.bed.scene;
      s.neighbour_margin = factor * 0.05 * mean;
      expect_same_bits(run(*make(), s, scene.bed.state, steps), usual);
    }
  }
}

ON_EVERY_BACKEND(Determinism);

// While grains fall, land and come to rest, lists run out in every way there is: by bounds on speeds, by how
// far grains have moved, by pairs that touch. Without a margin of its own the scene has one that follows the
// clock.
TEST(Lists, OutlastAFall) {
  for (const bool walls : {false, true}) {
    const auto settled = [&](double margin) {
      const double r = 0.01;
      return walls ? column_between_walls(300, 5, 0.4, 12000, margin * r).state
                   : bed_after(12000, margin * r).state;
    };
    const State usual = settled(0);
    for (const double margin : {0.01, 0.05, 0.3}) {
      SCOPED_TRACE(margin);
      expect_same_bits(settled(margin), usual);
    }
  }
}

// Pairs four at a time and, where the processor has AVX-512, eight at a time.
TEST(Lanes, FourOrEight) {
  const auto name = [] {
    const auto engine = make_engine(Backend::cpu, 1);
    return engine->describe();
  };
  if (name().find("AVX-512") == std::string::npos) GTEST_SKIP() << "no AVX-512 here";
  for (const NamedBed& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State eight = run(*make_engine(Backend::cpu, 1), scene.bed.scene, scene.bed.state, steps);
    ::setenv("MORAINE_SIMD", "avx2", 1);
    EXPECT_EQ(name().find("AVX-512"), std::string::npos);
    const State four = run(*make_engine(Backend::cpu, 1), scene.bed.scene, scene.bed.state, steps);
    ::unsetenv("MORAINE_SIMD");
    expect_same_bits(four, eight);
  }
}

// The GPU's loop on several blocks, which wait for each other once a step. A small margin makes all of them
// leave again and again for new neighbours.
TEST(Blocks, OneTwoFour) {
  for (const NamedBed& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State& start = scene.bed.state;
    const State by_pairs = run(*make_engine(Backend::cpu, 1), scene.bed.scene, start, 200);
    Scene narrow = scene.bed.scene;
    const auto [smallest, largest] = std::minmax_element(start.r.begin(), start.r.end());
    narrow.neighbour_margin = 0.02 * (*largest < 4 * *smallest ? *largest : *smallest);
    for (const int blocks : {1, 2, 4}) {
      const auto engine = make_engine(Backend::reference, blocks);
      engine->load(narrow, start);
      for (int k = 0; k < 20; ++k) engine->advance(1);
      engine->advance(180);
      expect_same_bits(engine->state(), by_pairs);
      EXPECT_GT(engine->counts().rebuilds, 1);
    }
  }
}

TEST(Threads, OneToSeven) {
  for (const NamedBed& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State one = one_thread(scene.bed);
    expect_same_bits(one_thread(scene.bed), one);  // and twice the same
    for (const int threads : {2, 3, 4, 7}) {
      if (threads == 7 && scene.bed.state.r != graded_bed().state.r) continue;
      expect_same_bits(run(*make_engine(Backend::cpu, threads), scene.bed.scene, scene.bed.state, steps),
                       one);
    }
  }
}

}  // namespace
}  // namespace moraine::dem
