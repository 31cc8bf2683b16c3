// Grains sorted in memory anew while a stage is under way: the same bits on any number of threads, on the
// GPU's loop, after a restart from before and after, and where a stage is cut in two; and nothing in the
// series jumps.
#include "backends.hpp"
#include "case/case.hpp"
#include "coupling/pore_water.hpp"
#include "program.hpp"
#include "reference_bits.hpp"
#include "run/run.hpp"

namespace moraine {
namespace {

constexpr run::Ordering often{20, -1};  // at every look
constexpr run::Ordering never{std::int64_t{1} << 40};

struct Scene {
  const char* name;
  const char* start;  // "bed", "graded", or "" where keys have the grains
  const char* keys;
  const char* stage;
  double half = 0.0078125;  // s, of either part of the stage
  bool wet() const { return std::string(name).starts_with("wet"); }
};
void PrintTo(const Scene& scene, std::ostream* out) { *out << scene.name; }

constexpr const char* clay_and_quartz =
    "[grains]\nmaterial = \"clay\"\n[[material]]\nname = \"quartz\"\nmu_s = 0.6\nmu_d = 0.3\nlayer = [\"0 "
    "m\", "
    "\"0.15 m\"]\n[[material]]\nname = \"clay\"\ndensity = 1800\nk_n = 1.5e5\nmu_s = 0.2\ngamma_n = 3\n";
constexpr double short_time = 0.0009765625;  // s, of small steps
constexpr const char* thin_layers =
    "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\nbottom_layer = 0.04\ntop_layer = 0.06\n";
constexpr const char* shear = "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n";

const Scene scenes[] = {
    {"every_spring", "bed", "[contact]\nmu_roll = 0.2\nmu_twist = 0.1\ncohesion = 0.1\n",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\ngamma_n = 5\ngamma_t = 3\nmu_s = 0.6\nmu_d = "
     "0.3\n"},
    {"materials", "bed", clay_and_quartz, shear},
    {"graded", "graded", "", thin_layers, short_time},
    {"loads_that_change", "bed", "",
     "kind = \"shear\"\nprofile = \"cosine\"\nvelocity = { times = [0, 0.01, 0.1], values = [0.1, 0.3, 0.1] "
     "}\n"
     "normal_stress = { ramp = [2000, 3000], over = 0.05 }\n"},
    {"slope", "bed", "[model]\nslope = \"20 deg\"\n",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n"},
    {"dt_follows_the_bed", "bed", "[model]\ndt = \"auto\"\n", shear},
    {"pressed", "",
     "[box]\nperiodic = \"xyz\"\nfloor = false\n[grains]\nradius_mean = 0.01\nplacement = \"random\"\ncount "
     "= "
     "300\n[contact]\nk_n = 2e6\nk_t = 2e6\n[model]\ngravity = 0\nf = 0.15\n",
     "kind = \"press\"\npressure = 10000\nstrain_rate = 3\ngamma_n = 60\n"},
    {"wet", "bed", "[fluid]\nenabled = true\ncompressibility = 1e-6\nexchange_interval = 1\n", shear},
    {"wet_several_steps", "bed",
     "[fluid]\nenabled = true\ncompressibility = 1e-6\nexchange_interval = 7\n[model]\nf = 0.05\n", shear},
    {"wet_graded", "graded", "[fluid]\nenabled = true\ncompressibility = 1e-6\n", thin_layers, short_time},
};

std::string exactly(double number) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.17g", number);
  return digits;
}

class SortedOnTheWay : public Program, public testing::WithParamInterface<Scene> {
 protected:
  static void SetUpTestSuite() { beds_ = new TemporaryDirectory; }
  static void TearDownTestSuite() { delete beds_, beds_ = nullptr; }
  void SetUp() override {
    if (GetParam().wet() && !coupling::water_built()) GTEST_SKIP() << "this build has no pore water in it";
    const std::string start = GetParam().start;
    if (start.empty() || fs::exists(beds_->path() / start)) return;
    const std::string text = start == "bed" ? small_case() : graded_case();
    run(beds_->write(start + "/case.toml", "stages = [\"settle\", \"consolidate\"]\n" + text).parent_path());
  }

  // Stages one after another that together last as long.
  run::Options options(const std::string& name, const run::Ordering& ordering, int threads = 1,
                       int parts = 1) {
    const Scene& scene = GetParam();
    const std::string bed = "\"" + (beds_->path() / scene.start).string() + "\"\n";
    std::string text = *scene.start ? "extends = " + bed + "start = " + bed : "", names, stages;
    for (int k = 0; k < parts; ++k) {
      const std::string stage = "name = \"" + std::to_string(k) + "\"\n";
      names += (k ? ", \"" : "\"") + std::to_string(k) + "\"";
      stages += "[[stage]]\n" + stage + scene.stage + "duration = " + exactly(2 * scene.half / parts) + "\n";
    }
    text += "stages = [" + names + "]\n" + scene.keys + stages +
            "[output]\nseries_interval = " + exactly(scene.half / 4) +
            "\nsnapshot_interval = 1\ncheckpoint_interval = 100\n";
    run::Options options;
    options.directory = make(name, text), options.backend = dem::Backend::cpu, options.quiet = true;
    options.threads = threads, options.ordering = ordering;
    return options;
  }
  static Digests computed(const run::Options& options) {
    run::run_one(options, cases::load(options.directory, options.overrides));
    return digests_of(options.directory);
  }
  // Interrupted at more and more of its pauses, each of which leaves a checkpoint, until it ends.
  Digests computed_in_pieces() {
    struct Interrupted {};
    run::Options options = this->options("pieces", often);
    options.overrides.push_back({"checkpoint_interval", "1e-9"});
    for (int pieces = 1;; ++pieces) {
      int looks = 0;
      options.on_progress = [&](auto...) {
        if (++looks == 1 + 4 * pieces) throw Interrupted();
      };
      try {
        const Digests digests = computed(options);
        EXPECT_GT(pieces, 1) << "never interrupted";
        return digests;
      } catch (const Interrupted&) {
        options.resume = true;
      }
    }
  }

 private:
  static inline TemporaryDirectory* beds_ = nullptr;
};

TEST_P(SortedOnTheWay, SameBits) {
  const Digests one = computed(options("one", often));
  EXPECT_EQ(one, computed(options("two", often, 2))) << "two threads";
  EXPECT_EQ(one, computed_in_pieces()) << "interrupted";
  for (const dem::Backend backend : gpu_loops()) {
    run::Options with = options("loop", often);
    with.backend = backend, with.force = true;
    EXPECT_EQ(one, computed(with)) << "the GPU's loop";
  }
  const Digests cut = computed(options("cut", often, 1, 2));
  if (std::string(GetParam().name) == "pressed") return;  // begins anew with each stage
  for (std::size_t k = 1; k < parts.size(); ++k) EXPECT_EQ(one[k], cut[k]) << parts[k] << ", cut in two";
}

// Only rounding parts it from the run whose grains stay where they are in memory.
TEST_P(SortedOnTheWay, NothingJumps) {
  const run::Options sorted = options("sorted", often), plain = options("plain", never);
  computed(sorted), computed(plain);
  EXPECT_NE(output::read_checkpoint(checkpoint_of(sorted.directory)).state.id,
            output::read_checkpoint(checkpoint_of(plain.directory)).state.id);
  const auto a = output::read_series(series_of(sorted.directory)),
             b = output::read_series(series_of(plain.directory));
  ASSERT_EQ(a.size(), b.size());
  constexpr std::size_t numbers = sizeof(output::Row) / sizeof(double);
  using Numbers = std::array<double, numbers>;
  Numbers largest{};
  for (const output::Row& row : b) {
    const auto of_row = std::bit_cast<Numbers>(row);
    for (std::size_t c = 0; c < numbers; ++c) largest[c] = std::max(largest[c], std::abs(of_row[c]));
  }
  const auto column = [](double output::Row::*which) {
    const output::Row row{};
    return (reinterpret_cast<const char*>(&(row.*which)) - reinterpret_cast<const char*>(&row)) /
           sizeof(double);
  };
  largest[column(&output::Row::water_balance)] = largest[column(&output::Row::water_volume)];
  for (std::size_t k = 0; k < a.size(); ++k)
    for (std::size_t c = 0; c < numbers; ++c)
      EXPECT_NEAR(std::bit_cast<Numbers>(a[k])[c], std::bit_cast<Numbers>(b[k])[c], 1e-6 * largest[c])
          << output::columns()[c].name << ", row " << k;
}

// By the rule of a run, looked at more often: a bed that shears far is sorted, one that is pressed is not.
TEST_F(Program, OnlyWhatHasLostItsOrderIsSorted) {
  run(make("bed", "stages = [\"settle\", \"consolidate\"]\n" + small_case()));
  const auto ids = [&](const std::string& name, const std::string& stage, std::int64_t steps) {
    run::Options options;
    options.directory =
        make(name,
             "extends = \"../bed\"\nstart = \"../bed\"\nstages = [\"one\"]\n[[stage]]\nname = "
             "\"one\"\nnormal_stress = 2000\n" +
                 stage);
    options.quiet = true, options.threads = 1, options.ordering.steps = steps;
    run::run_one(options, cases::load(options.directory));
    return output::read_checkpoint(checkpoint_of(options.directory)).state.id;
  };
  const std::string far = "kind = \"shear\"\nstrain_rate = 5\nstrain = 1.5\n",
                    pressed =
                        "kind = \"consolidate\"\nduration = 0.05\nwall_gamma_n = 40\nwall_gamma_t = 40\n";
  EXPECT_NE(ids("far", far, 200), ids("far_never", far, never.steps));
  EXPECT_EQ(ids("pressed", pressed, 20), ids("pressed_never", pressed, never.steps));
}

INSTANTIATE_TEST_SUITE_P(EveryScene, SortedOnTheWay, testing::ValuesIn(scenes),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace moraine
