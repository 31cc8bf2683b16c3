// Runs the program as a person does, and a case small enough to take a second.
#pragma once
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <bit>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "output/files.hpp"
#include "temporary_directory.hpp"

extern char** environ;

namespace moraine {

namespace fs = std::filesystem;

inline std::string contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// A program on its way; killed where a test forgets it.
class Process {
 public:
  Process(const std::string& program, std::vector<std::string> words, const fs::path& out,
          const fs::path& err) {
    words.insert(words.begin(), program);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 1, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    posix_spawn_file_actions_addopen(&files, 2, err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    const int failed = posix_spawnp(&id_, program.c_str(), &files, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (failed) throw std::runtime_error(program + " does not start");
  }
  ~Process() {
    if (!running()) return;
    send(SIGKILL);
    wait();
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  bool running() {
    if (!ended_) ended_ = waitpid(id_, &status_, WNOHANG) == id_;
    return !ended_;
  }
  void send(int signal) {
    if (running()) ::kill(id_, signal);
  }
  // Its exit status, or minus the signal that ended it.
  int wait() {
    if (!ended_) ended_ = waitpid(id_, &status_, 0) == id_;
    return WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
  }

 private:
  pid_t id_ = 0;
  int status_ = 0;
  bool ended_ = false;
};

struct Outcome {
  int status;
  std::string out, err;
};

class Program : public testing::Test {
 protected:
  // Some hundred grains, in three chunks of memory, that settle, are consolidated and sheared: soft and fast,
  // so that it takes a fraction of a second.
  static std::string small_case() {
    return contents(fs::path(MORAINE_SOURCE_DIR) / "tests/run/small-bed/case.toml");
  }

  // The same with sizes of some 1:18 at random places.
  static std::string graded_case() {
    std::string text = small_case();
    const auto replace = [&](const std::string& old, const std::string& now) {
      text.replace(text.find(old), old.size(), now);
    };
    replace("[grains]", "[guards]\nmax_overlap = 0.5\n[box]\nx = 0.3\ny = 0.3\n[grains]");
    replace("columns_x = 5\ncolumns_y = 5\ncell = 1.3",
            "distribution = \"fractal\"\nfractal_dimension = 1.2\nradius_min = 0.003\nradius_max = 0.06\n"
            "placement = \"random\"");
    replace("0.6 s", "0.1 s"), replace("0.2 s", "0.05 s"), replace("strain = 0.2", "strain = 0.03");
    replace("gamma_n = 10", "gamma_n = 2"),
        replace("strain = 0.03", "strain = 0.03\nbottom_layer = 0.04\ntop_layer = 0.06");
    for (std::size_t at; (at = text.find("= 40")) != std::string::npos;) text.replace(at, 4, "= 5");
    return text;
  }

  // A directory with that case.toml.
  fs::path make(const std::string& name, const std::string& text) const {
    return directory.write(name + "/case.toml", text).parent_path();
  }

  std::unique_ptr<Process> start(const std::vector<std::string>& words) const {
    return std::make_unique<Process>(MORAINE_PROGRAM, words, directory.path() / "out",
                                     directory.path() / "err");
  }
  Outcome moraine(const std::vector<std::string>& words) const {
    const int status = start(words)->wait();
    return {status, contents(directory.path() / "out"), contents(directory.path() / "err")};
  }
  // On the CPU, without progress; --set for each override.
  static std::vector<std::string> to_run(const fs::path& which,
                                         const std::vector<std::string>& overrides = {}) {
    std::vector<std::string> words{"run", which.string(), "--quiet", "--backend", "cpu"};
    for (const std::string& o : overrides) words.insert(words.end(), {"--set", o});
    return words;
  }
  // Fails with one line on standard error that holds all these words.
  void expect_error(const std::vector<std::string>& command, const std::vector<std::string>& words) const {
    const Outcome o = moraine(command);
    EXPECT_EQ(o.status, 1) << o.err;
    EXPECT_EQ(o.out, "");
    EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
    EXPECT_TRUE(o.err.starts_with("moraine: ")) << o.err;
    for (const std::string& word : words)
      EXPECT_NE(o.err.find(word), std::string::npos) << "no \"" << word << "\" in: " << o.err;
  }
  void run(const fs::path& which, const std::vector<std::string>& overrides = {},
           const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = to_run(which, overrides);
    words.insert(words.end(), more.begin(), more.end());
    const Outcome o = moraine(words);
    ASSERT_EQ(o.status, 0) << o.err;
  }

  TemporaryDirectory directory;
};

inline fs::path checkpoint_of(const fs::path& run) { return run / "output/checkpoint.h5"; }
inline fs::path series_of(const fs::path& run) { return run / "output/series.h5"; }

inline std::vector<fs::path> snapshots_of(const fs::path& run) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(run / "output/snapshots"))
    if (entry.path().extension() == ".h5") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

inline bool same_bits(const output::Row& a, const output::Row& b) {
  using Bits = std::array<std::uint64_t, sizeof(output::Row) / 8>;
  return std::bit_cast<Bits>(a) == std::bit_cast<Bits>(b);
}

// Series, every snapshot and the final state, bit by bit; what the case was called or asked for does not
// count.
inline void expect_same_results(const fs::path& a, const fs::path& b) {
  const auto rows_a = output::read_series(series_of(a)), rows_b = output::read_series(series_of(b));
  ASSERT_EQ(rows_a.size(), rows_b.size());
  for (std::size_t k = 0; k < rows_a.size(); ++k)
    ASSERT_TRUE(same_bits(rows_a[k], rows_b[k])) << "row " << k << ", t = " << rows_a[k].time << " s";

  const auto snapshots_a = snapshots_of(a), snapshots_b = snapshots_of(b);
  ASSERT_EQ(snapshots_a.size(), snapshots_b.size());
  for (std::size_t k = 0; k < snapshots_a.size(); ++k) {
    EXPECT_EQ(snapshots_a[k].filename(), snapshots_b[k].filename());
    EXPECT_TRUE(contents(snapshots_a[k]) == contents(snapshots_b[k])) << snapshots_a[k].filename();
  }
  for (const char* name : {"grains.xdmf", "contacts.xdmf"})
    EXPECT_TRUE(contents(a / "output/snapshots" / name) == contents(b / "output/snapshots" / name)) << name;

  // The same numbers give the same bytes of a checkpoint.
  const TemporaryDirectory aside;
  const auto bytes = [&](const fs::path& run) {
    output::Checkpoint c = output::read_checkpoint(checkpoint_of(run));
    c.case_text = "";
    c.scene.neighbour_margin = 0;
    output::write_checkpoint(aside.path() / "checkpoint.h5", c);
    return contents(aside.path() / "checkpoint.h5");
  };
  EXPECT_TRUE(bytes(a) == bytes(b)) << "final state";
}

}  // namespace moraine
