// What a person is told, and what stands on the disk, when a file cannot be written.
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "samples.hpp"
#include "temporary_directory.hpp"

namespace moraine::output {
namespace {

std::size_t files_in(const std::filesystem::path& directory) {
  using Iterator = std::filesystem::directory_iterator;
  return static_cast<std::size_t>(std::distance(Iterator(directory), Iterator()));
}

// Fills a series until it fails; the message.
std::string overfill(Series& series) {
  return message([&] {
    for (int k = 0; k < 100'000; ++k) series.append(Row{});
  });
}

TEST(WriteText, ReplacesTheWholeFile) {
  const TemporaryDirectory directory;
  const auto path = directory.write("summary.txt", "a longer text that stood here before");
  write_text(path, "short");
  EXPECT_EQ(contents(path), "short");
  EXPECT_EQ(files_in(directory.path()), 1u);
}

TEST(WriteText, NamesTheFileAndTheCause) {
  const TemporaryDirectory directory;
  const auto file = directory.write("file", "");
  const auto why_not = [](const std::filesystem::path& path) {
    return message([&] { write_text(path, "text"); });
  };
  for (const auto& [path, cause] : {std::pair{file / "a.txt", "Not a directory"},
                                    {directory.path() / "none" / "a.txt", "No such file or directory"}}) {
    EXPECT_EQ(why_not(path), path.string() + ": cannot create the file: " + cause);
  }
  const auto taken = directory.path() / "taken";
  std::filesystem::create_directory(taken);
  EXPECT_EQ(why_not(taken), taken.string() + ": cannot replace the file: Is a directory");
  EXPECT_EQ(files_in(directory.path()), 2u);
}

TEST(FailingDisk, UnwritableDirectory) {
  const TemporaryDirectory directory;
  ::chmod(directory.path().c_str(), 0555);
  const bool root = ::geteuid() == 0;  // whom no permission stops
  ASSERT_EQ(root ? ::seteuid(65534) : 0, 0);
  const auto path = directory.path() / "checkpoint.h5";
  const std::string text = message([&] { write_checkpoint(path, {}); });
  const std::string series = message([&] { Series(path, {}); });
  ASSERT_EQ(root ? ::seteuid(0) : 0, 0);
  ::chmod(directory.path().c_str(), 0755);
  EXPECT_EQ(text, path.string() + ": cannot create the file: Permission denied");
  EXPECT_TRUE(contains(series, path.string())) << series;
  EXPECT_TRUE(contains(series, "Permission denied")) << series;
}

TEST(FailingDisk, FileTooLarge) {
  const TemporaryDirectory directory;
  const auto text = directory.write("a.txt", "before");
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{1 << 20, before.rlim_max};
  const auto handler = ::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  const std::string text_error = message([&] { write_text(text, std::string(2 << 20, 'x')); });
  std::string series_error;
  std::size_t rows = 0;
  {
    Series series(directory.path() / "series.h5", {});
    series_error = overfill(series);
    rows = series.rows().size();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  ::signal(SIGXFSZ, handler);

  EXPECT_EQ(text_error, text.string() + ": cannot write: File too large");
  EXPECT_EQ(contents(text), "before");
  EXPECT_TRUE(contains(series_error, (directory.path() / "series.h5").string() + ": ")) << series_error;
  EXPECT_TRUE(contains(series_error, "File too large")) << series_error;
  EXPECT_GT(rows, 0u);
  EXPECT_GE(read_series(directory.path() / "series.h5").size(), rows);
}

// Wherever in a file that HDF5 makes the disk is full: among rows, names, or the seal.
TEST(FailingDisk, TooLargeAtAnyPlace) {
  const TemporaryDirectory directory;
  RandomNumbers number;
  Checkpoint small, large;
  small.state = random_state(number, 1);
  large.state = random_state(number, 100);
  const auto path = directory.path() / "checkpoint.h5", other = directory.path() / "other.h5";
  write_checkpoint(path, small);
  write_checkpoint(other, large);
  const std::string before = contents(path);
  const auto size = std::filesystem::file_size(other);
  rlimit unlimited{};
  getrlimit(RLIMIT_FSIZE, &unlimited);
  const auto handler = ::signal(SIGXFSZ, SIG_IGN);
  for (std::uintmax_t most = 0; most < size; most += size / 40) {
    const rlimit limit{most, unlimited.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
    const std::string why = message([&] { write_checkpoint(path, large); });
    setrlimit(RLIMIT_FSIZE, &unlimited);
    EXPECT_TRUE(why.starts_with(path.string() + ": ") && contains(why, "cannot ") &&
                contains(why, ": File too large"))
        << most << " of " << size << " bytes: " << why;
    EXPECT_EQ(contents(path), before);
    EXPECT_EQ(files_in(directory.path()), 2u);
  }
  ::signal(SIGXFSZ, handler);
  write_checkpoint(path, large);
  EXPECT_EQ(contents(path), contents(other));
}

TEST(FailingDisk, Full) {
  const TemporaryDirectory directory;
  const auto disk = directory.path() / "disk";
  std::filesystem::create_directory(disk);
  // A file system of this process only, so that nothing stays mounted.
  if (::unshare(CLONE_NEWNS) != 0 || ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
      ::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=1m") != 0) {
    GTEST_SKIP() << "no permission to mount a small file system";
  }
  RandomNumbers number;
  Checkpoint small, large;
  small.state = random_state(number, 10);
  large.state = random_state(number, 10'000);
  const auto path = disk / "checkpoint.h5", series_path = disk / "series.h5";

  write_checkpoint(path, small);
  EXPECT_EQ(message([&] { write_checkpoint(path, large); }),
            path.string() + ": cannot write: No space left on device");
  EXPECT_EQ(read_checkpoint(path).state.x, small.state.x);
  EXPECT_EQ(files_in(disk), 1u);
  {
    Series series(series_path, {});
    const std::string error = overfill(series);
    EXPECT_TRUE(contains(error, series_path.string() + ": ")) << error;
    EXPECT_TRUE(contains(error, "No space left on device")) << error;
  }
  EXPECT_FALSE(read_series(series_path).empty());
  const std::string error = message([&] { Series(disk / "long.h5", std::vector<Row>(10'000)); });
  EXPECT_TRUE(contains(error, (disk / "long.h5").string())) << error;
  EXPECT_TRUE(contains(error, "No space left on device")) << error;
  EXPECT_EQ(files_in(disk), 2u);
  { Series again(directory.path() / "series.h5", {Row{}}); }
  EXPECT_EQ(read_series(directory.path() / "series.h5").size(), 1u);
  ::umount(disk.c_str());
}

}  // namespace
}  // namespace moraine::output
