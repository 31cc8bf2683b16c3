// Pore water in cases from start to end; what of it needs a build with pore water is skipped in others.
#include <cmath>
#include <csignal>
#include <thread>

#include "case/case.hpp"
#include "coupling/pore_water.hpp"
#include "output/hdf5.hpp"
#include "program.hpp"
#include "run/schedule.hpp"
#include "run/stages.hpp"

namespace moraine {
namespace {

using namespace std::chrono_literals;

// A bed some five grains high: settled dry, consolidated with a drained top, sheared shut. The water is soft,
// so that grains meet it only every few steps.
std::string wet_case() {
  return R"(
[grains]
count = 300
columns_x = 5
columns_y = 5
cell = 1.1
seed = 3
[contact]
k_n = "2e5 N/m"
k_t = "2e5 N/m"
mu_s = 0.5
[wall]
mass = "2 kg"
[model]
f = 0.1
[fluid]
compressibility = "1e-6 1/Pa"
permeability_factor = "1e-8 m2"
[[stage]]
name = "settle"
kind = "settle"
duration = "0.4 s"
f = 0.2
gamma_n = 20
wall_gamma_n = 40
wall_gamma_t = 40
[[stage]]
name = "consolidate"
kind = "consolidate"
normal_stress = "2 kPa"
duration = "0.15 s"
gamma_n = 20
wall_gamma_n = 40
wall_gamma_t = 40
fluid = true
[[stage]]
name = "shear"
kind = "shear"
normal_stress = "2 kPa"
strain_rate = "0.5 1/s"
strain = 0.05
fluid = true
fluid_top = "impermeable"
[output]
series_interval = "0.01 s"
snapshot_interval = "0.05 s"
checkpoint_interval = "0.02 s"
)";
}

std::vector<output::Row> rows_of_stage(const fs::path& run, int stage) {
  std::vector<output::Row> own;
  for (const output::Row& r : output::read_series(series_of(run)))
    if (r.stage == stage) own.push_back(r);
  return own;
}

output::hdf5::File open_file(const fs::path& path) { return output::hdf5::File::open(path, H5F_ACC_RDONLY); }

class Water : public Program {
 protected:
  void SetUp() override {
    if (!coupling::water_built()) GTEST_SKIP() << "this build has no pore water in it";
  }
};

TEST_F(Water, FromADryBedToUndrainedShear) {
  const fs::path wet = make("wet", wet_case());
  ASSERT_NO_FATAL_FAILURE(run(wet));
  const auto end = output::read_checkpoint(checkpoint_of(wet));
  const std::int64_t m = end.scene.exchange_interval;
  ASSERT_GT(m, 0);
  EXPECT_EQ(end.scene.fluid_density, 1000);
  EXPECT_FALSE(end.water.q.empty());

  for (const output::Row& r : rows_of_stage(wet, 0)) {
    EXPECT_EQ(r.water_volume, 0);
    EXPECT_EQ(r.total_friction, r.shear_friction);
  }
  for (int stage : {1, 2})
    for (const output::Row& r : rows_of_stage(wet, stage)) {
      EXPECT_GT(r.water_volume, 0);
      EXPECT_LT(std::abs(r.water_balance), 1e-9 * r.water_volume);
      EXPECT_TRUE(std::isfinite(r.total_friction));
      EXPECT_LE(r.water_pressure_min, r.water_pressure_mean);
      EXPECT_LE(r.water_pressure_mean, r.water_pressure_max);
      const double total = r.normal_stress + r.wall_water_pressure;
      if (total > 0) {
        EXPECT_DOUBLE_EQ(r.total_friction, r.shear_stress / total);
      }
      EXPECT_LT(std::abs(r.residue), 0.1);
    }
  const auto drained = rows_of_stage(wet, 1), shut = rows_of_stage(wet, 2);
  EXPECT_NE(drained.back().water_drained_top, 0);
  EXPECT_LT(std::abs(shut.back().water_drained_top), 1e-15 * shut.back().water_volume);
  EXPECT_NE(shut.back().wall_water_pressure, 0);
  for (const output::Row& r : shut) EXPECT_EQ(static_cast<std::int64_t>(r.step) % m, 0);
  EXPECT_NEAR(shut.back().stage_time, 0.1, 0.5 * static_cast<double>(m) * end.scene.dt * 1.001);

  const auto file = open_file(snapshots_of(wet).back());
  EXPECT_TRUE(file.holds("water"));
  EXPECT_TRUE(file.open_group("grains").holds("water_force"));
  EXPECT_FALSE(open_file(snapshots_of(wet).front()).holds("water"));
  for (const char* name : {"water.xdmf", "bed.xdmf"})
    EXPECT_TRUE(fs::exists(wet / "output/snapshots" / name)) << name;
  const std::string log = contents(wet / "output/log.txt");
  for (const char* word : {"water: ", "stable up to", "of it taken"})
    EXPECT_NE(log.find(word), std::string::npos) << word;
}

TEST_F(Water, SameBitsAfterAnyBreak) {
  const fs::path whole = make("whole", wet_case()), cut = make("cut", wet_case());
  ASSERT_NO_FATAL_FAILURE(run(whole));
  int breaks = 0;
  for (bool over = false; !over && breaks < 40; ++breaks) {
    auto words = to_run(cut);
    if (fs::exists(cut / "output")) words.push_back("--resume");
    const auto process = start(words);
    for (int k = 0; k < 500 && !fs::exists(checkpoint_of(cut)); ++k) std::this_thread::sleep_for(1ms);
    std::this_thread::sleep_for(15ms + 17ms * breaks);
    process->send(breaks % 2 ? SIGKILL : SIGTERM);
    over = process->wait() == 0;
  }
  EXPECT_GT(breaks, 1);
  if (breaks == 40) {
    ASSERT_NO_FATAL_FAILURE(run(cut, {}, {"--resume"}));
  }
  expect_same_results(whole, cut);
}

TEST_F(Water, OnAnyNumberOfThreads) {
  const fs::path one = make("one", wet_case()), two = make("two", wet_case());
  ASSERT_NO_FATAL_FAILURE(run(one, {}, {"--threads", "1"}));
  ASSERT_NO_FATAL_FAILURE(run(two, {}, {"--threads", "2"}));
  expect_same_results(one, two);
}

// Pressures go on from stage to stage, and from a case to the one that starts from it; a dry stage ends them.
TEST_F(Water, PressuresGoOn) {
  const fs::path first = make("first", "stages = [\"settle\", \"consolidate\", \"shear\"]\n" + wet_case());
  ASSERT_NO_FATAL_FAILURE(run(first));
  const double left = rows_of_stage(first, 2).back().water_stored;
  ASSERT_GT(left, 0);
  const fs::path next = make("next", "start = \"../first\"\nstages = [\"shear\"]\n" + wet_case());
  ASSERT_NO_FATAL_FAILURE(run(next));
  EXPECT_NEAR(rows_of_stage(next, 0).front().water_stored / left, 1, 0.2);

  const fs::path dry = make("dry", "start = \"../first\"\n" + wet_case());
  ASSERT_NO_FATAL_FAILURE(run(dry, {"stages=[\"consolidate\"]", "stage.consolidate.fluid=false"}));
  EXPECT_TRUE(output::read_checkpoint(checkpoint_of(dry)).water.q.empty());
}

TEST_F(Water, RefusesAnUnstableInterval) {
  const fs::path wet = make("wet", "stages = [\"settle\"]\n" + wet_case());
  expect_error(to_run(wet, {"stage.settle.fluid=true", "fluid.exchange_interval=1000"}),
               {"fluid.exchange_interval = 1000: unstable", "expected at most"});
  EXPECT_FALSE(fs::exists(wet / "output"));
}

TEST_F(Water, RefusesTooManyCellsAndTooShortAStage) {
  const fs::path wet = make("wet", "stages = [\"settle\"]\n" + wet_case());
  expect_error(to_run(wet, {"stage.settle.fluid=true", "fluid.cells_x=4294967304"}),
               {"cells along x", "at most a million", "fluid.cells_x"});
  expect_error(to_run(wet, {"stage.settle.fluid=true", "fluid.cell=1e-9"}), {"cells along x", "fluid.cell"});
  expect_error(to_run(wet, {"stage.settle.fluid=true", "stage.settle.duration=1e-9"}),
               {"stage settle: lasts 1e-09 s", "between two exchanges", "longer stage"});
  EXPECT_FALSE(fs::exists(wet / "output"));
}

TEST_F(Water, WarnsOfCellsThatMeasurePores) {
  const fs::path wet = make("wet", wet_case());
  const Outcome o = moraine({"check", wet.string(), "--threads", "1", "--set", "fluid.cells_x=5"});
  ASSERT_EQ(o.status, 0) << o.err;
  EXPECT_NE(o.out.find("along x"), std::string::npos) << o.out;
  EXPECT_NE(o.out.find("measure pores"), std::string::npos) << o.out;
}

TEST_F(Water, WarnsOfGrainsLargerThanCells) {
  const fs::path wet = make("wet", "stages = [\"settle\"]\n" + wet_case());
  const auto check = [&](const char* spread) {  // without damping, which the smallest of them would not bear
    std::vector<std::string> words{"check", wet.string(), "--threads", "1"};
    for (const char* set : {"fluid=true", "gamma_n=0", "wall_gamma_n=0", "wall_gamma_t=0"})
      words.insert(words.end(), {"--set", std::string("stage.settle.") + set});
    words.insert(words.end(),
                 {"--set", "grains.radius_mean=0.01", "--set", std::string("grains.radius_std=") + spread});
    return moraine(words).out;
  };
  const std::string equal = check("0"), mixed = check("0.01");
  EXPECT_NE(equal.find("the largest grain is 1 d"), std::string::npos) << equal;
  EXPECT_EQ(equal.find("the largest grain ("), std::string::npos) << equal;
  for (const char* word :
       {"the largest grain (", "is wider than the grid cells of", "m along z", "expected cells of at least"})
    EXPECT_NE(mixed.find(word), std::string::npos) << mixed;
  EXPECT_EQ(mixed.find("measure pores"), std::string::npos) << mixed;
}

TEST(SauterDiameter, IsOfVolumeOverSurface) {
  dem::State s;
  s.r.assign(1000, 0.01), s.r.push_back(0.1);
  EXPECT_NEAR(run::sauter_diameter(s), 2 * (1000e-6 + 1e-3) / (1000e-4 + 1e-2), 1e-15);
  EXPECT_NEAR(run::mean_diameter(s), 2 * 10.1 / 1001, 1e-15);
}

TEST_F(Water, TakesTheSauterMeanForPermeability) {
  const fs::path wet = make("wet", wet_case());
  const Outcome o = moraine({"check", wet.string(), "--threads", "1", "--set", "fluid.permeability_factor=0",
                             "--set", "grains.radius_std=0.003"});
  ASSERT_EQ(o.status, 0) << o.err;
  const auto number = [&](const std::string& after) {
    const auto at = o.out.find(after);
    return at == std::string::npos ? 0.0 : std::stod(o.out.substr(at + after.size()));
  };
  const double mean = number("mean diameter "), sauter = number("Sauter mean diameter d = "),
               k_c = number("k_c ");
  EXPECT_GT(sauter, 1.01 * mean) << o.out;
  EXPECT_NEAR(k_c / (sauter * sauter / 180), 1, 0.01) << o.out;  // three digits
}

// The bed slumps over sides that hold nothing.
TEST_F(Water, SaysThatGrainsLeaveByOpenSides) {
  const fs::path open = make("open", "stages = [\"settle\"]\n" + wet_case());
  const std::vector<std::string> with{"stage.settle.fluid=true", "box.periodic=y", "fluid.x_low=pressure",
                                      "fluid.x_high=pressure"};
  ASSERT_NO_FATAL_FAILURE(run(open, with));
  const std::string log = contents(open / "output/log.txt");
  for (const char* word :
       {"warning: stage settle: the sides x = 0 and x = ", "(box.periodic = \"y\")",
        "expected box.periodic = \"xy\"", "warning: outside the water: ", "beyond x = 0 m"})
    EXPECT_NE(log.find(word), std::string::npos) << word << "\n" << log;
  for (const char* word : {"sides y = 0", "no_flow", "no water can take"})
    EXPECT_EQ(log.find(word), std::string::npos) << word << "\n" << log;
  const auto rows = rows_of_stage(open, 0);
  EXPECT_GT(rows.back().water_volume, rows.front().water_volume);
  EXPECT_LT(std::abs(rows.back().water_balance), 1e-12 * rows.back().water_volume);
}

TEST_F(Water, WarnsOfTightSidesThatHoldNoGrains) {
  const fs::path open = make("open", wet_case());
  const Outcome o = moraine({"check", open.string(), "--threads", "1", "--set", "box.periodic=x"});
  ASSERT_EQ(o.status, 0) << o.err;
  EXPECT_NE(o.out.find("where fluid.y_low and fluid.y_high = \"no_flow\""), std::string::npos) << o.out;
}

TEST_F(Water, WarnsOfGrainsAboveTheGrid) {
  const fs::path wet = make("wet", "stages = [\"settle\"]\n" + wet_case());
  const Outcome o = moraine({"check", wet.string(), "--threads", "1", "--set", "stage.settle.fluid=true",
                             "--set", "fluid.height=0.1"});
  ASSERT_EQ(o.status, 0) << o.err;
  for (const char* word : {"outside the grid of the water", "beyond z = 0.1 m", "fluid.height"})
    EXPECT_NE(o.out.find(word), std::string::npos) << o.out;
}

TEST_F(Water, ChecksACase) {
  const fs::path wet = make("wet", wet_case());
  const Outcome o = moraine({"check", wet.string(), "--threads", "1"});
  ASSERT_EQ(o.status, 0) << o.err;
  for (const char* word : {"exchange", "stable up to", "D = k/(mu phi beta)", "diffusion number",
                           "c_v = ", "R = K_f/(phi M)", "Skempton B", "strain rate x H^2/c_v", "drained"})
    EXPECT_NE(o.out.find(word), std::string::npos) << word << "\n" << o.out;
}

TEST_F(Water, SaysWhatFewCellsCost) {
  const fs::path wet = make("wet", wet_case());
  const auto checked = [&](int cells, const char* top) {
    const Outcome o = moraine({"check", wet.string(), "--threads", "1", "--set", "stages=[\"consolidate\"]",
                               "--set", "fluid.cells_z=" + std::to_string(cells), "--set",
                               std::string("stage.consolidate.fluid_top=") + top});
    EXPECT_EQ(o.status, 0) << o.err;
    return o.out;
  };
  const char* words = "so few over the height even out the pressure";
  EXPECT_NE(checked(3, "drained").find("even out the pressure 4.57 % too fast (fluid.cells_z = 5: 1.64 %)"),
            std::string::npos);
  EXPECT_EQ(checked(5, "drained").find(words), std::string::npos);
  EXPECT_EQ(checked(3, "impermeable").find(words), std::string::npos);
}

// Floor, grains and contacts of a record bear the same load, whatever the interval.
TEST_F(Water, RecordsBearOneLoad) {
  const fs::path wet = make("wet", wet_case());
  ASSERT_NO_FATAL_FAILURE(run(wet, {"stages=[\"settle\"]", "stage.settle.fluid=true", "stage.settle.f=0.1",
                                    "stage.settle.duration=0.3"}));
  const auto end = output::read_checkpoint(checkpoint_of(wet));
  ASSERT_GT(end.scene.exchange_interval, 1);
  const auto grains = open_file(snapshots_of(wet).back()).open_group("grains");
  double on_grains = 0;
  std::vector<dem::Vec3d> force;
  grains.read("force", force);
  for (const dem::Vec3d& f : force) on_grains += f.z;
  const double stress = rows_of_stage(wet, 0).back().normal_stress;
  EXPECT_GT(stress, 0);
  EXPECT_NEAR(on_grains / end.scene.area() / stress, 1, 1e-9);
  const double alone = dem::observe(end.scene, end.state).normal_stress;
  EXPECT_NE(stress, alone);
}

// Without the libraries a wet case is refused before anything is written, whichever of its stages is wet.
TEST_F(Program, RefusesWaterThatIsNotBuilt) {
  if (coupling::water_built()) GTEST_SKIP() << "this build has pore water in it";
  const fs::path wet = make("wet", wet_case());
  expect_error(to_run(wet), {"no pore water in it", "MORAINE_FLUID", "fluid.enabled"});
  EXPECT_FALSE(fs::exists(wet / "output"));
}

// Whatever the interval, records, snapshots and the end are exchanges, each the nearest to its time, and each
// once.
TEST(WaterSchedule, EventsAreExchanges) {
  for (const std::int64_t m : {1, 2, 7, 64}) {
    run::Stage stage{};
    stage.scene.dt = 1.37e-4, stage.scene.exchange_interval = m;
    stage.end = 0.2, stage.series_interval = 0.01, stage.snapshot_interval = 0.05;
    const double span = static_cast<double>(m) * stage.scene.dt;
    std::int64_t step = 0;
    int series = 0, snapshots = 0;
    for (bool ended = false; !ended;) {
      const run::Event event = run::next_event(stage, step);
      ASSERT_GT(event.step, step);
      ASSERT_EQ(event.step % m, 0);
      EXPECT_LE(std::abs(stage.scene.time(event.step) - event.time), 0.5001 * span) << event.time;
      step = event.step, ended = event.end;
      series += event.series, snapshots += event.snapshot;
    }
    EXPECT_EQ(series, 20) << m;
    EXPECT_EQ(snapshots, 4) << m;
    EXPECT_EQ(step, run::last_step(stage));
    EXPECT_EQ(run::at_exchange(stage, step), step);
    EXPECT_EQ(run::at_exchange(stage, m + 1), m == 1 ? 2 : 2 * m);
  }
}

}  // namespace
}  // namespace moraine
