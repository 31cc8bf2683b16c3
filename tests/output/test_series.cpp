#include <gtest/gtest.h>
#include <hdf5.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>

#include "output/hdf5.hpp"
#include "samples.hpp"
#include "temporary_directory.hpp"

namespace moraine::output {
namespace {

class SeriesFile : public testing::Test {
 protected:
  std::vector<Row> some_rows(int count) {
    std::vector<Row> rows;
    for (int k = 0; k < count; ++k) rows.push_back(number.row());
    return rows;
  }
  void expect_rows(const std::vector<Row>& rows) {
    const std::vector<Row> read = read_series(path);
    ASSERT_EQ(read.size(), rows.size());
    EXPECT_TRUE(std::equal(read.begin(), read.end(), rows.begin(), same_bits));
  }
  bool opens_plainly() const {
    const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    if (file >= 0) H5Fclose(file);
    return file >= 0;
  }

  RandomNumbers number;
  TemporaryDirectory directory;
  std::filesystem::path path = directory.path() / "series.h5";
};

TEST_F(SeriesFile, NamesEveryMemberOfARow) {
  EXPECT_EQ(columns().size() * sizeof(double), sizeof(Row));
  Row row{};
  row.shear_friction = 0.6;
  row.residue = 1e-9;
  { Series series(path, {row}); }
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  for (const auto& [name, value] : {std::pair{"shear_friction", 0.6}, {"residue", 1e-9}}) {
    double read = 0;
    const hid_t dataset = H5Dopen2(file, name, H5P_DEFAULT);
    H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, &read);
    EXPECT_EQ(read, value);
    EXPECT_GT(H5Aexists(dataset, "units"), 0);
    H5Dclose(dataset);
  }
  H5Fclose(file);
}

TEST_F(SeriesFile, KeepsEveryBit) {
  for (const int given : {0, 1, 700}) {
    std::vector<Row> rows = some_rows(given);
    {
      Series series(path, rows, /*with_water=*/true, /*with_sides=*/true, /*with_asked=*/true);
      expect_rows(rows);
      for (int k = 0; k < 300; ++k) {
        rows.push_back(number.row());
        series.append(rows.back());
      }
      expect_rows(rows);
      EXPECT_EQ(series.rows().size(), rows.size());
    }
    expect_rows(rows);
    EXPECT_TRUE(opens_plainly());
  }
}

// As files without pore water have always been.
TEST_F(SeriesFile, HasNoColumnsOfWaterWithoutWater) {
  const std::vector<Row> rows = some_rows(3);
  { Series series(path, {rows[0]}); }
  const auto has = [&](std::size_t column) {
    return hdf5::File::open(path, H5F_ACC_RDONLY).holds(columns()[column].name);
  };
  for (std::size_t c = 0; c < columns().size(); ++c) EXPECT_EQ(has(c), c < dry_columns) << columns()[c].name;
  const std::vector<Row> read = read_series(path);
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read[0].residue, rows[0].residue);
  EXPECT_EQ(read[0].water_balance, 0);
  EXPECT_EQ(std::string(columns()[dry_columns].name), "wall_water_pressure");
}

TEST_F(SeriesFile, CanBeReadWhileItGrows) {
  const std::vector<Row> rows = some_rows(600);
  const pid_t reader = fork();  // before the file is open: HDF5 would give the child its parent's view of it
  if (reader == 0) {
    while (!exists(path)) usleep(100);
    std::size_t seen = 0;
    const std::string complaint = message([&] {
      while (seen < rows.size()) {
        const std::vector<Row> read = read_series(path);
        if (read.size() < seen) throw error("rows have gone: ", read.size(), " of ", seen);
        seen = read.size();
        if (!std::equal(read.begin(), read.end(), rows.begin(), same_bits)) throw error("another row");
      }
    });
    std::fputs(complaint.c_str(), stderr);
    _exit(complaint.empty() ? 0 : 1);
  }
  Series series(path, {}, true, true, true);
  for (const Row& row : rows) {
    series.append(row);
    usleep(200);
  }
  int status = 0;
  waitpid(reader, &status, 0);
  EXPECT_EQ(status, 0);
}

TEST_F(SeriesFile, IsReadAndReplacedAfterAKill) {
  const std::vector<Row> rows = some_rows(5);
  const pid_t writer = fork();
  if (writer == 0) {
    Series series(path, {}, true, true, true);
    for (const Row& row : rows) series.append(row);
    raise(SIGKILL);
  }
  waitpid(writer, nullptr, 0);
  expect_rows(rows);

  {
    Series series(path, {rows[0], rows[1]}, true, true, true);
    series.append(rows[2]);
  }
  expect_rows({rows[0], rows[1], rows[2]});
  EXPECT_TRUE(opens_plainly());
}

TEST_F(SeriesFile, RefusesWhatIsNoSeries) {
  const auto why_not = [&] { return message([&] { read_series(path); }); };
  EXPECT_EQ(why_not(), path.string() + ": cannot open the file: No such file or directory");
  directory.write("series.h5", "time,stress\n");
  EXPECT_EQ(why_not(), path.string() + ": not an HDF5 file");
  write_checkpoint(path, {});
  EXPECT_TRUE(contains(why_not(), path.string() + ": /stage: cannot open the dataset")) << why_not();
}

// HDF5 would read again and again what does not fit its checksum.
TEST_F(SeriesFile, RefusesGarbageInSeconds) {
  { Series series(path, some_rows(1000)); }
  const std::string whole = contents(path);
  std::mt19937 random(2013);
  for (const std::size_t from : {12, 48, 100, 600, 5000}) {
    std::string bytes = whole;
    for (std::size_t k = from; k < bytes.size(); ++k) bytes[k] = static_cast<char>(random());
    directory.write("series.h5", bytes);
    const auto began = std::chrono::steady_clock::now();
    EXPECT_NE(message([&] { read_series(path); }), "") << "garbage from byte " << from;
    EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(5));
  }
}

}  // namespace
}  // namespace moraine::output
