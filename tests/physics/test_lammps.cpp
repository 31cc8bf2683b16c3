// The same settled bed in LAMMPS (gran/hooke/history): the forces of its own configuration. Both sum the same overlaps, so
// they may part by rounding only.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "backends.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

namespace fs = std::filesystem;

// The parts of a `sphere` file (version 1.03 to 2.15, little-endian) that the script reads, too.
Bed read_bed(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  const auto number = [&]<class T>(T value) {
    in.read(reinterpret_cast<char*>(&value), sizeof value);
    return value;
  };
  const auto doubles = [&](std::size_t n) {
    std::vector<double> v(n);
    in.read(reinterpret_cast<char*>(v.data()), static_cast<std::streamsize>(8 * n));
    return v;
  };
  const double version = number(0.0);
  number(std::int32_t{});
  const std::size_t n = number(std::uint32_t{});
  doubles(4), number(std::uint32_t{}), doubles(3);
  const std::vector<double> box = doubles(3);
  for (int k = 0; k < (version >= 2.14 ? 5 : 4); ++k) number(std::int32_t{});
  const std::vector<double> x = doubles(4 * n);
  doubles((version >= 1.03 ? 3 : 2) * n + 4 * n + 12 * n + 5 * n + 3);
  const std::vector<double> k = doubles(3);
  if (version >= 2.13) doubles(1);
  const std::vector<double> law = doubles(11);  // gamma_n, _t, _r, mu_s, mu_d, ..., density
  EXPECT_TRUE(in.good());

  std::vector<double> r(n);
  std::vector<Vec3d> at(n);
  for (std::size_t i = 0; i < n; ++i) at[i] = {x[4 * i], x[4 * i + 1], x[4 * i + 2]}, r[i] = x[4 * i + 3];
  Bed bed{{}, grains_at_rest(r, at)};
  bed.scene.box = {box[0], box[1], box[2]};
  bed.scene.density = law[10];
  bed.scene.grain = {k[0], k[1], 0, 0, law[4], law[4]};
  return bed;
}

// As the script sets it up: layers of two mean diameters held in all directions, the upper one moving.
Bed lammps_scene(const fs::path& path) {
  Bed bed = read_bed(path);
  Scene& s = bed.scene;
  s.gravity = 9.81, s.dt = 2e-6, s.wall = s.grain;
  s.shear = {Shear::Drive::velocity, 0.01, 0, true};
  double d = 0, top = 0;
  for (const double r : bed.state.r) d += 2 * r / bed.state.size();
  for (Index i = 0; i < bed.state.size(); ++i) top = std::max(top, bed.state.x[i].z + bed.state.r[i]);
  for (Index i = 0; i < bed.state.size(); ++i) {
    const double z = bed.state.x[i].z;
    bed.state.role[i] = z < 2 * d ? Role::bottom : z > top - 2 * d ? Role::top : Role::free;
  }
  sort_spatially(s, bed.state);
  return bed;
}

TEST(Lammps, SameForcesOnTheSameBed) {
  const fs::path shared = MORAINE_SHARED_DIR, script = shared / "peers/lammps-bed";
  const fs::path file = shared / "data/sphere-init-1e4.bin";
  if (std::system("command -v lmp python3 > /dev/null") != 0) GTEST_SKIP() << "lmp or python3 is not installed";
  if (!fs::exists(script) || !fs::exists(file)) GTEST_SKIP() << "no " << script << " or no " << file;

  const fs::path dump = fs::path(testing::TempDir()) / ("lammps-bed-" + std::to_string(::getpid()) + ".txt");
  const std::string command =
      "python3 '" + script.string() + "' '" + file.string() + "' --steps 0 --dump '" + dump.string() + "' > /dev/null";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const Bed bed = lammps_scene(file);
  std::vector<Vec3d> theirs(bed.state.size());
  std::ifstream in(dump);
  std::string line;
  for (int k = 0; k < 9; ++k) std::getline(in, line);  // heading
  for (Index k = 0; k < bed.state.size(); ++k) {
    int id;
    double skip;
    in >> id;
    for (int q = 0; q < 9; ++q) in >> skip;
    ASSERT_TRUE(in >> theirs.at(id - 1).x >> theirs[id - 1].y >> theirs[id - 1].z >> skip >> skip >> skip);
  }
  in.close();
  fs::remove(dump);

  for (const Backend backend : {Backend::cpu, Backend::reference}) {
    const auto engine = make_engine(backend, 1);
    engine->load(bed.scene, bed.state);
    const State ours = engine->state();
    double largest = 0, apart = 0;
    for (Index i = 0; i < ours.size(); ++i) {
      if (ours.role[i] != Role::free) continue;
      const Vec3d weight{0, 0, -mass(bed.scene, ours.r[i]) * bed.scene.gravity};  // theirs has it in the force
      largest = std::max(largest, length(theirs[ours.id[i]]));
      apart = std::max(apart, length(ours.force[i] + weight - theirs[ours.id[i]]));
      largest = std::max(largest, length(ours.force[i]));
    }
    RecordProperty("apart", std::to_string(apart / largest));
    EXPECT_LT(apart, 1e-9 * largest);
    std::printf("lammps %g\n", apart / largest);
  }
}

}  // namespace
}  // namespace moraine::dem
