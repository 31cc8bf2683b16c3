// Files that are written aside: the same bytes as if they had been built in memory, and no more memory than a
// block.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "output/hdf5.hpp"
#include "output/sealed.hpp"
#include "samples.hpp"
#include "temporary_directory.hpp"

namespace moraine::output {
namespace {

// Rows enough for two blocks and a bit, so that every way of writing is taken.
constexpr std::size_t many = 150'000;

void fill(const hdf5::Group& file, bool row_by_row) {
  RandomNumbers number;
  std::vector<dem::Vec3d> vectors;
  std::vector<std::int32_t> integers;
  for (std::size_t k = 0; k < many; ++k) {
    vectors.push_back(number.vector());
    integers.push_back(static_cast<std::int32_t>(k));
  }
  const hdf5::Group group = file.create_group("grains");
  group.set("time", number());
  group.write("text", std::string(70'000, '#'));
  group.write("none", std::vector<double>{}, "m");
  if (row_by_row) {
    group.write_rows<dem::Vec3d>(
        "x", many, [&](std::size_t k) { return vectors[k]; }, "m");
    group.write_rows<std::int32_t>(
        "id", many, [&](std::size_t k) { return integers[k]; }, "1");
    group.write_rows<double>("nothing", 0, [](std::size_t) { return 0.0; });
  } else {
    group.write("x", vectors, "m");
    group.write("id", integers, "1");
    group.write("nothing", std::vector<double>{});
  }
}

// As files were made before: whole, by HDF5's driver for memory.
struct InMemory : hdf5::Group {
  InMemory() : Group(create(), "memory", "") {}
  static hdf5::Handle create() {
    const hid_t creation = H5Pcreate(H5P_FILE_CREATE), access = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_obj_track_times(creation, false);
    H5Pset_userblock(creation, seal_size);
    H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_V110);
    H5Pset_fapl_core(access, std::size_t{1} << 20, false);
    const hid_t file = H5Fcreate("memory", H5F_ACC_TRUNC, creation, access);
    H5Pclose(creation), H5Pclose(access);
    return {file, H5Fclose};
  }
  std::string bytes() const {
    H5Fflush(id_, H5F_SCOPE_LOCAL);
    std::string image(static_cast<std::size_t>(H5Fget_file_image(id_, nullptr, 0)), '\0');
    H5Fget_file_image(id_, image.data(), image.size());
    return image;
  }
};

TEST(Aside, HasTheBytesOfAFileBuiltInMemory) {
  const TemporaryDirectory directory;
  InMemory before;
  fill(before, false);
  for (const bool row_by_row : {false, true}) {
    Aside place(directory.path() / "a.h5");
    auto file = hdf5::File::create(place);
    fill(file, row_by_row);
    file.close();
    seal(place, "sample", 1);
    place.put_in_place();
    EXPECT_EQ(contents(place.path()).substr(seal_size), before.bytes());
    EXPECT_EQ(check_seal(place.path()).kind, "sample");
  }
}

TEST(Aside, ReadsInBlocksWhatItWrote) {
  const TemporaryDirectory directory;
  Aside place(directory.path() / "a.h5");
  auto file = hdf5::File::create(place);
  fill(file, true);
  file.close();
  place.put_in_place();
  const auto group = hdf5::File::open(place.path(), H5F_ACC_RDONLY).open_group("grains");
  std::vector<dem::Vec3d> whole, rows;
  group.read("x", whole);
  group.read_rows<dem::Vec3d>(
      "x", [&](std::size_t count) { rows.resize(count); },
      [&](std::size_t k, const dem::Vec3d& x) { rows[k] = x; });
  EXPECT_EQ(rows.size(), many);
  EXPECT_EQ(rows, whole);
}

TEST(Aside, LeavesNothingUnlessItWasPutInPlace) {
  const TemporaryDirectory directory;
  const auto path = directory.write("a.txt", "before");
  {
    Aside place(path);
    place.write("after");
    EXPECT_TRUE(exists(place.file()));
  }
  EXPECT_EQ(contents(path), "before");
  using Iterator = std::filesystem::directory_iterator;
  EXPECT_EQ(std::distance(Iterator(directory.path()), Iterator()), 1);
}

// Neither to write nor to read a checkpoint takes much beside the state itself.
TEST(Aside, TakesNoMemoryForTheFile) {
  const TemporaryDirectory directory;
  const auto path = directory.path() / "checkpoint.h5";
  const auto peak = [] {
    rusage used{};
    getrusage(RUSAGE_SELF, &used);
    return 1024.0 * static_cast<double>(used.ru_maxrss);
  };
  RandomNumbers number;
  Checkpoint c;
  c.state = random_state(number, 200'000);
  const double before = peak();
  write_checkpoint(path, c);
  const double file = static_cast<double>(std::filesystem::file_size(path));
  EXPECT_GT(file, 80e6);
  EXPECT_LT(peak() - before, 0.1 * file);
  c = {};
  const Checkpoint read = read_checkpoint(path);
  EXPECT_EQ(read.state.size(), 200'000);
  EXPECT_LT(peak() - before, 0.5 * file);
}

}  // namespace
}  // namespace moraine::output
