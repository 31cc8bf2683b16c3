// What memory a run needs, from what was measured: a case too large for the machine is refused before its
// grains are drawn.
//
//   grain   2200 bytes: a sheared bed of 1e5 grains peaked at 1.9 kB a grain while it wrote its files (loose
//           grains 1.3 kB; the rest are contacts), and 0.9 kB more where pore water moved them
//   cell    of the pore water's grid, coupling::bytes_a_cell
#pragma once
#include "case/case.hpp"
#include "ranks/ranks.hpp"

namespace moraine::run {

double bytes_needed(double grains, bool wet, double cells = 0);

// Throws Error with what is needed, what is there, and how many grains would fit; of a case that draws its
// grains itself. `at_once` such cases run at the same time. ranks: that share the bed, of which the first
// holds all grains while it makes a stage ready and writes; null: there are no others.
void expect_room(const cases::Case& c, int at_once = 1, const Ranks* ranks = nullptr);

}  // namespace moraine::run
