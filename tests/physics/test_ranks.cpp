// The same scene gives the same bits on any number of ranks.
#include "backends.hpp"
#include "dem/sums.hpp"
#include "error.hpp"
#include "physics/named_beds.hpp"
#include "physics/same_bits.hpp"
#include "thread_ranks.hpp"

namespace moraine::dem {
namespace {

constexpr std::int64_t steps = 800;

const std::vector<NamedBed>& scenes() {
  static const std::vector<NamedBed> all = [] {
    auto beds = named_beds(settled_bed(), walled_bed(), graded_bed());
    beds.push_back({"cloud of seven chunks", cloud(850, 0.2, 5)});
    return beds;
  }();
  return all;
}
State one_rank(const Bed& bed) { return run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, steps); }

TEST(Ranks, OneToSeven) {
  int seven = 0;
  for (const NamedBed& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State one = one_rank(scene.bed);
    const Index chunks = chunk_count(scene.bed.state.size());
    for (const int ranks : {2, 3, 4, 7}) {
      if (ranks > chunks) continue;
      SCOPED_TRACE(ranks);
      EngineOnRanks engine(ranks, ranks % 2 + 1);
      expect_same_bits(run(*engine, scene.bed.scene, scene.bed.state, steps), one);
      EXPECT_TRUE(engine.all_have_come());
      seven += ranks == 7;
    }
  }
  EXPECT_GT(seven, 0);
}

// Parts of a state, taken on the way, go on as if nothing had been, on other numbers of ranks, too.
TEST(Ranks, RunAndRestart) {
  for (const NamedBed& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    const State one = one_rank(scene.bed);
    if (chunk_count(scene.bed.state.size()) < 3) continue;
    EngineOnRanks three(3, 1), two(2, 1);
    const State part = run(*three, scene.bed.scene, scene.bed.state, 300);
    two->load(scene.bed.scene, part);
    expect_same_bits(two->state(), part);
    two->advance(1);
    expect_same_bits(run(*make_engine(Backend::cpu, 1), scene.bed.scene, two->state(), steps - 301), one);
  }
}

// A margin that is soon crossed: grains become ghosts and cease to be.
TEST(Ranks, ManySearches) {
  for (const NamedBed& scene : scenes()) {
    if (chunk_count(scene.bed.state.size()) < 2) continue;
    SCOPED_TRACE(scene.name);
    Scene narrow = scene.bed.scene;
    narrow.neighbour_margin = 0.01 * *std::ranges::min_element(scene.bed.state.r);
    EngineOnRanks two(2, 1);
    expect_same_bits(run(*two, narrow, scene.bed.state, steps), one_rank({narrow, scene.bed.state}));
  }
}

// Contacts that the state does not know of yet make one rank's part heavier; it then gives chunks away.
TEST(Ranks, DealChunksAnew) {
  const double r = 0.01;
  std::vector<Vec3d> x;
  for (int k = 0; k < 256; ++k)  // close together, then far apart
    x.push_back({1.98 * r * (k % 8 + 1), 1.98 * r * (k / 8 % 8 + 1), 1.98 * r * (k / 64 + 1)});
  for (int k = 0; k < 384; ++k)
    x.push_back({4 * r * (k % 8 + 0.5), 4 * r * (k / 8 % 8 + 0.5), 4 * r * (k / 64 + 4)});
  Bed bed{{}, grains_at_rest(std::vector<double>(x.size(), r), x)};
  bed.scene.box = {32 * r, 32 * r, 60 * r};
  bed.scene.periodic_z = true, bed.scene.body(BodyId::floor) = {}, bed.scene.gravity = 0;
  bed.scene.contact.fill(LinearContact{1e5, 1e5, 0, 0, 0.5, 0.5});
  bed.scene.dt = 0.1 * std::sqrt(mass(bed.scene, r) / 1e5);
  EngineOnRanks two(2, 1);
  two->load(bed.scene, bed.state);
  const double before = two->counts().most_work;
  EXPECT_GT(before, 1.3);
  two->advance(20);
  EXPECT_LT(two->counts().most_work, 0.5 + 0.5 * before);
  two->advance(20);
  expect_same_bits(two->state(), run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, 40));
}

TEST(Ranks, TooFewGrains) {
  const Bed& bed = settled_bed();
  EngineOnRanks many(chunk_count(bed.state.size()) + 1, 1);
  try {
    many->load(bed.scene, bed.state);
    FAIL() << "expected an Error";
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("too few grains for"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find("start it on at most"), std::string::npos) << e.what();
  }
}

// However far it flies, and however often that asks for a search.
TEST(Ranks, AGrainThatFliesFarOff) {
  Bed bed = settled_bed();
  bed.state.v.back() = {0, 0, 1e9};
  EngineOnRanks two(2, 1);
  expect_same_bits(run(*two, bed.scene, bed.state, 50),
                   run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, 50));
}

// One rank finds it, all stop, and can be used again.
TEST(Ranks, AGrainThatIsLost) {
  Bed bed = cloud(600, 0.26, 3);
  bed.state.v.back().y = std::nan("");
  std::string alone;
  try {
    run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, steps);
  } catch (const Error& e) {
    alone = e.what();
  }
  EXPECT_FALSE(alone.empty());
  EngineOnRanks two(2, 1);
  try {
    run(*two, bed.scene, bed.state, steps);
    FAIL() << "expected an Error";
  } catch (const Error& e) {
    EXPECT_EQ(e.what(), alone);
  }
  const Bed& well = settled_bed();
  expect_same_bits(run(*two, well.scene, well.state, 100),
                   run(*make_engine(Backend::cpu, 1), well.scene, well.state, 100));
}

}  // namespace
}  // namespace moraine::dem
