// A run that is cut off anywhere and resumed ends with the bits of the run that was not.
#include <chrono>
#include <random>
#include <thread>

#include "backends.hpp"
#include "case/case.hpp"
#include "dem/engine.hpp"
#include "program.hpp"
#include "run/stages.hpp"

namespace moraine {
namespace {

using namespace std::chrono_literals;
using Seconds = std::chrono::duration<double>;
using Clock = std::chrono::steady_clock;

class Restart : public Program {
 protected:
  void SetUp() override {
    const auto began = Clock::now();
    whole = make("whole", text);
    ASSERT_NO_FATAL_FAILURE(run(whole));
    length = Clock::now() - began;
    cut = make("cut", text);
  }

  // Each kill hits a run that has resumed from where the one before had got to.
  void survive_ten_kills(double longest) {
    std::mt19937 random(2013);
    std::uniform_real_distribution<double> share(0.02, longest);
    int hits = 0;
    for (int k = 0; k < 10; ++k) hits += run_for(share(random) * length, SIGKILL);
    EXPECT_GE(hits, 3);
    finish_and_compare();
  }

  // Starts or resumes, and sends the signal after so long. False if the run was over before.
  bool run_for(Seconds time, int signal) {
    auto words = to_run(cut);
    if (fs::exists(cut / "output")) words.push_back("--resume");
    const auto process = start(words);
    std::this_thread::sleep_for(time);
    const bool hit = process->running();
    process->send(signal);
    const int status = process->wait();
    if (hit && signal == SIGKILL) {
      EXPECT_TRUE(status == -SIGKILL || status == 0) << status;
    }
    if (!hit) {
      EXPECT_EQ(status, 0) << contents(directory.path() / "err");
    }
    return hit;
  }

  void finish_and_compare() {
    ASSERT_NO_FATAL_FAILURE(run(cut, {}, {"--resume"}));
    expect_same_results(whole, cut);
    for (const auto& entry : fs::recursive_directory_iterator(cut / "output"))
      EXPECT_NE(entry.path().extension(), ".tmp") << entry.path();
  }

  std::string text = small_case();
  fs::path whole, cut;
  Seconds length{};
};
class GradedRestart : public Restart {
 protected:
  GradedRestart() { text = graded_case(); }
};

class LoadedRestart : public Restart {  // by loads that change
 protected:
  LoadedRestart() {
    text +=
        "\n[[stage]]\nname = \"pulses\"\nkind = \"shear\"\nduration = 0.3\nprofile = \"linear\"\n"
        "normal_stress = { times = [0, 0.07, 0.2, 0.4], values = [2000, 1000, 3000, 2000] }\n"
        "velocity = { times = [0, 0.1, 0.2, 0.4], values = [0.1, -0.1, 0.3, 0], interpolation = \"steps\" }\n"
        "velocity_amplitude = 0.02\nvelocity_frequency = 30\n";
  }
};

TEST_F(LoadedRestart, TenKillsAtRandomMoments) { survive_ten_kills(0.25); }
TEST_F(Restart, TenKillsAtRandomMoments) { survive_ten_kills(0.25); }
TEST_F(GradedRestart, TenKillsAtRandomMoments) { survive_ten_kills(0.25); }

// One kill in each of ten runs, anywhere from start to end.
TEST_F(Restart, OneKillAnywhere) {
  std::mt19937 random(23);
  std::uniform_real_distribution<double> share(0, 1);
  for (int k = 0; k < 10; ++k) {
    fs::remove_all(cut / "output");
    const Seconds time = share(random) * length;
    run_for(time, SIGKILL);
    SCOPED_TRACE("killed after " + std::to_string(time.count()) + " of " + std::to_string(length.count()) +
                 " s");
    finish_and_compare();
  }
}

// Before the first checkpoint, and while the first files are made.
TEST_F(Restart, KillsInTheFirstMilliseconds) {
  for (int ms = 0; ms < 16; ms += 2) {
    fs::remove_all(cut / "output");
    run_for(ms * 1ms, SIGKILL);
    SCOPED_TRACE("killed after " + std::to_string(ms) + " ms");
    finish_and_compare();
  }
}

// The collisions of the settling grains, each step taken by an engine that goes on and by one that takes
// over: lists that are rebuilt at other steps must not show.
TEST_F(Program, AnyStepMayBeTheFirstAfterARestart) {
  for (const std::string& text : {small_case(), graded_case()}) {
    const fs::path small = make("small", text);
    const cases::Case c = cases::load(small);
    const run::Start start = run::start_of(c);
    for (const dem::Backend backend : both_engines()) {
      output::Checkpoint now = start.before;
      const run::Stage stage = run::prepare(c, 0, start, now);
      const auto engine = dem::make_engine(backend, 1), other = dem::make_engine(backend, 1);
      engine->load(stage.scene, now.state);
      engine->advance(2000);
      for (int k = 2000; k < 2500; ++k) {
        other->load(stage.scene, engine->state());
        engine->advance(1), other->advance(1);
        const dem::State a = engine->state(), b = other->state();
        ASSERT_TRUE(a.x == b.x && a.v == b.v && a.omega == b.omega && a.force == b.force &&
                    a.torque == b.torque)
            << k;
        ASSERT_EQ(a.ledger.slip, b.ledger.slip) << "step " << k;
        ASSERT_EQ(a.ledger.viscous, b.ledger.viscous) << "step " << k;
      }
    }
  }
}

// Control-C and an order to end are no accidents: a checkpoint is written.
TEST_F(Restart, InterruptedInOrder) {
  for (const int signal : {SIGINT, SIGTERM}) {
    fs::remove_all(cut / "output");
    if (run_for(0.3 * length, signal)) {
      const std::string message = contents(directory.path() / "err");
      EXPECT_NE(message.find("interrupted at step"), std::string::npos) << message;
      EXPECT_NE(message.find("--resume"), std::string::npos) << message;
      // Lists for ParaView wait for their turn while the run goes on, but not now.
      const std::string last = snapshots_of(cut).back().filename().string();
      EXPECT_NE(contents(cut / "output/snapshots/grains.xdmf").find(last), std::string::npos) << last;
    }
    finish_and_compare();
  }
}

// A disk that gives back other bytes than it was given costs the time since the checkpoint before.
TEST_F(Restart, FromTheCheckpointBeforeADamagedOne) {
  const fs::path newest = checkpoint_of(cut), before = cut / "output/checkpoint.previous.h5";
  const auto resume = [&] {
    auto words = to_run(cut);
    words.push_back("--resume");
    return moraine(words);
  };
  const auto flip = [](const fs::path& file) {
    std::string bytes = contents(file);
    bytes[bytes.size() / 2] ^= 16;
    std::ofstream(file, std::ios::binary) << bytes;
  };
  for (const bool finished : {false, true}) {
    fs::remove_all(cut / "output");
    run_for((finished ? 100 : 0.5) * length, SIGTERM);
    ASSERT_TRUE(fs::exists(before));
    for (const bool gone : {false, true}) {
      if (gone)
        fs::remove(newest);
      else
        flip(newest);
      const Outcome o = resume();
      EXPECT_EQ(o.status, 0) << o.err;
      for (const std::string& text : {o.err, contents(cut / "output/log.txt")}) {
        EXPECT_NE(text.find("going on from the checkpoint before it"), std::string::npos) << text;
        EXPECT_NE(text.find(newest.string() + (gone ? ": cannot open" : ": damaged")), std::string::npos)
            << text;
      }
      expect_same_results(whole, cut);
    }
  }
  flip(newest), flip(before);
  auto words = to_run(cut);
  words.push_back("--resume");
  expect_error(words, {newest.string() + ": damaged", before.string() + ": damaged", "--force"});
  fs::remove(before);
  expect_error(words, {newest.string() + ": damaged", "no checkpoint before it", "--force"});
  ASSERT_NO_FATAL_FAILURE(run(cut, {}, {"--force"}));
}

// What has been restored is not pushed out by the next checkpoint.
TEST_F(Restart, TheGoodCheckpointTakesThePlaceOfTheDamagedOne) {
  run_for(0.5 * length, SIGTERM);
  const fs::path newest = checkpoint_of(cut), before = cut / "output/checkpoint.previous.h5";
  const std::string good = contents(before);
  ASSERT_FALSE(good.empty());
  std::ofstream(newest, std::ios::binary) << "rotten";
  run_for(0s, SIGKILL);
  bool kept = false;
  for (const fs::path& file : {newest, before}) kept = kept || contents(file).starts_with("moraine sha256");
  EXPECT_TRUE(kept);
  finish_and_compare();
}

TEST_F(Restart, OnAnotherNumberOfThreads) {
  run_for(0.5 * length, SIGKILL);
  ASSERT_NO_FATAL_FAILURE(run(cut, {}, {"--resume", "--threads", "2"}));
  expect_same_results(whole, cut);
}

TEST_F(Restart, AFinishedCaseIsLeftAlone) {
  const std::string before = contents(checkpoint_of(whole));
  const Outcome again = moraine(to_run(whole));
  EXPECT_EQ(again.status, 1);
  for (const char* word : {"whole/output", "--resume", "--force"})
    EXPECT_NE(again.err.find(word), std::string::npos) << again.err;

  auto words = to_run(whole);
  words.push_back("--resume");
  const Outcome resumed = moraine(words);
  EXPECT_EQ(resumed.status, 0) << resumed.err;
  EXPECT_NE(resumed.err.find("finished already"), std::string::npos) << resumed.err;
  EXPECT_NE(resumed.out.find("friction"), std::string::npos) << resumed.out;
  EXPECT_TRUE(contents(checkpoint_of(whole)) == before);

  ASSERT_NO_FATAL_FAILURE(run(cut));
  ASSERT_NO_FATAL_FAILURE(run(whole, {}, {"--force"}));
  expect_same_results(whole, cut);
}

TEST_F(Restart, RefusesAChangedCase) {
  run_for(0.5 * length, SIGKILL);
  auto words = to_run(cut, {"stage.shear.normal_stress=3 kPa", "output.series_interval=0.02"});
  words.push_back("--resume");
  const Outcome o = moraine(words);
  EXPECT_EQ(o.status, 1);
  for (const char* word : {"output/checkpoint.", "another version of this case",
                           "stage.shear.normal_stress was 2000.0 Pa and is now 3000.0 Pa", "--force"})
    EXPECT_NE(o.err.find(word), std::string::npos) << o.err;
  EXPECT_EQ(o.err.find("series_interval"), std::string::npos) << o.err;
  finish_and_compare();
}

TEST_F(Restart, RefusesOtherStages) {
  run_for(0.5 * length, SIGKILL);
  expect_error(
      {"run", cut.string(), "--quiet", "--backend", "cpu", "--resume", "--set", "stages=[\"settle\"]"},
      {"stages was settle, consolidate, shear and is now settle;"});
  finish_and_compare();
}

// What is no physics may change on the way: the bits are those of the run that was not cut.
TEST_F(Restart, GoesOnWithOtherGuardsMarginAndTitle) {
  run_for(0.5 * length, SIGTERM);
  ASSERT_NO_FATAL_FAILURE(
      run(cut,
          {"guards.interval=77", "guards.max_overlap=0.19", "guards.max_residue=0.2",
           "model.neighbour_margin=5 mm", "title=another", "output.checkpoint_interval=1"},
          {"--resume"}));
  expect_same_results(whole, cut);
  const std::string log = contents(cut / "output/log.txt");
  EXPECT_NE(log.find("changed: guards.interval was 20000 and is now 77"), std::string::npos) << log;
  EXPECT_NE(log.find("changed: model.neighbour_margin was 0.0 m and is now 0.005 m"), std::string::npos)
      << log;
  EXPECT_NE(output::read_checkpoint(checkpoint_of(cut)).case_text.find("title = \"another\""),
            std::string::npos);
  EXPECT_NE(contents(cut / "output/case.toml").find("interval = 77"), std::string::npos);
}

// Records at other times from there on, of the same motion; no snapshot takes the place of an earlier one.
TEST_F(Restart, GoesOnWithOtherIntervals) {
  if (!run_for(0.6 * length, SIGTERM)) GTEST_SKIP() << "the run was over too soon";
  const auto before = output::read_checkpoint(checkpoint_of(cut));
  std::vector<std::string> bytes;
  for (const auto& s : before.snapshots) bytes.push_back(contents(cut / "output/snapshots" / s.file));
  ASSERT_NO_FATAL_FAILURE(
      run(cut, {"output.series_interval=0.02", "output.snapshot_interval=0.03"}, {"--resume"}));
  const auto rows = output::read_series(series_of(cut)), all = output::read_series(series_of(whole));
  ASSERT_GT(rows.size(), before.rows.size());
  ASSERT_LT(rows.size(), all.size());
  for (const output::Row& row : rows)
    EXPECT_TRUE(std::any_of(all.begin(), all.end(), [&](const auto& r) { return same_bits(r, row); }))
        << row.time;
  const auto after = output::read_checkpoint(checkpoint_of(cut));
  ASSERT_GT(after.snapshots.size(), before.snapshots.size());
  EXPECT_EQ(snapshots_of(cut).size(), after.snapshots.size());
  for (std::size_t k = 0; k < bytes.size(); ++k)
    EXPECT_TRUE(contents(cut / "output/snapshots" / after.snapshots[k].file) == bytes[k]) << k;
}

// There the steps fit the times of records.
TEST_F(Restart, WithAutomaticStepsTheIntervalOfRecordsIsPhysics) {
  const fs::path own = make("auto", small_case());
  const std::vector<std::string> sets{"model.dt=auto", "stage.settle.duration=0.05", "stages=[\"settle\"]"};
  run(own, sets);
  const auto with = [&](const std::string& set) {
    auto changed = sets;
    changed.push_back(set);
    auto words = to_run(own, changed);
    words.push_back("--resume");
    return words;
  };
  expect_error(with("output.series_interval=0.02"), {"output.series_interval was 0.01 s and is now 0.02 s"});
  expect_error(with("output.snapshot_interval=0.02"),
               {"output.snapshot_interval was 0.1 s and is now 0.02 s"});
  EXPECT_EQ(moraine(with("guards.interval=10")).status, 0);
}

TEST_F(Restart, RefusesToStartFromAnUnfinishedCase) {
  if (!run_for(0.3 * length, SIGTERM)) GTEST_SKIP() << "the run was over too soon";
  const fs::path next = make("next", "start = \"../cut\"\nstages = [\"shear\"]\n" + small_case());
  const Outcome o = moraine(to_run(next));
  EXPECT_EQ(o.status, 1);
  for (const char* word : {"cut/output/checkpoint.h5", "not finished"})
    EXPECT_NE(o.err.find(word), std::string::npos) << o.err;
}

}  // namespace
}  // namespace moraine
