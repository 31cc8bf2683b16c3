// Grains that are one's own, from a table, and the same way out; gradings and random places from a case on.
#include "run/grain_table.hpp"

#include "case/case.hpp"
#include "dem/engine.hpp"
#include "dem/grading.hpp"
#include "output/files.hpp"
#include "program.hpp"
#include "run/stages.hpp"

namespace moraine {
namespace {

class GrainTable : public Program {
 protected:
  // A case that begins with this table, in a box of 0.1 m.
  fs::path with_table(const std::string& name, const std::string& table, const std::string& more = "") const {
    directory.write(name + "/grains.csv", table);
    return make(name,
                "start = \"grains.csv\"\n[box]\nx = 0.1\ny = 0.1\n" + more +
                    "[contact]\nk_n = 1e5\nk_t = 1e5\n[wall]\ngamma_n = 1\ngamma_t = 1\n[[stage]]\nname = "
                    "\"fall\"\nkind = \"settle\"\nduration = 0.01\n");
  }
};

TEST_F(GrainTable, IsWhereACaseBegins) {
  const fs::path c =
      with_table("c", "x (mm), y (mm), z (mm), r (mm), vz (cm/s)\n20,30,40,5,-7\n60,30,40,6,0\n");
  const dem::State s = run::start_of(cases::load(c)).before.state;
  ASSERT_EQ(s.size(), 2);
  EXPECT_DOUBLE_EQ(s.x[0].x, 0.02);
  EXPECT_DOUBLE_EQ(s.x[1].z, 0.04);
  EXPECT_DOUBLE_EQ(s.r[1], 0.006);
  EXPECT_DOUBLE_EQ(s.v[0].z, -0.07);
  EXPECT_EQ(s.omega[0], (dem::Vec3d{0, 0, 0}));
  ASSERT_NO_FATAL_FAILURE(run(c));
  const auto end = output::read_checkpoint(c / "output/checkpoint.h5").state;
  EXPECT_NEAR(end.x[1].z, 0.04 - 0.5 * 9.80665 * 0.01 * 0.01, 1e-5);
}

TEST_F(GrainTable, VelocitiesCountWhereTheStageKeepsThem) {
  const fs::path c = with_table("c", "x,y,z,r,vx\n0.02,0.03,0.05,0.005,0.5\n");
  run(c, {"stage.fall.zero_kinematics=false"});
  EXPECT_NEAR(output::read_checkpoint(c / "output/checkpoint.h5").state.x[0].x, 0.02 + 0.5 * 0.01, 2e-5);
}

TEST_F(GrainTable, SaysWhatIsLostOrStrange) {
  const std::string head = "x,y,z,r,vx\n0.02,0.03,0.005,0.005,0.5\n";
  const auto said = [&](const std::string& name, const std::string& table) {
    return moraine({"check", with_table(name, table).string()}).out;
  };
  EXPECT_NE(said("moving", head).find("has velocities, of up to 0.5 m/s, and stage fall begins at rest"),
            std::string::npos);
  EXPECT_NE(said("deep", "x,y,z,r\n0.02,0.03,0.02,0.005\n0.0295,0.03,0.02,0.005\n")
                .find("more than grains that lie: they may fly apart"),
            std::string::npos);
  EXPECT_EQ(said("still", "x,y,z,r\n0.02,0.03,0.02,0.005\n").find("warning"), std::string::npos);
}

// A run that goes on must be of the grains that it began with.
TEST_F(GrainTable, MustStayAsItWas) {
  const std::string table = "x,y,z,r\n0.02,0.03,0.02,0.005\n";
  const fs::path c = with_table("c", table);
  ASSERT_NO_FATAL_FAILURE(run(c));
  directory.write("c/grains.csv", table + "0.06,0.03,0.02,0.005\n");
  std::vector<std::string> words = to_run(c);
  words.push_back("--resume");
  expect_error(words, {"the run began with another ", "grains.csv, which has changed since"});
  directory.write("c/grains.csv", table);
  EXPECT_EQ(moraine(words).status, 0);
}

TEST_F(GrainTable, DensityScalingIsBetweenTheSizes) {
  const fs::path c = with_table("c", "x,y,z,r\n0.02,0.03,0.02,0.005\n0.06,0.03,0.02,0.004\n");
  const auto scaled = [&](const char* radius) {
    return std::vector<std::string>{"check", c.string(), "--set",
                                    std::string("model.density_scaling=") + radius};
  };
  expect_error(scaled("6 mm"), {"model.density_scaling = 0.006 m", "wider than the largest radius, 0.005 m"});
  EXPECT_NE(moraine(scaled("3 mm")).out.find("does nothing: no radius is smaller"), std::string::npos);
  EXPECT_NE(moraine(scaled("4.5 mm")).out.find("may still fall at its end; press the bed together"),
            std::string::npos);
}

// Its time is judged with grains that move as fast as they do.
TEST_F(GrainTable, FastGrainsAreTimed) {
  const fs::path c = with_table("c", "x,y,z,r,vz\n0.02,0.03,0.01,0.005,-5\n0.06,0.03,0.05,0.005,-20\n");
  const std::string said = moraine({"check", c.string(), "--set", "stage.fall.zero_kinematics=false"}).out;
  EXPECT_NE(said.find("ms a step"), std::string::npos) << said;
}

TEST_F(GrainTable, SaysWhichRowIsWrong) {
  const std::string head = "x,y,z,r\n0.02,0.03,0.02,0.005\n";
  const auto expect = [&](const std::string& name, const std::string& table,
                          const std::vector<std::string>& words, const std::string& more = "") {
    expect_error({"check", with_table(name, table, more).string()}, words);
  };
  expect("size", head + "0.05,0.05,0.05,-0.001\n",
         {"grains.csv, line 3: r = -0.001 m; expected more than 0"});
  expect("overlap", head + "0.07,0.03,0.02,0.005\n0.025,0.03,0.02,0.004\n",
         {"grains.csv, line 2: this grain overlaps that of ",
          "grains.csv, line 4 by 0.004 m, 1 of the smaller radius", "guards.max_overlap"});
  expect("across", "x,y,z,r\n0.001,0.03,0.02,0.005\n0.099,0.03,0.02,0.005\n",
         {"line 2", "line 3", "overlaps"});
  expect("below", head + "0.05,0.05,0.001,0.005\n", {"line 3", "z = 0.001 m", "beyond the floor"});
  expect("wall", "x,y,z,r\n0.098,0.03,0.02,0.005\n", {"line 2", "x = 0.098 m", "beyond a side wall"},
         "periodic = \"y\"\nwalls = \"x\"\n");
  expect("metres", "x,y,z,r\n20,0.03,0.02,0.005\n",
         {"grains.csv, line 2", "x = 20 m lies outside the box; expected 0 to box.x = 0.1 m"});
  expect("open", head + "0.05,-0.01,0.02,0.005\n", {"line 3", "y = -0.01 m lies outside the box"},
         "periodic = \"x\"\n");
  expect("column", "x,y,z,radius\n1,1,1,1\n", {"unknown column radius"});
  expect("missing", "x,y,z\n1,1,1\n", {"there is no column r; it has x, y, z"});
  expect("unit", "x (s),y,z,r\n1,1,1,1\n", {"x (s)", "wrong dimension"});
  directory.write("no-box/grains.csv", head);
  expect_error(
      {"check",
       make("no-box", "start = \"grains.csv\"\n[[stage]]\nname = \"a\"\nkind = \"settle\"\nduration = 1\n")
           .string()},
      {"a table of grains has no box; expected box.x"});
}

// Out and in again: every number keeps its bits, and so do the forces of springs between centres.
TEST_F(GrainTable, OfAnExportedBedHasItsBits) {
  const fs::path bed = make("bed", small_case());
  ASSERT_NO_FATAL_FAILURE(run(bed));
  const std::string table = (directory.path() / "again/grains.csv").string();
  fs::create_directories(directory.path() / "again");
  ASSERT_EQ(moraine({"export", bed.string(), "--output", table}).status, 0);
  expect_error({"export", bed.string(), "--output", table}, {"is there already"});
  output::Checkpoint before = output::read_checkpoint(bed / "output/checkpoint.h5");
  const dem::Scene& scene = before.scene;
  dem::synchronise(scene, before.state);
  const fs::path again = make("again", "start = \"grains.csv\"\n[box]\nx = " + std::to_string(scene.box.x) +
                                           "\ny = " + std::to_string(scene.box.y) +
                                           "\n[[stage]]\nname = \"a\"\nkind = \"settle\"\nduration = 1\n");
  const dem::State s = run::start_of(cases::load(again)).before.state;
  ASSERT_EQ(s.size(), before.state.size());
  for (dem::Index i = 0; i < s.size(); ++i) {
    const dem::Index j = before.state.id[i];
    EXPECT_EQ(s.x[j], before.state.x[i]);
    EXPECT_EQ(s.r[j], before.state.r[i]);
    EXPECT_EQ(s.v[j], before.state.v[i]);
    EXPECT_EQ(s.omega[j], before.state.omega[i]);
  }
}

TEST_F(GrainTable, OtherFormats) {
  const fs::path c = with_table("c", "x,y,z,r\n0.02,0.03,0.05,0.005\n0.06,0.03,0.05,0.004\n");
  expect_error({"export", c.string()}, {"has no results yet; run it first"});
  ASSERT_NO_FATAL_FAILURE(run(c));
  const std::string lammps = moraine({"export", c.string(), "--format", "lammps"}).out,
                    vtk = moraine({"export", c.string(), "--format", "vtk"}).out;
  EXPECT_NE(lammps.find("2 atoms\n1 atom types\n"), std::string::npos);
  EXPECT_NE(lammps.find("\n0 0.10000000000000001 xlo xhi\n"), std::string::npos) << lammps;
  EXPECT_NE(lammps.find("\n2 1 0.0080000000000000002 2600 0.059999999999999998 0.029999999999999999 "),
            std::string::npos)
      << lammps;
  EXPECT_NE(vtk.find("POINTS 2 double\n0.02 0.029999999999999999 "), std::string::npos) << vtk;
  expect_error({"export", c.string(), "--format", "xyz"}, {"--format"});
}

// A graded bed from random places settles, and the search by levels finds all its contacts.
TEST_F(GrainTable, AGradedBedSettles) {
  directory.write("graded/sieves.csv", "size (mm), finer (%)\n6, 0\n12, 30\n20, 60\n40, 100\n");
  const fs::path c = make("graded", R"([box]
x = 0.12
y = 0.12
[grains]
count = 400
distribution = "sieves"
sieves = "sieves.csv"
placement = "random"
[contact]
k_n = 1e4
k_t = 1e4
[wall]
gamma_n = 2
gamma_t = 2
[[stage]]
name = "settle"
kind = "settle"
duration = 0.4
gamma_n = 1
)");
  const std::string said = moraine({"check", c.string()}).out;
  EXPECT_NE(said.find("sizes         0.006"), std::string::npos) << said;
  EXPECT_NE(said.find("timed with as many grains of one size, as sizes of 1:5.88 make no bed in a moment"),
            std::string::npos)
      << said;
  EXPECT_EQ(said.find("shorter"), std::string::npos) << said;  // some minutes
  ASSERT_NO_FATAL_FAILURE(run(c));
  const dem::State s = output::read_checkpoint(c / "output/checkpoint.h5").state;
  EXPECT_GT(s.contacts.size(), 300u);
  const dem::GradingSummary sizes = dem::summary_of(s.r);
  EXPECT_NEAR(sizes.d50, 0.017, 0.004);
  // What two threads compute is the same.
  const auto one = output::read_series(series_of(c));
  run(c, {}, {"--force", "--threads", "2"});
  const auto two = output::read_series(series_of(c));
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t k = 0; k < one.size(); ++k) EXPECT_EQ(one[k].kinetic, two[k].kinetic);
}

TEST_F(GrainTable, AGradingThatIsNoneNamesItsFile) {
  const auto expect = [&](const std::string& name, const std::string& table, const std::string& words) {
    directory.write(name + "/sieves.csv", table);
    const fs::path c = make(name,
                            "[box]\nx = 0.2\ny = 0.2\n[grains]\ndistribution = \"sieves\"\nsieves = "
                            "\"sieves.csv\"\nplacement = \"random\"\n[[stage]]\nname = \"a\"\nkind = "
                            "\"settle\"\nduration = 1\n");
    expect_error({"check", c.string()}, {"sieves.csv", words});
  };
  expect("a", "size (mm),finer (%)\n1,0\n2,90\n", "has 90 % finer; expected 100");
  expect("b", "size (mm),finer (%)\n-1,0\n2,100\n", "expected more than 0");
  expect("c", "size,passing\n1,0\n2,100\n", "unknown column passing; expected size, finer");
  expect_error(
      {"check",
       make("d",
            "[grains]\ndistribution = \"sieves\"\n[[stage]]\nname = \"a\"\nkind = \"settle\"\nduration = 1\n")
           .string()},
      {"grains.sieves", "expected the name of a CSV file"});
}

TEST_F(GrainTable, AMixtureIsDrawn) {
  const fs::path c = make("mixed", R"([box]
x = 0.1
y = 0.1
[grains]
count = 3000
distribution = "bimodal"
radius_mean = "8 mm"
radius_std = "0.5 mm"
fine_radius_mean = "2 mm"
fine_radius_std = "0.2 mm"
fine_fraction = "30 %"
placement = "random"
columns_x = 4
columns_y = 4
[wall]
gamma_n = 1
gamma_t = 1
[[stage]]
name = "a"
kind = "settle"
duration = 1
)");
  const std::string said = moraine({"check", c.string()}).out;
  EXPECT_NE(said.find("grains are wider than 0.008 m, 0.3"), std::string::npos) << said;
  EXPECT_NE(said.find("(asked for: 0.3)"), std::string::npos) << said;
  EXPECT_NE(moraine({"check", c.string(), "--set", "grains.placement=lattice"}).out.find("(asked for: 0.3)"),
            std::string::npos);
  expect_error({"check", c.string(), "--set", "grains.count=10"},
               {"of 10 grains 0 would be of the coarse population", "28 grains or more (grains.count)"});
}

}  // namespace
}  // namespace moraine
