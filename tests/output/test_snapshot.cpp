#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/wait.h>

#include "output/hdf5.hpp"
#include "output/sealed.hpp"
#include "samples.hpp"
#include "temporary_directory.hpp"

namespace moraine::output {
namespace {

using dem::Vec3d;

// Three grains in a row along x in a periodic box, the last touching the first across the border.
struct Bed {
  dem::Scene scene;
  dem::State state;
  Bed() {
    scene.box = {3, 3, 3};
    scene.dt = 1e-3;
    auto& s = state;
    s.id = {2, 0, 1};
    s.r = {0.6, 0.5, 0.55};
    s.x = {{5.45, -0.1, 1}, {0.5, -0.1, 1}, {1.4, -0.1, 1}};
    s.x_start = {{-0.55, -0.1, 1}, {0.5, -0.1, 1}, {1.4, -0.1, 0.5}};
    s.v = {{3, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    s.omega = s.rotation = s.force = s.torque = std::vector<Vec3d>(3, Vec3d{0, 0, 0});
    s.part_of = {dem::BodyId::top_layer, dem::BodyId::bottom_layer, dem::BodyId::none};
    s.contacts = {{0, 1, {}}, {0, 2, {}}, {1, 2, {}}};
    s.contacts[2].spring.delta_t.y = 1e-9;
    s.step = 40;
  }
};

template <class T>
std::vector<T> read(const std::filesystem::path& path, const char* group, const char* name) {
  std::vector<T> list;
  hdf5::File::open(path, H5F_ACC_RDONLY).open_group(group).read(name, list);
  return list;
}

class Snapshot : public testing::Test {
 protected:
  std::filesystem::path path(const SnapshotInfo& info) const { return directory.path() / info.file; }
  TemporaryDirectory directory;
};

TEST_F(Snapshot, ListsGrainsByTheirIds) {
  const Bed bed;
  const SnapshotInfo info = write_snapshot(directory.path(), "02-shear-000040", 1.5, bed.scene, bed.state);
  EXPECT_EQ(info.file, "02-shear-000040.h5");
  EXPECT_EQ(info.grains, 3);
  EXPECT_EQ(info.contacts, 3);

  const auto file = hdf5::File::open(path(info), H5F_ACC_RDONLY);
  double time = 0;
  std::int64_t step = 0;
  file.get("time", time);
  file.get("step", step);
  EXPECT_EQ(time, 1.5);
  EXPECT_EQ(step, 40);

  EXPECT_EQ(read<dem::Index>(path(info), "grains", "id"), (std::vector<dem::Index>{0, 1, 2}));
  EXPECT_EQ(read<double>(path(info), "grains", "radius"), (std::vector{0.5, 0.55, 0.6}));
  EXPECT_EQ(read<std::uint8_t>(path(info), "grains", "role"), (std::vector<std::uint8_t>{1, 0, 2}));
  const auto position = read<Vec3d>(path(info), "grains", "position");
  EXPECT_EQ(position[0], (Vec3d{0.5, -0.1 + 3, 1}));
  EXPECT_DOUBLE_EQ(position[2].x, 2.45);
  const auto displacement = read<Vec3d>(path(info), "grains", "displacement");
  EXPECT_DOUBLE_EQ(displacement[2].x, 6);
  EXPECT_EQ(displacement[1], (Vec3d{0, 0, 0.5}));
}

TEST_F(Snapshot, ListsContactsByTheirIds) {
  const Bed bed;
  const SnapshotInfo info = write_snapshot(directory.path(), "a", 0, bed.scene, bed.state);
  EXPECT_EQ(read<dem::Index>(path(info), "contacts", "i"), (std::vector<dem::Index>{0, 0, 1}));
  EXPECT_EQ(read<dem::Index>(path(info), "contacts", "j"), (std::vector<dem::Index>{1, 2, 2}));
  const auto f_n = read<Vec3d>(path(info), "contacts", "force_normal");
  const auto f = read<Vec3d>(path(info), "contacts", "force");
  EXPECT_LT(f_n[0].x, 0);  // 1 pushes 0 to the left
  EXPECT_LT(f_n[2].x, 0);  // 2 pushes 1 to the left
  EXPECT_NE(f[0].y, 0);
  for (const Vec3d& point : read<Vec3d>(path(info), "contacts", "point")) {
    EXPECT_TRUE(point.x >= 0 && point.x < 3 && point.y >= 0 && point.y < 3);
  }
}

TEST_F(Snapshot, WrapsATinyNegativePositionToZero) {
  Bed bed;
  bed.state.x[1].x = -1e-20;
  const SnapshotInfo info = write_snapshot(directory.path(), "a", 0, bed.scene, bed.state);
  EXPECT_EQ(read<Vec3d>(path(info), "grains", "position")[0].x, 0);
}

TEST_F(Snapshot, HasUnitsEverywhere) {
  const Bed bed;
  const SnapshotInfo info = write_snapshot(directory.path(), "a", 0, bed.scene, bed.state);
  const hid_t file = H5Fopen(path(info).c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  const auto expect_units = [&](const std::string& group, const std::vector<std::string>& names) {
    H5G_info_t about{};
    H5Gget_info_by_name(file, group.c_str(), &about, H5P_DEFAULT);
    EXPECT_EQ(about.nlinks, names.size());
    for (const std::string& name : names) {
      EXPECT_GT(H5Aexists_by_name(file, (group + "/" + name).c_str(), "units", H5P_DEFAULT), 0) << name;
    }
  };
  expect_units("grains", {"id", "role", "radius", "position", "displacement", "velocity", "spin", "rotation",
                          "force", "pressure"});
  expect_units("contacts", {"id", "i", "j", "point", "force_normal", "force_tangential", "force", "overlap"});
  H5Fclose(file);
}

TEST_F(Snapshot, HasTheSameBytesEachTime) {
  const Bed bed;
  const SnapshotInfo info = write_snapshot(directory.path(), "a", 0, bed.scene, bed.state);
  const std::string before = contents(path(info));
  write_snapshot(directory.path(), "a", 0, bed.scene, bed.state);
  EXPECT_EQ(contents(path(info)), before);
}

// 2 x 1 x 3 cells; the grid grows with `height`.
coupling::WaterFields water_of(double height) {
  coupling::WaterFields w;
  w.grid.n = {2, 1, 3};
  w.grid.length = {3, 3, height};
  for (int c = 0; c < 6; ++c) {
    w.pressure.push_back(100 * c), w.porosity.push_back(0.4), w.permeability.push_back(1e-9);
    w.flux.push_back({1e-3 * c, 0, 0});
  }
  return w;
}

TEST_F(Snapshot, HasTheWatersGrid) {
  Bed bed;
  bed.state.water_force = {{3, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  const SnapshotInfo info = write_snapshot(directory.path(), "a", 0, bed.scene, bed.state, water_of(1.5));
  EXPECT_EQ(read<Vec3d>(path(info), "grains", "water_force"),
            (std::vector<Vec3d>{{1, 0, 0}, {2, 0, 0}, {3, 0, 0}}));  // by id
  EXPECT_EQ(read<double>(path(info), "water", "pressure"), (std::vector<double>{0, 100, 200, 300, 400, 500}));
  EXPECT_EQ(read<Vec3d>(path(info), "water", "flux")[5].x, 5e-3);
  const auto group = hdf5::File::open(path(info), H5F_ACC_RDONLY).open_group("water");
  std::int64_t nz = 0;
  Vec3d size{};
  group.get("cells_z", nz), group.get("size", size);
  EXPECT_EQ(nz, 3);
  EXPECT_EQ(size, (Vec3d{3, 3, 1.5}));
  EXPECT_EQ(info.water_size, size);
}

TEST_F(Snapshot, SaysNothingOfWaterWithoutWater) {
  const Bed bed;
  const SnapshotInfo info = write_snapshot(directory.path(), "a", 0, bed.scene, bed.state);
  EXPECT_FALSE(hdf5::File::open(path(info), H5F_ACC_RDONLY).holds("water"));
  write_xdmf(directory.path(), {info});
  EXPECT_FALSE(exists(directory.path() / "water.xdmf"));
  EXPECT_FALSE(exists(directory.path() / "bed.xdmf"));
}

// A dry step is left out; each other step has the height of its grid, and all data where it says.
TEST_F(Snapshot, WaterOpensAsAGrid) {
  Bed bed;
  const SnapshotInfo dry = write_snapshot(directory.path(), "dry", 0, bed.scene, bed.state);
  bed.state.water_force.assign(3, Vec3d{0, 0, 1});
  std::vector<SnapshotInfo> snapshots{dry};
  for (const double height : {1.5, 1.8})
    snapshots.push_back(write_snapshot(directory.path(), "wet-" + std::to_string(snapshots.size()), height,
                                       bed.scene, bed.state, water_of(height)));
  write_xdmf(directory.path(), snapshots);
  const auto script = std::filesystem::path(MORAINE_SOURCE_DIR) / "tests/output/open_xdmf.py";
  for (const char* how : {"--xml", "--vtk"}) {
    const std::string command = "python3 " + script.string() + " " + how + " " + directory.path().string();
    const int status = WEXITSTATUS(std::system(command.c_str()));
    EXPECT_TRUE(status == 0 || (status == 77 && std::string(how) == "--vtk")) << how << " " << status;
  }
}

std::vector<double> times_in(const std::filesystem::path& xdmf) {
  std::vector<double> times;
  std::string text = contents(xdmf);
  const std::string key = "<Time Value=\"";
  for (auto at = text.find(key); at != text.npos; at = text.find(key, at + 1))
    times.push_back(std::stod(text.substr(at + key.size())));
  return times;
}

// Where a stage ends and the next begins there are two snapshots of one time, both kept.
TEST_F(Snapshot, AreListedOnceForEachTime) {
  std::vector<SnapshotInfo> snapshots;
  for (const auto& [name, time, wet] : {std::tuple{"01-a-0", 0.0, 0},
                                        {"01-a-1", 0.3, 1},
                                        {"02-b-0", 0.3, 1},
                                        {"02-b-1", 0.6, 1},
                                        {"03-c-0", 0.6, 0},
                                        {"03-c-1", 0.7, 0}})
    snapshots.push_back({std::string(name) + ".h5", time, 1, 0, wet, wet, wet, {1, 1, 1}});
  write_xdmf(directory.path(), snapshots);
  for (const char* file : {"grains.xdmf", "contacts.xdmf"})
    EXPECT_EQ(times_in(directory.path() / file), (std::vector{0.0, 0.3, 0.6, 0.7})) << file;
  const std::string text = contents(directory.path() / "grains.xdmf");
  for (const char* listed : {"01-a-0", "02-b-0", "03-c-0", "03-c-1"})
    EXPECT_TRUE(contains(text, listed)) << listed;
  // The last step with water is listed, though a dry one of its time follows.
  for (const char* file : {"water.xdmf", "bed.xdmf"}) {
    EXPECT_TRUE(contains(contents(directory.path() / file), "02-b-1")) << file;
    EXPECT_FALSE(contains(contents(directory.path() / file), "01-a-1")) << file;
  }
  EXPECT_EQ(times_in(directory.path() / "water.xdmf"), (std::vector{0.3, 0.6}));
}

TEST_F(Snapshot, CarriesItsDigest) {
  const Bed bed;
  const auto file = path(write_snapshot(directory.path(), "a", 0, bed.scene, bed.state));
  EXPECT_EQ(check_seal(file).kind, "snapshot");
  std::string bytes = contents(file);
  bytes[bytes.size() / 2] ^= 1;
  directory.write("a.h5", bytes);
  EXPECT_THROW(check_seal(file), Damaged);
}

// Also with a step, or all steps, without contacts.
TEST_F(Snapshot, OpensInVtk) {
  const auto script = std::filesystem::path(MORAINE_SOURCE_DIR) / "tests/output/open_xdmf.py";
  const Bed bed;
  Bed loose = bed;
  loose.state.contacts.clear();
  for (const auto& beds : {std::vector{bed, loose, bed}, std::vector{loose, bed}, std::vector{loose}}) {
    std::vector<SnapshotInfo> snapshots;
    for (const Bed& b : beds) {
      const auto number = std::to_string(snapshots.size());
      snapshots.push_back(write_snapshot(directory.path(), "02-shear-" + number,
                                         0.1 * static_cast<double>(snapshots.size()), b.scene, b.state));
    }
    write_xdmf(directory.path(), snapshots);
    const int status = std::system(("python3 " + script.string() + " " + directory.path().string()).c_str());
    if (WEXITSTATUS(status) == 77) GTEST_SKIP() << "python3 has no VTK that reads XDMF";
    EXPECT_EQ(status, 0);
  }
  write_xdmf(directory.path(), {});
  EXPECT_TRUE(contains(contents(directory.path() / "grains.xdmf"), "Temporal"));
}

}  // namespace
}  // namespace moraine::output
