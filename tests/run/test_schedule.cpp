// When stages record, and dt = "auto" from end to end.
#include "run/schedule.hpp"

#include <csignal>

#include "program.hpp"

namespace moraine {
namespace {

class Schedule : public Program {
 protected:
  // Every row and snapshot at its time: multiples of the intervals, and the end. `off` is what a step may be.
  void expect_times(const fs::path& which, double off) {
    const auto rows = output::read_series(series_of(which));
    const double durations[] = {0.6, 0.2, 0.2};
    std::size_t k = 0;
    for (int stage = 0; stage < 3; ++stage)
      for (int n = 0; n <= std::lround(durations[stage] / 0.01); ++n, ++k) {
        ASSERT_LT(k, rows.size());
        EXPECT_EQ(rows[k].stage, stage);
        EXPECT_NEAR(rows[k].stage_time, n * 0.01, off) << "stage " << stage;
      }
    EXPECT_EQ(k, rows.size());
    EXPECT_EQ(snapshots_of(which).size(), 7u + 3u + 3u);
  }
};

// A step that divides no interval: counted in steps, the records would drift away from their times, and the
// last two of a stage stand a few steps apart.
TEST_F(Schedule, RecordsAtTimes) {
  const auto fixed = make("fixed", small_case());
  ASSERT_NO_FATAL_FAILURE(run(fixed, {"model.dt=1.37e-4"}));
  expect_times(fixed, 0.5 * 1.37e-4 * 1.001);
}

TEST_F(Schedule, AutomaticStepMeetsTheTimes) {
  const auto automatic = make("automatic", small_case());
  ASSERT_NO_FATAL_FAILURE(run(automatic, {"model.dt=auto"}));
  expect_times(automatic, 1e-12);
  // The loose grains take longer steps than the bed that they make.
  const auto end = output::read_checkpoint(checkpoint_of(automatic));
  EXPECT_GT(end.critical_step, 0);
  EXPECT_LE(end.scene.dt, 0.5 * end.critical_step);
  EXPECT_GT(end.scene.dt, 0.4 * end.critical_step);
}

TEST_F(Schedule, AutomaticStepOfAnyThreadCount) {
  const auto one = make("one", small_case()), two = make("two", small_case());
  ASSERT_NO_FATAL_FAILURE(run(one, {"model.dt=auto"}, {"--threads", "1"}));
  ASSERT_NO_FATAL_FAILURE(run(two, {"model.dt=auto"}, {"--threads", "2"}));
  expect_same_results(one, two);
}

// Stopped wherever it happens to be, between estimates and between records.
TEST_F(Schedule, AutomaticStepAfterRestart) {
  const auto whole = make("whole", small_case()), cut = make("cut", small_case());
  ASSERT_NO_FATAL_FAILURE(run(whole, {"model.dt=auto"}));
  int stops = 0;
  for (bool over = false; !over; ++stops) {
    auto words = to_run(cut, {"model.dt=auto"});
    if (fs::exists(cut / "output")) words.push_back("--resume");
    const auto process = start(words);
    usleep(60000);
    process->send(SIGTERM);
    over = process->wait() == 0;
    ASSERT_LT(stops, 1000) << contents(directory.path() / "err");
  }
  EXPECT_GT(stops, 3);
  expect_same_results(whole, cut);
}

TEST_F(Schedule, CheckPrintsTheCriticalStep) {
  const auto bed = make("bed", small_case());
  ASSERT_NO_FATAL_FAILURE(run(bed));
  const auto again = make("again", "start = \"../bed\"\n" + small_case());
  Outcome o = moraine({"check", again.string(), "--set", "model.dt=auto"});
  EXPECT_NE(o.out.find("critical"), std::string::npos) << o.out;
  const std::string before = "the step is ";
  const auto at = o.out.find(before);
  ASSERT_NE(at, std::string::npos) << o.out;
  const double share =
      std::stod(o.out.substr(at + before.size()));  // fitted to the next record: not above 0.5
  EXPECT_LE(share, 0.5);
  EXPECT_GT(share, 0.4);
  EXPECT_EQ(o.out.find("blow up"), std::string::npos) << o.out;
  o = moraine({"check", again.string(), "--set", "model.dt=2e-3"});
  EXPECT_NE(o.out.find("blow up"), std::string::npos) << o.out;
}

TEST_F(Schedule, RefusesOtherWords) {
  const auto bed = make("bed", small_case());
  for (const char* wrong : {"model.dt=quick", "model.dt=-1", "model.dt=3 kg"}) {
    const Outcome o = moraine({"check", bed.string(), "--set", wrong});
    EXPECT_NE(o.status, 0);
    EXPECT_NE(o.err.find("or \"auto\""), std::string::npos) << o.err;
    EXPECT_NE(o.err.find("model.dt"), std::string::npos) << o.err;
  }
}

}  // namespace
}  // namespace moraine
