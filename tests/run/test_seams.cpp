// A stage that is cut in two, so that nothing changes between the halves, ends with the bits of the uncut
// one: grains, springs, what slips, walls, layers, ledger, water. Between two stages of one case, and with
// `start`.
#include <hdf5.h>

#include "program.hpp"

namespace moraine {
namespace {

struct Kind {
  const char* name;
  const char* keys;   // of the case
  const char* stage;  // of the stage that is cut
  double half;        // s, duration of either half: whole records, exact in binary
};

void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

// Beside the bed that each starts from. Records every 1/64 s.
const Kind kinds[] = {
    {"settle", "", "kind = \"settle\"\nwall_gamma_n = 40\nwall_gamma_t = 40\n", 0.0625},
    {"consolidate", "",
     "kind = \"consolidate\"\nwall_gamma_n = 40\nwall_gamma_t = 40\nnormal_stress = 3000\n", 0.0625},
    {"shear", "", "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n", 0.0625},
    {"backwards", "", "kind = \"shear\"\nnormal_stress = 2000\nvelocity = -0.2\n", 0.0625},
    {"softening", "", "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\nmu_s = 0.6\nmu_d = 0.3\n",
     0.0625},
    {"damped", "",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\ngamma_n = 5\ngamma_t = 3\n"
     "mu_s = 0.6\nmu_d = 0.4\nwall_gamma_n = 20\nwall_mu = 0.3\nwall_gamma_t = 10\n",
     0.0625},
    {"wall_springs", "[wall]\nk_t = 2e5\n",
     "kind = \"consolidate\"\nwall_gamma_n = 40\nwall_gamma_t = 40\nnormal_stress = 2000\nwall_mu = 0.2\n",
     0.0625},
    {"tide", "",
     "kind = \"shear\"\nnormal_stress = 2000\nnormal_stress_amplitude = 500\n"
     "normal_stress_frequency = 7\nnormal_stress_phase = 1\nstrain_rate = 1\n",
     0.0625},
    {"creep", "",
     "kind = \"shear_stress\"\nnormal_stress = 2000\nshear_stress = 900\nmu_s = 0.6\nmu_d = 0.3\n", 0.0625},
    {"creep_under_a_mass", "",
     "kind = \"shear_stress\"\nnormal_stress = 2000\nshear_stress = 900\nlayer_mass = 3\n", 0.0625},
    {"uniaxial", "", "kind = \"uniaxial\"\nstrain_rate = 0.3\n", 0.0625},
    {"fixed", "", "kind = \"shear\"\ntop_wall = \"fixed\"\nstrain_rate = 1\nhold_layer_height = true\n",
     0.0625},
    {"no_ledger", "[model]\nledger = false\n", "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n",
     0.0625},
    {"automatic_dt", "[model]\ndt = \"auto\"\n", "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n",
     0.125},
    {"sides", "[box]\nperiodic = \"y\"\n", "kind = \"settle\"\nwall_gamma_n = 40\nwall_gamma_t = 40\n",
     0.0625},
    {"frictionless", "", "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\nmu_s = 0\nmu_d = 0\n",
     0.0625},
    {"wet",
     "[fluid]\nenabled = true\nviscosity = 1.8e-3\ncompressibility = 1e-6\npermeability_factor = 1e-9\n",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\nmu_s = 0.6\nmu_d = 0.3\n", 0.0625},
    // Some twenty steps between exchanges.
    {"wet_interval",
     "[fluid]\nenabled = true\nviscosity = 1.8e-3\ncompressibility = 1e-6\npermeability_factor = 1e-9\n",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\nf = 0.02\n", 0.015625},
    {"wet_tide",
     "[fluid]\nenabled = true\nviscosity = 1.8e-3\ncompressibility = 1e-6\npermeability_factor = 1e-9\n",
     "kind = \"consolidate\"\nwall_gamma_n = 40\nwall_gamma_t = 40\nnormal_stress = 2000\ntop_pressure = "
     "100\ntop_pressure_amplitude = 300\n"
     "top_pressure_frequency = 5\n",
     0.0625},
    {"undrained", "[fluid]\nenabled = true\ncompressibility = 1e-6\nexchange_interval = 1\n",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\nfluid_top = \"impermeable\"\n", 0.0625},
    {"ramp", "",
     "kind = \"consolidate\"\nwall_gamma_n = 40\nwall_gamma_t = 40\n"
     "normal_stress = { ramp = [1000, 3000], over = 0.1 }\n",
     0.0625},
    {"steps", "",
     "kind = \"shear\"\nnormal_stress = 2000\nhold_layer_height = true\n"
     "velocity = { times = [0, 0.03, 0.07, 1], values = [0.1, -0.2, 0.3, 0.3], interpolation = \"steps\" }\n",
     0.0625},
    {"loads_that_swing_and_rise", "",
     "kind = \"shear_stress\"\nnormal_stress = { times = [0, 0.02, 0.09, 1], values = [2000, 2500, 1500, "
     "2000] }\n"
     "normal_stress_amplitude = 300\nnormal_stress_frequency = 40\nshear_stress = { ramp = [0, 900], over = "
     "0.03 }\nshear_stress_amplitude = 100\nshear_stress_frequency = 20\n",
     0.0625},
    {"profile_and_slope", "[model]\nslope = \"4 deg\"\n",
     "kind = \"shear\"\nnormal_stress = 2000\nprofile = \"cosine\"\ngamma_n = 5\n"
     "velocity = { ramp = [0, 0.3], over = 0.1 }\nvelocity_amplitude = 0.05\nvelocity_frequency = 20\n",
     0.0625},
    {"histories_of_a_bed_that_dt_follows", "[model]\ndt = \"auto\"\n",
     "kind = \"shear\"\nnormal_stress = { ramp = [2000, 3000], over = 0.15 }\n"
     "velocity = { times = [0, 0.1, 0.25], values = [0.1, 0.2, 0] }\n",
     0.125},
    {"wet_histories",
     "[fluid]\nenabled = true\nviscosity = 1.8e-3\ncompressibility = 1e-6\npermeability_factor = 1e-9\n",
     "kind = \"shear\"\nprofile = \"cosine\"\nnormal_stress = { ramp = [2000, 3000], over = 0.1 }\n"
     "velocity = { times = [0, 0.02, 0.5], values = [0.05, 0.1, 0] }\nfluid_bottom = \"pressure\"\n"
     "top_pressure = { times = [0, 0.03, 1], values = [0, 150, 100], interpolation = \"steps\" }\n"
     "bottom_pressure = { ramp = [0, 200], over = 0.09 }\nbottom_pressure_amplitude = 50\n"
     "bottom_pressure_frequency = 30\n",
     0.0625},
    {"hertz", "[contact]\nlaw = \"hertz\"\nyoung = 7e8\nrestitution = 0.7\n",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n", 0.0625},
    {"rolling", "[contact]\nmu_roll = 0.2\n", "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n",
     0.0625},
    {"every_law_material_and_load",
     "[grains]\nmaterial = \"clay\"\n[contact]\nlaw = \"hertz\"\nyoung = 7e8\nrestitution = 0.7\nmu_roll = "
     "0.2\nk_roll = 5e4\nmu_twist = 0.05\ncohesion = 0.05\n[wall]\nmu_roll = 0.1\n[[material]]\nname = "
     "\"quartz\"\nmu_s = 0.6\nmu_d = 0.3\nlayer = [\"0 m\", \"0.15 m\"]\n[[material]]\nname = "
     "\"clay\"\ndensity = 1800\nyoung = 3e8\nmu_s = 0.2\nrestitution = 0.4\n",
     "kind = \"shear\"\nnormal_stress = { ramp = [2000, 2500], over = 0.1 }\n"
     "velocity = { times = [0, 0.02, 0.5], values = [0.1, 0.3, 0.1] }\n",
     0.0625},
    {"materials",
     "[grains]\nmaterial = \"clay\"\n[[material]]\nname = \"quartz\"\nmu_s = 0.6\nmu_d = 0.3\nlayer = [\"0 "
     "m\", "
     "\"0.15 m\"]\n[[material]]\nname = \"clay\"\ndensity = 1800\nk_n = 1.5e5\nmu_s = 0.2\ngamma_n = 3\n",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n", 0.0625},
    {"wet_materials",
     "[fluid]\nenabled = true\ncompressibility = 1e-6\n[grains]\nmaterial = \"clay\"\n[[material]]\nname = "
     "\"quartz\"\nmu_s = 0.6\nlayer = [\"0 m\", \"0.15 m\"]\n[[material]]\nname = \"clay\"\ndensity = "
     "1300\nmu_s = 0.2\n",
     "kind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n", 0.0625},
    {"wet_settle", "[fluid]\nenabled = true\ncompressibility = 1e-6\nheight = 0.5\n",
     "kind = \"settle\"\nwall_gamma_n = 40\nwall_gamma_t = 40\n", 0.0625},
};

class Seams : public Program, public testing::WithParamInterface<Kind> {
 protected:
  // One bed for all.
  static void SetUpTestSuite() { bed_ = new TemporaryDirectory; }
  static void TearDownTestSuite() { delete bed_, bed_ = nullptr; }
  void SetUp() override {
    if (fs::exists(bed_->path() / "bed")) return;
    const auto text = "stages = [\"settle\", \"consolidate\"]\n" + small_case();
    run(bed_->write("bed/case.toml", text).parent_path());
  }
  static std::string bed() { return (bed_->path() / "bed").string(); }

  static std::string head() {
    return "extends = \"" + bed() + "\"\n[output]\nseries_interval = 0.015625\nsnapshot_interval = 1\n";
  }
  std::string stage(const std::string& name, double duration, const std::string& more = {}) const {
    return "[[stage]]\nname = \"" + name + "\"\nduration = " + std::to_string(duration) + "\n" +
           GetParam().stage + more;
  }

  // The bytes of the last state, without what counts stages and rows.
  std::string end_of(const fs::path& run) const {
    output::Checkpoint c = output::read_checkpoint(checkpoint_of(run));
    c.case_text = "", c.stage = 0, c.start = {}, c.rows.clear(), c.snapshots.clear();
    output::write_checkpoint(directory.path() / "aside.h5", c);
    return contents(directory.path() / "aside.h5");
  }
  std::vector<output::Row> rows(const fs::path& run) const { return output::read_series(series_of(run)); }

 private:
  static inline TemporaryDirectory* bed_ = nullptr;
};

TEST_P(Seams, ACutStageEndsWithTheBitsOfTheUncutOne) {
  const Kind& kind = GetParam();
  const auto text = [&](const std::string& start, const std::string& stages, const std::string& named) {
    return "start = \"" + start + "\"\nstages = [" + named + "]\n" + head() + kind.keys + stages;
  };
  const fs::path whole = make("whole", text(bed(), stage("one", 2 * kind.half), "\"one\""));
  const fs::path cut =
      make("cut", text(bed(), stage("one", kind.half) + stage("two", kind.half), "\"one\", \"two\""));
  const fs::path half = make("half", text(bed(), stage("one", kind.half), "\"one\""));
  const fs::path rest = make("rest", text("../half", stage("two", kind.half), "\"two\""));
  for (const fs::path& one : {whole, cut, half, rest}) ASSERT_NO_FATAL_FAILURE(run(one));
  EXPECT_NE(contents(cut / "output/log.txt").find("goes on as the one before"), std::string::npos);
  EXPECT_TRUE(end_of(whole) == end_of(cut)) << "two stages of one case";
  EXPECT_TRUE(end_of(whole) == end_of(rest)) << "a case that starts from another";

  // Strain, dilation and forces of the rows go on, too; what each stage has done adds up.
  const auto one = rows(whole), two = rows(cut);
  ASSERT_EQ(one.size() + 1, two.size());  // the seam has a row of either side
  const std::size_t seam = one.size() / 2;
  const bool dry = std::string(kind.keys).find("[fluid]") == std::string::npos;
  for (std::size_t k = 0; k < two.size(); ++k) {
    const output::Row &a = one[k > seam ? k - 1 : k], &b = two[k];
    SCOPED_TRACE("row " + std::to_string(k));
    EXPECT_EQ(a.shear_strain, b.shear_strain);
    EXPECT_EQ(a.dilation, b.dilation);
    if (k != seam + 1 || dry) {  // forces in water are means over an interval, but for a stage's first row
      EXPECT_EQ(a.shear_stress, b.shear_stress);
      EXPECT_EQ(a.normal_stress, b.normal_stress);
    }
    EXPECT_EQ(a.kinetic, b.kinetic);
    EXPECT_NEAR(a.time, b.time, 1e-12);
  }
  EXPECT_EQ(two[seam + 1].stage_time, 0);
  EXPECT_EQ(two[seam + 1].step, 0);
  // So do snapshots: the first of the second stage stands at its beginning.
  for (const fs::path& file : snapshots_of(cut))
    if (file.filename() == "02-two-000000.h5") {
      double time = -1;
      std::int64_t step = -1;
      const hid_t h5 = H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
      const hid_t t = H5Aopen(h5, "stage_time", H5P_DEFAULT), n = H5Aopen(h5, "step", H5P_DEFAULT);
      H5Aread(t, H5T_NATIVE_DOUBLE, &time), H5Aread(n, H5T_NATIVE_INT64, &step);
      H5Aclose(t), H5Aclose(n), H5Fclose(h5);
      EXPECT_EQ(time, 0);
      EXPECT_EQ(step, 0);
    }
  EXPECT_NEAR(one.back().slip, two[seam].slip + two.back().slip, 1e-9 * std::abs(one.back().slip));
  EXPECT_NEAR(one.back().top_wall_work, two[seam].top_wall_work + two.back().top_wall_work,
              1e-9 * std::abs(one.back().top_wall_work));
}

// What has followed no bed has no step to go on with.
TEST_F(Program, AFixedStepIsCarriedOnByAnAutomaticOne) {
  run(make("bed", "stages = [\"settle\", \"consolidate\"]\n" + small_case()));
  const auto text = [](const std::string& start, const std::string& more) {
    return "start = \"../" + start + "\"\nextends = \"../bed\"\nstages = [\"one\"]\n" + more +
           "[[stage]]\nname = \"one\"\nkind = \"shear\"\nnormal_stress = 2000\nstrain_rate = 1\n"
           "zero_kinematics = false\nduration = 0.02\n";
  };
  run(make("fixed", text("bed", "")));
  run(make("automatic", text("fixed", "[model]\ndt = \"auto\"\n")));
  run(make("fixed_again", text("automatic", "")));
}

INSTANTIATE_TEST_SUITE_P(EveryKind, Seams, testing::ValuesIn(kinds),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace moraine
