// The same scene gives the same bits, whatever computes it.
#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

constexpr std::int64_t steps = 800;  // some neighbour searches, many near lists

struct Named {
  const char* name;
  Bed bed;
};
void damp_grains(Scene& s, double gamma) {
  s.with(Material::grain).gamma_n = s.with(Material::grain).gamma_t = gamma;
}
const std::vector<Named>& scenes() {
  static const std::vector<Named> all = [] {
    std::vector<Named> a{{"sheared bed, damped walls", sheared_bed()},
                         {"softening", sheared_bed()},
                         {"layer driven by stress", sheared_bed()},
                         {"held height", sheared_bed()},
                         {"swinging load, walls with k_t = 0, no ledger", sheared_bed()},
                         {"damped grains", sheared_bed()},
                         {"no friction", sheared_bed()},
                         {"cloud", cloud(700, 0.2, 5)},
                         {"small box", cloud(22, 0.065, 5)},
                         {"a side wall moves in", squeezed_bed()},
                         {"sheared along side walls", sheared_between_walls()}};
    for (ContactParameters& p : a[1].bed.scene.contact) p.mu_d = 0.3;
    drive_top_layer(a[2].bed.scene, Drive::by(400));
    damp_grains(a[2].bed.scene, 5);
    drive_top_layer(a[3].bed.scene, Drive::at(0.2), true);
    Drive& load = a[4].bed.scene.body(BodyId::top_wall).z;
    load.amplitude = 200, load.frequency = 30;
    a[4].bed.scene.with(Material::wall).k_t = 0, a[4].bed.scene.ledger = false;
    damp_grains(a[5].bed.scene, 5);
    for (ContactParameters& p : a[6].bed.scene.contact) p.mu_s = p.mu_d = 0;
    return a;
  }();
  return all;
}

State one_thread(const Bed& bed) { return run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, steps); }

class Determinism : public OnEveryBackend {};

TEST_P(Determinism, EveryBackendGivesTheSameBits) {
  const auto engine = make();
  for (const Named& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    expect_same_bits(run(*engine, scene.bed.scene, scene.bed.state, steps), one_thread(scene.bed));
  }
}

// A state taken on the way into a new engine goes on as if nothing had been. In pieces, too.
TEST_P(Determinism, RunAndRestart) {
  for (const Named& scene : scenes()) {
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
  for (const Named& scene : scenes()) {
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

// The GPU's loop on several blocks, which wait for each other once a step. A small margin makes all of them
// leave again and again for new neighbours.
TEST(Blocks, OneTwoFour) {
  for (const Named& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State& start = scene.bed.state;
    const State by_pairs = run(*make_engine(Backend::cpu, 1), scene.bed.scene, start, 200);
    Scene narrow = scene.bed.scene;
    narrow.neighbour_margin = 0.02 * *std::max_element(start.r.begin(), start.r.end());
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

TEST(Threads, OneToFour) {
  for (const Named& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State one = one_thread(scene.bed);
    expect_same_bits(one_thread(scene.bed), one);  // and twice the same
    for (const int threads : {2, 3, 4})
      expect_same_bits(run(*make_engine(Backend::cpu, threads), scene.bed.scene, scene.bed.state, steps),
                       one);
  }
}

}  // namespace
}  // namespace moraine::dem
