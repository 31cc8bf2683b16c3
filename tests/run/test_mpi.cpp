// A case on several ranks, started by mpirun as a person would: the same files as on one, also after a rank
// was killed and the run resumed on another number of them; and what is said where it cannot go on.
#include <chrono>
#include <cstdlib>
#include <thread>

#include "program.hpp"

namespace moraine {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

const fs::path program = MORAINE_PROGRAM, module = program.parent_path() / "moraine_mpi.so";

class Mpi : public Program {
 protected:
  void SetUp() override {
    if (!fs::exists(module)) GTEST_SKIP() << "this build has no MPI in it (MORAINE_MPI)";
    if (std::system("command -v mpirun >/dev/null") != 0) GTEST_SKIP() << "no mpirun here";
    ::setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 1), ::setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 1);
    ::setenv("OMPI_MCA_mpi_yield_when_idle", "1", 1);  // more ranks than cores
    ::setenv("OMPI_MCA_rmaps_base_oversubscribe", "1", 1),
        ::setenv("OMPI_MCA_hwloc_base_binding_policy", "none", 1);
  }

  // A thousand grains fall and are pressed: eight chunks.
  std::string thousand() const {
    std::string text = contents(fs::path(MORAINE_SOURCE_DIR) / "cases/quick-shear/case.toml");
    const auto replace = [&](const std::string& old, const std::string& now) {
      text.replace(text.find(old), old.size(), now);
    };
    replace("\"0.4 s\"", "\"0.003 s\""), replace("\"0.15 s\"", "\"0.002 s\"");
    return "stages = [\"settle\", \"consolidate\"]\n" + text;
  }
  static std::vector<std::string> on_ranks(int ranks, const std::vector<std::string>& words,
                                           const fs::path& which = program) {
    std::vector<std::string> all{"--quiet", "-n", std::to_string(ranks), which.string()};
    all.insert(all.end(), words.begin(), words.end());
    return all;
  }
  std::unique_ptr<Process> mpirun(const std::vector<std::string>& words) const {
    return std::make_unique<Process>("mpirun", words, directory.path() / "out", directory.path() / "err");
  }
  std::string said() const { return contents(directory.path() / "err"); }
  void expect_mpirun_error(const std::vector<std::string>& words,
                           const std::vector<std::string>& parts) const {
    EXPECT_NE(mpirun(words)->wait(), 0);
    const std::string err = said();
    for (const std::string& part : parts)
      EXPECT_NE(err.find(part), std::string::npos) << "no \"" << part << "\" in: " << err;
    EXPECT_EQ(std::count(err.begin(), err.end(), '\n'), 1) << err;
  }
  static std::vector<std::string> with_threads(std::vector<std::string> words, int threads) {
    words.insert(words.end(), {"--threads", std::to_string(threads)});
    return words;
  }
  // The processes of ranks that run this case, not mpirun.
  static std::vector<pid_t> ranks_of(const fs::path& which) {
    std::vector<pid_t> found;
    for (const auto& entry : fs::directory_iterator("/proc")) {
      const std::string words = contents(entry.path() / "cmdline");
      if (words.starts_with(program.string()) && words.find(which.string()) != words.npos)
        found.push_back(std::atoi(entry.path().filename().c_str()));
    }
    return found;
  }
};

TEST_F(Mpi, SameFilesOnAnyNumberOfRanks) {
  const fs::path one = make("one", thousand());
  run(one, {}, {"--threads", "1"});
  for (const auto& [ranks, threads] : {std::pair{2, 1}, {3, 2}, {4, 1}, {7, 1}}) {
    SCOPED_TRACE(ranks);
    const fs::path many = make("on " + std::to_string(ranks), thousand());
    ASSERT_EQ(mpirun(on_ranks(ranks, with_threads(to_run(many), threads)))->wait(), 0) << said();
    EXPECT_NE(contents(many / "output/log.txt").find(std::to_string(ranks) + " ranks of "),
              std::string::npos);
    expect_same_results(one, many);
  }
}

// All end soon, the last checkpoint is good, and any number of ranks goes on from it.
int times_resumed(const fs::path& run) {
  const std::string log = contents(run / "output/log.txt");
  int times = 0;
  for (std::size_t at = 0; (at = log.find("resumed: ", at)) != log.npos; ++at) ++times;
  return times;
}

TEST_F(Mpi, ARankThatIsKilled) {
  const std::vector<std::string> often{"output.checkpoint_interval=1e-9"};
  const fs::path whole = make("whole", thousand()), cut = make("cut", thousand());
  run(whole, often, {"--threads", "1"});
  int hits = 0;
  std::vector<std::string> words = with_threads(to_run(cut, often), 1);
  for (const int ranks : {4, 3, 4}) {
    const auto process = mpirun(on_ranks(ranks, words));
    // Once it computes: mpirun itself may hang where a rank is lost while ranks still look for each other.
    while (process->running() && (!fs::exists(checkpoint_of(cut)) || times_resumed(cut) < hits))
      std::this_thread::sleep_for(10ms);
    const auto running = ranks_of(cut);
    if (running.empty()) break;
    ::kill(running.back(), SIGKILL);
    const auto killed = Clock::now();
    EXPECT_NE(process->wait(), 0) << said();
    EXPECT_LT(Clock::now() - killed, 10s);
    EXPECT_TRUE(ranks_of(cut).empty());
    ++hits;
    if (std::find(words.begin(), words.end(), "--resume") == words.end()) words.push_back("--resume");
  }
  EXPECT_GT(hits, 0);
  ASSERT_EQ(mpirun(on_ranks(3, words))->wait(), 0) << said();
  expect_same_results(whole, cut);
}

// mpirun passes this signal on.
TEST_F(Mpi, AnOrderToStopLeavesACheckpoint) {
  const fs::path whole = make("whole", thousand()), cut = make("cut", thousand());
  run(whole, {}, {"--threads", "1"});
  const auto process = mpirun(on_ranks(2, with_threads(to_run(cut), 1)));
  while (process->running() && !fs::exists(checkpoint_of(cut))) std::this_thread::sleep_for(10ms);
  process->send(SIGUSR1);
  EXPECT_NE(process->wait(), 0);
  EXPECT_NE(said().find("--resume goes on from here"), std::string::npos) << said();
  run(cut, {}, {"--resume", "--threads", "1"});
  expect_same_results(whole, cut);
}

TEST_F(Mpi, ErrorsThatNameTheirRemedy) {
  const fs::path small = make("small", small_case());
  expect_mpirun_error(on_ranks(4, to_run(small)),
                      {"moraine: too few grains for 4 ranks", "start it on at most 3 ranks"});
  EXPECT_FALSE(fs::exists(small / "output"));
  expect_mpirun_error(on_ranks(2, to_run(directory.path() / "nothing")),
                      {"moraine: ", "nothing", "case.toml"});
  expect_mpirun_error(on_ranks(2, {"sweep", small.string(), "--set", "f=0.1,0.2"}),
                      {"moraine: sweep: ", "start it without mpirun"});
  expect_mpirun_error(on_ranks(2, {"run", small.string(), "--backend", "cuda"}),
                      {"moraine: ", "--backend c"});

  const fs::path other = directory.path() / "other/moraine";
  fs::create_directories(other.parent_path());
  fs::copy(program, other);
  expect_mpirun_error(on_ranks(2, to_run(small), other),
                      {"moraine: started on 2 ranks, but there is no ", "configure with -DMORAINE_MPI=ON"});

  fs::copy(module, other.parent_path() / "moraine_mpi.so");
  std::ofstream(other, std::ios::app) << "another build";
  std::vector<std::string> both = on_ranks(1, to_run(small));
  both.push_back(":");
  for (const std::string& word : on_ranks(1, to_run(small), other))
    if (word != "--quiet") both.push_back(word);
  both.push_back("--quiet");
  expect_mpirun_error(both, {"moraine: rank 1 (on ", "another build of moraine than rank 0"});
}

}  // namespace
}  // namespace moraine
