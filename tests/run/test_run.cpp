// Cases from start to end, through the program.
#include <cmath>
#include <regex>
#include <thread>

#include "output/hdf5.hpp"
#include "program.hpp"

namespace moraine {
namespace {

using namespace std::chrono_literals;

std::vector<output::Row> rows_of_stage(const fs::path& run, std::size_t stage) {
  std::vector<output::Row> own;
  for (const output::Row& r : output::read_series(series_of(run)))
    if (r.stage == static_cast<double>(stage)) own.push_back(r);
  return own;
}

bool all_finite(const output::Row& row) {
  const auto numbers = std::bit_cast<std::array<double, sizeof(output::Row) / sizeof(double)>>(row);
  return std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); });
}

std::string with(std::string text, const std::string& old, const std::string& now) {
  return text.replace(text.find(old), old.size(), now);
}

// The small case, settled and consolidated.
std::string until_consolidated() { return "stages = [\"settle\", \"consolidate\"]\n"; }

TEST_F(Program, RunsFromSettlingToShear) {
  const fs::path small = make("small", small_case());
  const Outcome o = moraine(to_run(small));
  ASSERT_EQ(o.status, 0) << o.err;
  for (const char* word : {"settle", "consolidate", "shear", "friction", "dilation", "residue"})
    EXPECT_NE(o.out.find(word), std::string::npos) << o.out;
  for (const char* name : {"series.h5", "checkpoint.h5", "log.txt", "case.toml", "snapshots/grains.xdmf",
                           "snapshots/contacts.xdmf", "snapshots/03-shear-000002.h5"})
    EXPECT_TRUE(fs::exists(small / "output" / name)) << name;
  for (const auto& entry : fs::recursive_directory_iterator(small / "output"))
    EXPECT_NE(entry.path().extension(), ".tmp") << entry.path();

  const auto rows = output::read_series(series_of(small));
  for (const output::Row& r : rows) ASSERT_TRUE(all_finite(r)) << "t = " << r.time << " s";
  const auto sheared = rows_of_stage(small, 2);
  ASSERT_GT(sheared.size(), 15u);
  EXPECT_NEAR(sheared.front().normal_stress, 2000, 1000);
  EXPECT_NEAR(sheared.back().shear_strain, 0.2, 1e-3);
  EXPECT_NEAR(sheared.back().stage_time, 0.2, 1e-3);
  double friction = 0, stress = 0;
  for (const output::Row& r : sheared)
    friction += r.shear_friction / sheared.size(), stress += r.shear_stress / sheared.size();
  EXPECT_GT(friction, 0.1);
  EXPECT_GT(stress, 200);
  for (const output::Row& r : sheared)
    if (r.normal_stress > 0) {
      EXPECT_DOUBLE_EQ(r.shear_friction, r.shear_stress / r.normal_stress);
    }
  EXPECT_GT(sheared.back().porosity, 0.3);
  EXPECT_LT(sheared.back().porosity, 0.8);
  EXPECT_EQ(rows_of_stage(small, 0).front().coordination, 0);
  EXPECT_GT(sheared.front().coordination, 1);
}

TEST_F(Program, GivesUnitsToEverySeries) {
  const fs::path small = make("small", "stages = [\"settle\"]\n" + small_case());
  run(small, {"stage.settle.duration=0.01"});
  const hid_t file = H5Fopen(series_of(small).c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  ASSERT_GE(file, 0);
  for (const auto& [name, units] : {std::pair{"time", "s"},
                                    {"shear_strain", "1"},
                                    {"shear_stress", "Pa"},
                                    {"normal_stress", "Pa"},
                                    {"shear_friction", "1"},
                                    {"height", "m"},
                                    {"dilation", "m"},
                                    {"porosity", "1"},
                                    {"mean_overlap", "m"},
                                    {"max_overlap", "m"},
                                    {"coordination", "1"},
                                    {"unbalanced_force", "1"},
                                    {"kinetic", "J"},
                                    {"slip", "J"},
                                    {"residue", "J"}}) {
    const hid_t attribute = H5Aopen_by_name(file, name, "units", H5P_DEFAULT, H5P_DEFAULT);
    ASSERT_GE(attribute, 0) << name;
    const hid_t type = H5Aget_type(attribute);
    char* text = nullptr;
    H5Aread(attribute, type, &text);
    EXPECT_STREQ(text, units) << name;
    H5free_memory(text);
    H5Tclose(type), H5Aclose(attribute);
  }
  H5Fclose(file);
}

TEST_F(Program, RunsWhatItHasResolved) {
  const fs::path small = make("small", "stages = [\"settle\"]\n" + small_case());
  run(small, {"stage.settle.duration=100 ms"});
  const fs::path again = make("again", contents(small / "output/case.toml"));
  run(again);
  expect_same_results(small, again);
}

TEST_F(Program, SameBitsOnOneAndTwoThreads) {
  run(make("bed", "stages = [\"settle\"]\n" + small_case()));
  const std::string text = "start = \"../bed\"\nstages = [\"consolidate\", \"shear\"]\n" + small_case();
  const fs::path one = make("one", text), two = make("two", text);
  run(one, {}, {"--threads", "1"});
  run(two, {}, {"--threads", "2"});
  expect_same_results(one, two);
}

TEST_F(Program, SameBitsWhateverTheNeighbourMargin) {
  const fs::path whole = make("whole", small_case()), half = make("half", small_case()),
                 twice = make("twice", small_case());
  run(whole, {"model.neighbour_margin=1 mm"});
  run(half, {"model.neighbour_margin=0.5 mm"});
  run(twice, {"model.neighbour_margin=2 mm"});
  expect_same_results(whole, half);
  expect_same_results(whole, twice);
}

TEST_F(Program, StartsFromTheEndOfAnotherCase) {
  const fs::path whole = make("whole", small_case());
  run(whole);
  const fs::path bed = make("bed", until_consolidated() + small_case());
  run(bed);
  const fs::path shear = make("shear", "extends = \"../bed\"\nstart = \"../bed\"\nstages = [\"shear\"]\n" +
                                           small_case().substr(small_case().rfind("[[stage]]")));
  run(shear);
  // The same shear as in one go; only stage and time are counted from another beginning.
  auto one = rows_of_stage(whole, 2), other = rows_of_stage(shear, 0);
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    other[k].stage = one[k].stage, other[k].time = one[k].time;
    ASSERT_TRUE(same_bits(one[k], other[k])) << "row " << k;
  }
}

TEST_F(Program, ExtendsAndOverrides) {
  make("base", until_consolidated() + small_case());
  const fs::path other = make("other",
                              "extends = \"../base\"\n[[stage]]\nname = \"consolidate\"\nkind = "
                              "\"consolidate\"\nnormal_stress = \"3 kPa\"\n");
  const Outcome o =
      moraine({"check", other.string(), "--set", "grains.count=100", "--set", "stage.settle.duration=0.5 s"});
  ASSERT_EQ(o.status, 0) << o.err;
  EXPECT_NE(o.out.find("grains        100"), std::string::npos) << o.out;
  run(other, {"stage.settle.duration=20 ms", "stage.consolidate.duration=20 ms"});
  const std::string resolved = contents(other / "output/case.toml");
  for (const char* line :
       {"normal_stress = 3000.0  # Pa", "duration = 0.02  # s", "k_n = 2e+05  # N/m", "seed = 3"})
    EXPECT_NE(resolved.find(line), std::string::npos) << line << "\n" << resolved;
}

// Stages that follow a consolidated bed, one after the other.
TEST_F(Program, RunsEveryKindOfStage) {
  const std::string text = with(small_case().substr(0, small_case().rfind("[[stage]]")), "[[stage]]", R"(
[output]
series_interval = "0.01 s"
snapshot_interval = "1 s"
[[stage]])") + R"(
[[stage]]
name = "creep"
kind = "shear_stress"
normal_stress = "2 kPa"
shear_stress = "0.6 kPa"
duration = "0.1 s"
[[stage]]
name = "tide"
kind = "shear"
normal_stress = "2 kPa"
normal_stress_amplitude = "0.5 kPa"
normal_stress_frequency = "10 Hz"
normal_stress_phase = "90 degree"
velocity = "2 cm/s"
duration = "0.1 s"
[[stage]]
name = "squeeze"
kind = "uniaxial"
strain_rate = 0.5
strain = 0.05
)";
  const fs::path all = make("all", text);
  run(all);
  const auto creep = rows_of_stage(all, 2), tide = rows_of_stage(all, 3), squeeze = rows_of_stage(all, 4);
  ASSERT_GT(creep.size(), 9u);
  ASSERT_GT(tide.size(), 9u);
  ASSERT_GT(squeeze.size(), 9u);
  for (const auto* stage : {&creep, &tide, &squeeze})
    for (const output::Row& r : *stage) EXPECT_TRUE(all_finite(r));
  EXPECT_GT(creep.back().shear_strain, 0);  // the stress pulls along +x
  EXPECT_NEAR(tide.back().shear_strain, 0.02 * 0.1 / tide.front().height, 0.02);
  EXPECT_NEAR(squeeze.back().height / squeeze.front().height, 0.95, 1e-3);  // a positive rate compresses
  EXPECT_GT(squeeze.back().top_wall_work, 0);
}

TEST_F(Program, ChecksACase) {
  const fs::path small = make("small", small_case());
  const Outcome o = moraine({"check", small.string(), "--threads", "1"});
  ASSERT_EQ(o.status, 0) << o.err;
  const std::regex step(R"(step +[0-9.e+-]+ s, ([0-9.e+-]+) of the two-body limit)");
  const std::regex stiffness(R"(k_n/\(sigma_0 d\) = ([0-9.e+-]+))"), inertia(R"(I = ([0-9.e+-]+) \(eq. 1\))");
  std::smatch found;
  ASSERT_TRUE(std::regex_search(o.out, found, step)) << o.out;
  EXPECT_NEAR(std::stod(found[1]), 0.2 / 2, 1e-4);
  ASSERT_TRUE(std::regex_search(o.out, found, stiffness)) << o.out;
  EXPECT_NEAR(std::stod(found[1]), 2e5 / (2e3 * 0.04), 25);
  ASSERT_TRUE(std::regex_search(o.out, found, inertia)) << o.out;
  EXPECT_NEAR(std::stod(found[1]), 1 * 0.02 * std::sqrt(2600 / 2e3), 1e-3);
  for (const char* word : {"grains        300", "memory", "time        about", "stage 3: shear"})
    EXPECT_NE(o.out.find(word), std::string::npos) << word << "\n" << o.out;
  EXPECT_FALSE(fs::exists(small / "output"));
}

TEST_F(Program, BenchPrintsOneLineOfJson) {
  const fs::path small = make("small", small_case());
  const Outcome o =
      moraine({"bench", small.string(), "--steps", "200", "--threads", "1", "--backend", "cpu"});
  ASSERT_EQ(o.status, 0) << o.err;
  EXPECT_TRUE(std::regex_match(o.out, std::regex("\\{[^{}\n]*\\}\n"))) << o.out;
  for (const char* name : {"program", "backend"})
    EXPECT_TRUE(std::regex_search(o.out, std::regex(std::string("\"") + name + "\": \"[^\"]+\"[,}]")))
        << name << "\n"
        << o.out;
  std::smatch found;
  std::vector<double> numbers;
  for (const char* name : {"threads", "grains", "contacts", "pairs", "ms_per_step", "particle_steps_per_s"}) {
    ASSERT_TRUE(
        std::regex_search(o.out, found, std::regex(std::string("\"") + name + "\": ([0-9.e+-]+)[,}]")))
        << name << "\n"
        << o.out;
    numbers.push_back(std::stod(found[1]));
  }
  EXPECT_EQ(numbers[0], 1);
  EXPECT_EQ(numbers[1], 300);
  EXPECT_NEAR(numbers[5], 300 / numbers[4] * 1e3, 1e-4 * numbers[5]);
  EXPECT_FALSE(fs::exists(small / "output"));
}

TEST_F(Program, SeriesCanBeReadWhileTheRunGoesOn) {
  const fs::path script = directory.write("read.py", R"(
import sys, time
try:
    import h5py
except ImportError:
    sys.exit(77)
with h5py.File(sys.argv[1], "r", swmr=True) as series:
    assert series["shear_friction"].attrs["units"] == "1"
    t = series["time"]
    first = len(t)
    for _ in range(200):
        time.sleep(0.05)
        t.refresh()
        if len(t) > first + 20: break
    assert len(t) > first + 20, (first, len(t))
    assert all(b > a for a, b in zip(t[:-1], t[1:]))
)");
  std::string python;  // Debian's has its h5py
  for (const char* one : {"/usr/bin/python3", "python3"})
    if (Process(one, {"-c", "import h5py"}, "/dev/null", "/dev/null").wait() == 0) {
      python = one;
      break;
    }
  if (python.empty()) GTEST_SKIP() << "no python3 with h5py here";

  const fs::path small = make("small", "stages = [\"settle\"]\n" + small_case());
  const auto going_on = start(to_run(small, {"stage.settle.duration=1000 s", "output.series_interval=10 ms",
                                             "output.snapshot_interval=1000 s"}));
  while (going_on->running() && !fs::exists(series_of(small))) std::this_thread::sleep_for(1ms);
  const int status = Process(python, {script.string(), series_of(small).string()}, directory.path() / "py",
                             directory.path() / "py_err")
                         .wait();
  EXPECT_EQ(status, 0) << contents(directory.path() / "py_err");
  EXPECT_TRUE(going_on->running()) << contents(directory.path() / "err");
}

}  // namespace
}  // namespace moraine
