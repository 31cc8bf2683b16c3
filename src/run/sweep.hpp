// Several cases at once in one process: each runs as `run` would, in a case directory of its own,
// CASE/sweep/NAME, and gives the same bits as alone.
//
// On the CPU as many cases run at once as there are threads, in the order given, one thread each; fewer cases
// than threads share them equally. On the GPU each has a host thread, and with it a stream of its own.
#pragma once
#include "run/run.hpp"

namespace moraine::run {

// `at_once`: cases that run at the same time; 0: as above. One case that fails stops no other; those that did
// are named in the Error at the end. Prints a line for each case and writes CASE/sweep/summary.csv.
void sweep_case(const Options& options, int at_once);

}  // namespace moraine::run
