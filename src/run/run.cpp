#include "run/run.hpp"

#include <atomic>
#include <csignal>
#include <iostream>

#include "run/record.hpp"
#include "run/runner.hpp"

namespace moraine::run {

namespace {

std::atomic<bool> stop_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free);  // so a signal handler may set it

}  // namespace

void catch_signals() {
  std::signal(SIGINT, [](int) { stop_requested = true; });
  std::signal(SIGTERM, [](int) { stop_requested = true; });
  std::signal(SIGUSR1, [](int) { stop_requested = true; });  // mpirun passes this one on
}
bool stopping() { return stop_requested; }

Result run_one(const Options& options, const cases::Case& c) {
  Runner runner(options, c);
  runner.finish();
  return {runner.rows(), runner.was_finished()};
}

void run_case(const Options& options) {
  catch_signals();
  const cases::Case c = cases::load(options.directory, options.overrides);
  const Result result = run_one(options, c);
  if (result.was_finished)
    std::cerr << (c.directory / "output/checkpoint.h5").string() << ": the case has finished already\n";
  std::cout << summary(c.stages, result.rows);
}

}  // namespace moraine::run
