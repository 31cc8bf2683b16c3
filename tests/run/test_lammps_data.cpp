// Data files of LAMMPS as where a case begins: what write_data writes, what export writes, and what is wrong.
#include <cstdlib>
#include <regex>

#include "beginning.hpp"
#include "case/case.hpp"
#include "dem/engine.hpp"
#include "dem/memory_order.hpp"
#include "output/files.hpp"
#include "program.hpp"
#include "run/grain_table.hpp"
#include "run/own_grains.hpp"
#include "run/stages.hpp"

namespace moraine {
namespace {

// As write_data leaves it: ids in no order, coefficients, image flags.
const char* const two_grains = R"(LAMMPS data file via write_data, version 29 Sep 2021, timestep = 4

2 atoms
2 atom types

-0.03 0.07 xlo xhi
0 0.1 ylo yhi
-0.001 0.2 zlo zhi

Pair Coeffs # lj/cut

1 1 1

Atoms # sphere

9 2 0.012 2600 0.02 0.03 0.05 0 -1 0
4 1 0.01 2600 -0.02 0.03 0.04 0 0 0

Velocities

9 0.1 0.2 0.3 1 2 3
4 0 0 -0.5 0 0 0
)";

class LammpsData : public Program {
 protected:
  fs::path with_data(const std::string& name, const std::string& data, const std::string& more = "",
                     const std::string& file = "bed.data") const {
    directory.write(name + "/" + file, data);
    return make(name,
                "start = \"" + file + "\"\n" + more +
                    "[contact]\nk_n = 1e5\nk_t = 1e5\n[wall]\ngamma_n = 1\ngamma_t = 1\n[[stage]]\nname = "
                    "\"fall\"\nkind = \"settle\"\nduration = 0.001\n");
  }
};

TEST_F(LammpsData, IsWhereACaseBegins) {
  for (const char* file : {"bed.data", "bed.lammps", "data.bed"}) {
    const cases::Case c = cases::load(with_data(file, two_grains, "", file));
    const run::Start start = run::start_of(c);
    const dem::State& s = start.before.state;
    ASSERT_EQ(s.size(), 2);
    EXPECT_DOUBLE_EQ(start.box_x, 0.1);
    EXPECT_DOUBLE_EQ(start.box_y, 0.1);
    EXPECT_EQ(s.r, (std::vector{0.005, 0.006}));
    EXPECT_DOUBLE_EQ(s.x[0].x, 0.01);  // from xlo on
    EXPECT_EQ(s.x[0].z, 0.04);         // from the floor on, wherever zlo is
    EXPECT_EQ(s.v[0], (dem::Vec3d{0, 0, -0.5}));
    EXPECT_EQ(s.omega[1], (dem::Vec3d{1, 2, 3}));
  }
  run(directory.path() / "bed.data");
}

TEST_F(LammpsData, SaysWhichLineIsWrong) {
  int number = 0;
  const auto expect = [&](const std::string& what, const std::string& by,
                          const std::vector<std::string>& words, const std::string& more = "") {
    std::string data = two_grains;
    const auto at = data.find(what);
    ASSERT_NE(at, data.npos) << what;
    data.replace(at, what.size(), by);
    expect_error({"check", with_data(std::to_string(number++), data, more).string()}, words);
  };
  expect("2 atoms\n", "3 atoms\n", {"bed.data, line 14: Atoms has 2 rows; expected 3, as line 3 says"});
  expect("2 atoms\n", "\n", {"bed.data: there is no line \"N atoms\""});
  expect("Atoms # sphere", "Masses", {"there is no section Atoms"});
  expect("Atoms # sphere", "Atoms # full", {"line 14: Atoms of style full; expected atom_style sphere"});
  expect("Atoms # sphere", "Atoms # hybrid sphere", {"style hybrid sphere"});
  expect("Velocities", "Bonds", {"line 19: section Bonds; expected Atoms and Velocities"});
  expect("-0.03 0.07 xlo xhi\n", "\n", {"there is no line \"xlo xhi\""});
  expect("-0.03 0.07", "0.07 -0.03", {"line 6: xlo = 0.07 and xhi = -0.03"});
  expect("0.2 zlo zhi\n", "0.2 zlo zhi\n0.01 0 0 xy xz yz\n", {"line 9: the box is tilted"});
  expect("timestep = 4", "timestep = 4, units = lj", {"line 1: units = lj; expected si"});
  expect("9 2 0.012", "9 2 -0.012", {"line 16: diameter = -0.012 m; expected more than 0"});
  expect("9 2 0.012", "9 2 x", {"line 16: diameter = \"x\"; expected a number"});
  expect("9 2 0.012", "4 2 0.012", {"line 17: id 4 is that of line 16, too"});
  expect("0.01 2600", "0.01 2500",
         {"line 17: density = 2500 kg/m3, and grains.density = 2600 kg/m3; expected that of the case"});
  expect("0.05 0 -1 0", "0.05 0", {"line 16: 8 values; expected 7: id type diameter density x y z, or 10"});
  expect("0.05 0 -1 0", "0.001", {"bed.data, line 16: the grain at z = 0.001 m", "beyond the floor"});
  expect("9 2 0.012 2600 0.02 0.03 0.05", "9 2 0.012 2600 -0.02 0.03 0.049",
         {"line 17: this grain overlaps that of ", "bed.data, line 16 by 0.002 m"});
  expect("4 0 0 -0.5", "5 0 0 -0.5", {"line 22: id 5 is none of the section Atoms"});
  expect("9 0.1 0.2 0.3 1 2 3\n", "", {"line 19: Velocities has 1 rows; expected 2"});
  expect("0.3 1 2 3", "0.3", {"line 21: 4 values; expected 7: id vx vy vz wx wy wz"});
  expect("2 atoms", "2 atoms", {"line 6: the box is 0.1 m long along x and box.x = 0.2 m; expected the same"},
         "[box]\nx = 0.2\n");
  expect("2 atoms", "2 atoms", {"x is not periodic (box.periodic)", "expected box.x of more than 0 m"},
         "[box]\nperiodic = \"y\"\n");
}

// Forces at step 0, by id.
std::vector<dem::Vec3d> forces(const fs::path& directory) {
  const dem::State s = state_at_step_0(directory);
  std::vector<dem::Vec3d> f(s.size());
  for (dem::Index i = 0; i < s.size(); ++i) f[s.id[i]] = s.force[i];
  return f;
}

// A settled bed goes out, into LAMMPS, out of it, and in again: places and sizes keep their bits but for the
// last of what LAMMPS keeps as a mass and wraps, and its forces on the grains are Moraine's.
TEST_F(LammpsData, OfLammpsItselfIsRead) {
  if (std::system("command -v lmp > /dev/null") != 0) GTEST_SKIP() << "lmp is not installed";
  const fs::path bed = make("bed", small_case());
  run(bed, {"stages=[\"settle\"]"});
  const fs::path there = directory.path() / "there";
  fs::create_directories(there);
  ASSERT_EQ(moraine({"export", bed.string(), "--format", "lammps", "--output", (there / "out.data").string()})
                .status,
            0);
  directory.write("there/in.bed", R"(units si
atom_style sphere
boundary p p f
newton off
comm_modify vel yes
read_data out.data
neighbor 0.01 bin
pair_style gran/hooke 2e5 NULL 0 0 0 0
pair_coeff * *
fix w all wall/gran hooke 2e5 NULL 0 0 0 0 zplane 0.0 NULL
timestep 1e-6
fix m all nve/sphere
run 0
write_data bed.data
write_dump all custom forces.txt id fx fy fz modify format float %.17g sort id
)");
  ASSERT_EQ(
      std::system(("cd '" + there.string() + "' && OMP_NUM_THREADS=1 lmp -in in.bed > log.txt").c_str()), 0)
      << contents(there / "log.txt");
  const std::string stage =
      "[contact]\nk_n = 2e5\nmu_s = 0\n[wall]\ngamma_n = 0\ngamma_t = 0\n[[stage]]\nname = \"a\"\nkind = "
      "\"settle\"\nduration = 1\n";
  const fs::path out = make("there", "start = \"out.data\"\n" + stage);
  const dem::State ours = run::start_of(cases::load(out)).before.state;
  const std::vector<dem::Vec3d> f = forces(out);
  make("there", "start = \"bed.data\"\n" + stage);
  const run::Start start = run::start_of(cases::load(out));
  const dem::State& theirs = start.before.state;
  ASSERT_EQ(theirs.size(), ours.size());
  for (dem::Index i = 0; i < ours.size(); ++i) {
    EXPECT_EQ(theirs.r[i], ours.r[i]);
    EXPECT_EQ(theirs.v[i], ours.v[i]);
    EXPECT_EQ(theirs.omega[i], ours.omega[i]);
    EXPECT_EQ(theirs.x[i].z, ours.x[i].z);
    for (const int a : {0, 1}) {
      const double side = a == 0 ? start.box_x : start.box_y, apart = theirs.x[i][a] - ours.x[i][a];
      EXPECT_NEAR(apart - side * std::round(apart / side), 0, 1e-15);
    }
  }
  std::istringstream lines(contents(there / "forces.txt"));
  std::string line;
  for (int k = 0; k < 9; ++k) std::getline(lines, line);
  double largest = 0;
  for (const dem::Vec3d& force : f) largest = std::max(largest, std::sqrt(dot(force, force)));
  ASSERT_GT(largest, 0);
  for (dem::Index id; lines >> id;) {
    dem::Vec3d force;
    lines >> force.x >> force.y >> force.z;
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(force[a], f[id - 1][a], 1e-9 * largest) << id;
  }
}

}  // namespace
}  // namespace moraine
