// Runs a case: its stages one after the other, with output, checkpoints and restart.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "case/case.hpp"
#include "dem/engine.hpp"

namespace moraine::run {

struct Options {
  std::filesystem::path directory;
  std::vector<cases::Override> overrides;
  dem::Backend backend = dem::Backend::automatic;
  int threads = 0;  // 0: all
  bool resume = false, force = false, quiet = false;
};

// Throws Error; the last good checkpoint stays. Prints the summary of each stage to standard output.
void run_case(const Options& options);

// Prints what run_case would do.
void check_case(const Options& options);

// Runs so many steps of one stage (the first unless named), straight from the start of the case and without
// output, and prints one line of JSON.
void bench_case(const Options& options, const std::string& stage, std::int64_t steps);

}  // namespace moraine::run
