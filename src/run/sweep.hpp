// Several cases at once in one process: each runs as `run` would, in a case directory of its own,
// CASE/sweep/NAME, and gives the same bits as alone.
//
// On the CPU as many cases run at once as there are threads, in the order given, one thread each; fewer cases
// than threads share them equally. On the GPU each has a host thread, and with it a stream of its own.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "run/run.hpp"

namespace moraine::run {

struct SweptCase {
  std::string name;
  std::filesystem::path directory;
  std::vector<std::string> values;  // one for each key that is swept, as given
  std::string state;                // "finished", "stopped" or "not begun"
  std::string message;              // why it stopped
};

// Who hears of a sweep while it goes on, from the thread that called, several times a second.
struct SweepListener {
  std::function<void(const std::string& line)> say;                // news
  std::function<void(double done, const std::string& line)> show;  // how far it is, of 1
  std::function<bool()> stop;  // true: each case writes a checkpoint and stops
};

// `at_once`: cases that run at the same time; 0: as above. One case that fails stops no other; those that did
// are named in the Error at the end. Prints a line for each case and writes CASE/sweep/summary.csv.
void sweep_case(const Options& options, int at_once);

// The same, but tells the listener in place of the terminal, throws only what lets no case begin, and leaves
// signals alone.
std::vector<SweptCase> sweep(const Options& options, int at_once, const SweepListener& listener);

}  // namespace moraine::run
