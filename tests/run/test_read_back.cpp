// A graded bed that goes out of one run and into another: with the same forces, and with the same bits from
// there on where the format carries all of them. Snapshots, and roles, as where a case begins.
#include "beginning.hpp"
#include "case/case.hpp"
#include "dem/engine.hpp"
#include "output/files.hpp"
#include "program.hpp"
#include "run/stages.hpp"

namespace moraine {
namespace {

class ReadBack : public Program {
 protected:
  // Radii of 1:10, settled.
  fs::path graded_bed() const {
    directory.write("bed/sieves.csv", "size (mm), finer (%)\n4, 0\n5, 4\n10, 10\n36, 15\n40, 100\n");
    const fs::path bed = make("bed", R"([box]
x = 0.1
y = 0.1
[grains]
count = 400
distribution = "sieves"
sieves = "sieves.csv"
placement = "random"
[contact]
k_n = 1e4
k_t = 1e4
[wall]
gamma_n = 0.3
gamma_t = 0
[[stage]]
name = "settle"
kind = "settle"
duration = 0.5
gamma_n = 0.3
[output]
snapshot_interval = 0.5
)");
    run(bed);
    return bed;
  }
  // Runs on with grains from there.
  fs::path go_on(const std::string& name, const std::string& start, const std::string& more = "") const {
    return make(name, "start = \"" + start + "\"\n" + R"([box]
x = 0.1
y = 0.1
[contact]
k_n = 1e4
k_t = 1e4
[wall]
mass = 0.5
gamma_n = 0.3
gamma_t = 0
[[stage]]
name = "on"
kind = "consolidate"
normal_stress = 500
duration = 0.01
zero_kinematics = false
)" + more + "[output]\nseries_interval = 0.001\n");
  }
  std::string exported(const fs::path& bed, const std::string& format, const std::string& file) const {
    const std::string path = (directory.path() / file).string();
    EXPECT_EQ(moraine({"export", bed.string(), "--format", format, "--output", path}).status, 0);
    return "../" + file;
  }
};

struct Beginning {
  std::vector<dem::Vec3d> force, torque;  // by id
  double largest = 0;                     // N
};
Beginning beginning_of(const fs::path& directory) {
  const dem::State s = state_at_step_0(directory);
  Beginning b;
  b.force.resize(s.size()), b.torque.resize(s.size());
  for (dem::Index i = 0; i < s.size(); ++i) {
    b.force[s.id[i]] = s.force[i], b.torque[s.id[i]] = s.torque[i];
    b.largest = std::max(b.largest, std::sqrt(dot(s.force[i], s.force[i])));
  }
  return b;
}

TEST_F(ReadBack, AGradedBedHasTheSameForces) {
  const fs::path bed = graded_bed();
  const dem::State settled = output::read_checkpoint(checkpoint_of(bed)).state;
  ASSERT_GT(settled.contacts.size(), 150u);
  const auto [smallest, largest] = std::ranges::minmax_element(settled.r);
  EXPECT_GT(*largest, 9 * *smallest);

  // Tables have no springs; but for them they carry every bit, and so does all that follows.
  const fs::path from_checkpoint = go_on("checkpoint", "../bed", "clear_history = true\n");
  const Beginning with_bits = beginning_of(from_checkpoint);
  ASSERT_NO_FATAL_FAILURE(run(from_checkpoint));
  const auto rows = output::read_series(series_of(from_checkpoint));
  const dem::State end = output::read_checkpoint(checkpoint_of(from_checkpoint)).state;
  for (const auto& [format, file] : {std::pair("csv", "bed.csv"), std::pair("lammps", "bed.data")}) {
    const fs::path c = go_on(format, exported(bed, format, file));
    const Beginning b = beginning_of(c);
    EXPECT_EQ(b.force, with_bits.force) << format;
    EXPECT_EQ(b.torque, with_bits.torque) << format;
    ASSERT_NO_FATAL_FAILURE(run(c));
    const auto again = output::read_series(series_of(c));
    ASSERT_EQ(again.size(), rows.size());
    for (std::size_t k = 0; k < rows.size(); ++k) EXPECT_TRUE(same_bits(again[k], rows[k])) << format << k;
    const dem::State s = output::read_checkpoint(checkpoint_of(c)).state;
    EXPECT_EQ(s.id, end.id);
    EXPECT_EQ(s.x, end.x);
    EXPECT_EQ(s.v, end.v);
    EXPECT_EQ(s.omega, end.omega);
  }

  // Snapshots have the forces of the springs.
  const Beginning whole = beginning_of(go_on("whole", "../bed"));
  EXPECT_NE(whole.force, with_bits.force);
  const fs::path c = go_on("snapshot", "../bed/output/snapshots/01-settle-000001.h5");
  const Beginning b = beginning_of(c);
  for (std::size_t i = 0; i < b.force.size(); ++i)
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(b.force[i][a], whole.force[i][a], 1e-12 * whole.largest) << i;
      EXPECT_NEAR(b.torque[i][a], whole.torque[i][a], 1e-12 * whole.largest * *largest) << i;
    }
  ASSERT_NO_FATAL_FAILURE(run(c));
  EXPECT_NE(contents(c / "output/log.txt").find("of a snapshot, 01-settle-000001.h5: springs bear"),
            std::string::npos);
}

TEST_F(ReadBack, ASnapshotHasBoxAndTopWall) {
  const fs::path bed = make("bed", small_case());
  run(bed, {"stages=[\"settle\", \"consolidate\"]"});
  const fs::path last = snapshots_of(bed)[snapshots_of(bed).size() - 1];
  ASSERT_TRUE(last.filename().string().starts_with("02-")) << last;
  const fs::path c =
      make("on", "start = \"" + last.string() + "\"\nstages = [\"consolidate\"]\n" + small_case());
  const run::Start start = run::start_of(cases::load(c));
  const output::Checkpoint end = output::read_checkpoint(checkpoint_of(bed));
  EXPECT_EQ(start.box_x, end.scene.box.x);
  EXPECT_EQ(start.before.state.wall_z(), end.state.wall_z());
  EXPECT_EQ(start.before.state.contacts.size(), end.state.contacts.size());
  EXPECT_TRUE(start.roles.empty());
  // In a wider box grains would lose their neighbours across its sides.
  expect_error({"check", c.string(), "--set", "box.x=0.3"},
               {"its grains fill a box of ", "not of box.x = 0.3 m"});
  const fs::path from_end = make("end", "start = \"../bed\"\nstages = [\"consolidate\"]\n" + small_case());
  expect_error({"check", from_end.string(), "--set", "box.y=0.3"},
               {"its grains fill a box of ", "not of box.y = 0.3 m"});
}

TEST_F(ReadBack, ADamagedSnapshotIsNamed) {
  const fs::path bed = make("bed", small_case());
  run(bed, {"stages=[\"settle\"]", "stage.settle.duration=0.001"});
  const std::string whole = contents(snapshots_of(bed).back());
  const auto expect = [&](const std::string& bytes, const std::vector<std::string>& words) {
    directory.write("bed/start.h5", bytes);
    expect_error({"check", bed.string(), "--set", "start=start.h5"}, words);
  };
  const std::vector<std::string> remedy{"start.h5: damaged: ",
                                        "expected an undamaged copy, or another snapshot"};
  expect(whole.substr(0, whole.size() / 2), remedy);
  std::string changed = whole;
  changed[whole.size() / 2] ^= 1;
  expect(changed, remedy);
  expect(whole.substr(512), {"start.h5: not a checkpoint of moraine, or damaged"});
}

// A bed of columns, the outer ones driven: no heights would say so.
constexpr const char* columns = "x, y, z, r, role\n";
std::string table_with_roles(const std::string& driven) {
  std::string table = columns;
  for (int k = 0; k < 5; ++k)
    for (int i = 0; i < 5; ++i) {
      char row[100];
      std::snprintf(row, sizeof row, "%g, 0.05, %g, 0.01, %s\n", 0.01 + 0.02 * i, 0.01 + 0.0199 * k,
                    i == 0   ? "bottom_layer"
                    : i == 2 ? driven.c_str()
                             : "free");
      table += row;
    }
  return table;
}

class Roles : public ReadBack {
 protected:
  fs::path with_roles(const std::string& name, const std::string& table, const std::string& more = "") const {
    directory.write(name + "/grains.csv", table);
    return make(name, R"(start = "grains.csv"
[box]
x = 0.1
y = 0.1
[contact]
k_n = 1e4
k_t = 1e4
[wall]
gamma_n = 0.3
gamma_t = 0.3
[[stage]]
name = "settle"
kind = "settle"
duration = 0.002
[[stage]]
name = "shear"
kind = "shear"
normal_stress = 100
velocity = 0.01
duration = 0.004
)" + more +
                          "[[stage]]\nname = \"on\"\nkind = \"shear\"\nnormal_stress = 200\nvelocity = "
                          "0.01\nduration = 0.004\n");
  }
};

std::vector<dem::BodyId> roles_at_end(const fs::path& c) {
  const dem::State s = output::read_checkpoint(checkpoint_of(c)).state;
  std::vector<dem::BodyId> roles(s.size());
  for (dem::Index i = 0; i < s.size(); ++i) roles[s.id[i]] = s.part_of[i];
  return roles;
}

TEST_F(Roles, AreTheLayersOfStagesThatShear) {
  const fs::path c = with_roles("c", table_with_roles("top_layer"));
  EXPECT_NE(moraine({"check", c.string()}).out.find("roles         5 grains of bottom_layer, 5 of top_layer"),
            std::string::npos);
  run(c, {"stages=[\"settle\"]"});  // where all are free
  for (const dem::BodyId role : roles_at_end(c)) EXPECT_EQ(role, dem::BodyId::none);
  run(c, {}, {"--force"});
  const auto roles = roles_at_end(c);
  for (int id = 0; id < 25; ++id)
    EXPECT_EQ(roles[id], id % 5 == 0   ? dem::BodyId::bottom_layer
                         : id % 5 == 2 ? dem::BodyId::top_layer
                                       : dem::BodyId::none);
  // They go out and come in again, in a table and in a snapshot.
  const std::string table = exported(c, "csv", "out.csv");
  EXPECT_NE(contents(directory.path() / "out.csv").find(", role\n"), std::string::npos);
  const std::string text = contents(c / "case.toml");
  for (const std::string& start : {table, std::string("../c/output/snapshots/03-on-000000.h5")}) {
    const fs::path next = make("next", text);
    EXPECT_EQ(run::start_of(cases::load(next, {{"start", start}})).roles, roles) << start;
  }
}

TEST_F(Roles, SayWhatIsWrong) {
  const auto expect = [&](const std::string& name, const std::string& table,
                          const std::vector<std::string>& words) {
    expect_error({"check", with_roles(name, table).string()}, words);
  };
  expect("word", table_with_roles("top"),
         {"grains.csv, line 4: role = \"top\"; expected free, bottom_layer or top_layer"});
  expect("none-driven", table_with_roles("free"),
         {"stage shear: no grain of the start has the role top_layer"});
  expect("none-free",
         std::string(columns) + "0.01,0.01,0.01,0.01,bottom_layer\n0.05,0.05,0.01,0.01,top_layer\n",
         {"stage shear: no grain of the start has the role free"});
  const fs::path thick = with_roles("thick", table_with_roles("top_layer"), "top_layer = 0.02\n");
  EXPECT_NE(moraine({"check", thick.string()})
                .out.find("stage shear: bottom_layer and top_layer do not count: the "
                          "layers are the roles that the grains came with"),
            std::string::npos);
}

// All free is as no roles: layers go by height.
TEST_F(Roles, AllFreeIsNone) {
  std::string table = columns;
  for (int k = 0; k < 6; ++k) table += "0.05, 0.05, " + std::to_string(0.01 + 0.0199 * k) + ", 0.01, free\n";
  const fs::path c = with_roles("c", table);
  EXPECT_TRUE(run::start_of(cases::load(c)).roles.empty());
  EXPECT_EQ(moraine({"check", c.string()}).status, 0);
}

}  // namespace
}  // namespace moraine
