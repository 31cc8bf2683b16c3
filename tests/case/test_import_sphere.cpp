#include "case/import_sphere.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "case/case.hpp"
#include "error.hpp"
#include "output/files.hpp"
#include "temporary_directory.hpp"

namespace moraine::cases {
namespace {

namespace fs = std::filesystem;

std::string published_bed() {
#ifdef MORAINE_SHARED_DIR
  const fs::path shared = MORAINE_SHARED_DIR;
#else
  const fs::path shared = fs::path(__FILE__).parent_path() / "../../../shared";
#endif
  std::ifstream file(shared / "data/sphere-init-1e4.bin", std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

template <class T>
void put(std::string& bytes, std::initializer_list<T> values) {
  for (const T& v : values) bytes.append(reinterpret_cast<const char*>(&v), sizeof v);
}

// Two grains in a box of 1 x 1 x 2 m with its origin at (-1, 0, 0), as version 1.03 has them.
std::string small_bed(double version = 1.03, std::uint32_t grains = 2) {
  std::string b;
  put<double>(b, {version});
  put<std::int32_t>(b, {3});
  put<std::uint32_t>(b, {grains});
  put<double>(b, {1e-6, 2.5, 3, 0.1});
  put<std::uint32_t>(b, {7});
  put<double>(b, {-1, 0, 0, 1, 1, 2});
  put<std::uint32_t>(b, {1, 1, 2});
  put<std::int32_t>(b, {1});
  if (version > 2.135) put<std::int32_t>(b, {0});
  put<double>(b, {-1.25, 0.5, 0.1, 0.1, -0.5, 1.5, 0.3, 0.05});  // x, r
  put<double>(b, {0, 0, 0, 0, 0, 0});                            // displacement
  put<double>(b, {1, 2, 3, 0, 4, 5, 6, 0});                      // v
  put<double>(b, {9, 9, 9, 9, 9, 9});                            // force
  put<double>(b, {7, 8, 9, 10, 11, 12});                         // rotation
  put<double>(b, {0.1, 0.2, 0.3, 0.4, 0.5, 0.6});                // omega
  put<double>(b, {9, 9, 9, 9, 9, 9});                            // torque
  put<double>(b, {0, 0, 0, 0, 0, 0, 0, 0, 0, 0});                // energies, pressure
  put<double>(b, {0, 0, -9.81, 1e7, 2e7, 0});                    // g, k
  if (version > 2.125) put<double>(b, {7e10});                   // Young's modulus
  put<double>(b, {10, 20, 0, 0.6, 0.5, 0, 1e3, 2e3, 0.4, 0.35, 2600});
  return b;
}

std::string fault(const fs::path& bin, const fs::path& case_dir) {
  try {
    import_sphere(bin, case_dir);
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

class ImportSphere : public testing::Test {
 protected:
  // The message about a file of these bytes, without its name.
  std::string fault_of(const std::string& bytes) {
    const auto bin = files.write("bed.bin", bytes);
    const std::string text = fault(bin, files.path() / "x");
    EXPECT_FALSE(fs::exists(files.path() / "x"));
    return text.starts_with(bin.string()) ? text.substr(bin.string().size()) : text;
  }

  TemporaryDirectory files;
};

TEST_F(ImportSphere, a_small_bed_becomes_a_case) {
  for (const double version : {1.03, 2.11, 2.13, 2.15}) {
    const fs::path directory = files.path() / std::to_string(version);
    import_sphere(files.write("bed.bin", small_bed(version)), directory);

    const Case c = load(directory);
    EXPECT_EQ(c.start, directory / "start.h5");
    EXPECT_EQ(c.box_x, 1);
    EXPECT_EQ(c.box_z, 2);
    EXPECT_EQ(c.contact.k_n, 1e7);
    EXPECT_EQ(c.contact.k_t, 2e7);
    EXPECT_EQ(c.gravity, 9.81);
    EXPECT_EQ(c.grains.density, 2600);
    ASSERT_EQ(c.stages.size(), 2u);
    EXPECT_EQ(c.stages[0].gamma_n, 10);
    EXPECT_EQ(c.stages[0].gamma_t, 20);
    EXPECT_EQ(c.stages[0].mu_s, 0.6);
    EXPECT_EQ(c.stages[0].mu_d, 0.5);
    EXPECT_EQ(c.stages[0].wall_gamma_t, 2e3);
    EXPECT_EQ(c.stages[0].wall_mu, 0.35);
    EXPECT_EQ(c.stages[1].strain_rate, 0.05);

    const output::Checkpoint start = output::read_checkpoint(directory / "start.h5");
    const dem::State& s = start.state;
    EXPECT_TRUE(start.finished && !s.staggered);
    ASSERT_EQ(s.size(), 2);
    EXPECT_EQ(s.id, (std::vector<dem::Index>{0, 1}));
    EXPECT_EQ(s.x[0], (dem::Vec3d{0.75, 0.5, 0.1}));
    EXPECT_EQ(s.x[1], (dem::Vec3d{0.5, 0.5, 0.3}));
    EXPECT_EQ(s.x_start, s.x);
    EXPECT_EQ(s.r[1], 0.05);
    EXPECT_EQ(s.v[1], (dem::Vec3d{4, 5, 6}));
    EXPECT_EQ(s.omega[1], (dem::Vec3d{0.4, 0.5, 0.6}));
    EXPECT_EQ(s.rotation[0], (dem::Vec3d{7, 8, 9}));
    EXPECT_EQ(s.force[0], (dem::Vec3d{0, 0, 0}));
    EXPECT_DOUBLE_EQ(s.wall_z(), 0.35);
  }
}

TEST_F(ImportSphere, damaged_files_are_refused) {
  const std::string whole = small_bed();
  for (std::size_t size : {0ul, 5ul, 100ul, 200ul, whole.size() - 1})
    EXPECT_TRUE(fault_of(whole.substr(0, size)).starts_with(": truncated; ")) << size;
  EXPECT_TRUE(
      fault_of(small_bed(1.03, 2000000000)).starts_with(": truncated; 64000000000 bytes expected where "));
  EXPECT_EQ(fault_of(small_bed(3.0)), ": no sphere binary, or damaged: version 3, expected 1.03 to 2.15");
  EXPECT_EQ(fault_of(small_bed(1.03, 0)), ": no sphere binary, or damaged: 0 grains");
  EXPECT_TRUE(fault_of(std::string(3000, 'x')).starts_with(": no sphere binary, or damaged: version "));
  EXPECT_EQ(fault(files.path() / "none.bin", files.path() / "x"),
            (files.path() / "none.bin").string() + ": cannot be read; expected a sphere binary");
  const fs::path loop = files.path() / "loop.bin", pipe = files.path() / "pipe.bin";
  fs::create_symlink(loop, loop);
  ASSERT_EQ(mkfifo(pipe.c_str(), 0666), 0);
  for (const fs::path& none : {loop, pipe, files.path()})
    EXPECT_EQ(fault(none, files.path() / "x"), none.string() + ": cannot be read; expected a sphere binary");
}

TEST_F(ImportSphere, a_case_is_not_overwritten) {
  const auto bin = files.write("bed.bin", small_bed());
  const auto there = files.write("x/case.toml", "mine");
  EXPECT_EQ(fault(bin, files.path() / "x"),
            there.string() + ": is there already; choose another directory or remove it");
  EXPECT_FALSE(fs::exists(files.path() / "x/start.h5"));
}

TEST_F(ImportSphere, the_published_bed) {
  const std::string bytes = published_bed();
  if (bytes.empty()) GTEST_SKIP() << "sphere-init-1e4.bin is not here; set MORAINE_SHARED_DIR";
  const fs::path directory = files.path() / "x";
  import_sphere(files.write("bed.bin", bytes), directory);
  const Case c = load(directory);
  EXPECT_EQ(c.contact.k_n, 1.16e7);
  EXPECT_EQ(c.stages[0].mu_s, 0.6);

  const dem::State s = output::read_checkpoint(directory / "start.h5").state;
  ASSERT_EQ(s.size(), 10000);
  double fastest = 0, mean_radius = 0, mean_speed = 0, mean_rim_speed = 0;
  for (int i = 0; i < s.size(); ++i) {
    fastest = std::max(fastest, std::sqrt(dot(s.v[i], s.v[i])));
    mean_radius += s.r[i] / s.size();
    mean_speed += std::sqrt(dot(s.v[i], s.v[i])) / s.size();
    mean_rim_speed += s.r[i] * std::sqrt(dot(s.omega[i], s.omega[i])) / s.size();
    ASSERT_TRUE(0 <= s.x[i].x && s.x[i].x < c.box_x && 0 <= s.x[i].y && s.x[i].y < c.box_y);
  }
  EXPECT_NEAR(mean_radius, 0.01, 1e-6);
  EXPECT_LT(fastest, 0.02);                    // m/s: the bed has settled
  EXPECT_LT(mean_rim_speed, 10 * mean_speed);  // spin, not rotation, which is 100 times more
}

}  // namespace
}  // namespace moraine::cases
