// Runs a case: its stages one after the other, with output, checkpoints and restart.
#pragma once
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "case/case.hpp"
#include "dem/engine.hpp"
#include "output/files.hpp"

namespace moraine::run {

// When grains are sorted in memory anew (dem/memory_order.hpp): at multiples of `steps` of the scene's clock,
// or at the first exchange after, if contacts across chunks are more than `lost` times as many as they would
// be then.
struct Ordering {
  std::int64_t steps = 16384;  // many, so that looking takes no time of theirs
  double lost = 1.25;
};

struct Options {
  std::filesystem::path directory;
  std::vector<cases::Override> overrides;
  dem::Backend backend = dem::Backend::automatic;
  int threads = 0;         // of each rank; 0: all
  Ranks* ranks = nullptr;  // that share the bed; this is rank 0. null: there are no others
  bool resume = false, force = false, quiet = false;
  Ordering ordering;                      // another gives other bits: for tests
  std::filesystem::path output;           // where results go; empty: directory/output
  std::vector<output::LoadEvent> events;  // of a run that begins: loads change at their steps
  bool drop_events = false;               // of a run that goes on: those after its checkpoint do not count
  std::function<bool()> stop;             // asked every now and then; true: a checkpoint, and Interrupted
  // Told every now and then: so many steps of so many of that stage are done.
  std::function<void(std::size_t stage, std::int64_t step, std::int64_t steps)> on_progress;
};

// Throws Error; the last good checkpoint stays. Prints the summary of each stage to standard output.
void run_case(const Options& options);

// The same for one case among several in a process: prints nothing but its progress, and leaves signals
// alone.
struct Result {
  std::vector<output::Row> rows;  // of the series
  bool was_finished;              // by an earlier run
};
Result run_one(const Options& options, const cases::Case& c);

// Throws Error where an earlier run has left results and neither resume nor force says what to do with them.
void expect_no_results(const Options& options);

// "KEY was A and is now B; ..." of the physics that is another than in an earlier run's resolved case; empty
// where a run may go on.
std::string changed_physics(const std::string& resolved_before, const cases::Case& now);

// Control-C and an order to end make all runs of this process write a checkpoint and stop.
void catch_signals();
bool stopping();

// Runs a case anew in CASE/replay, with the events of its checkpoint, as far as that has come. Throws Error
// where not all bits come out the same.
void replay_case(const Options& options);

// Prints what run_case would do.
void check_case(const Options& options, std::FILE* out = stdout);

// Runs so many steps of one stage (the first unless named), straight from the start of the case and without
// output, and prints one line of JSON.
void bench_case(const Options& options, const std::string& stage, std::int64_t steps);

}  // namespace moraine::run
