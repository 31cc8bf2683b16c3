#include "run/needs.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "coupling/pore_water.hpp"
#include "memory.hpp"

namespace moraine::run {

namespace {

constexpr double program = 20e6;
// Of the bed, on rank 0's host. What ranks hold was measured on two of a million grains (docs/decisions.md).
double bytes_a_grain(bool wet, const Ranks* ranks = nullptr) {
  const double alone = wet ? 3100 : 2200, of_its_own = 2350;
  return ranks ? alone + of_its_own * (ranks->on_this_host() - 1) / ranks->size() : alone;
}

}  // namespace

double bytes_needed(double grains, bool wet, double cells) {
  return program + grains * bytes_a_grain(wet) + cells * coupling::bytes_a_cell;
}

void expect_room(const cases::Case& c, int at_once, const Ranks* ranks) {
  if (!c.start.empty()) return;
  const double each = bytes_a_grain(c.has_water(), ranks);
  const double need = program + static_cast<double>(c.grains.count) * each;
  const double there = memory_there().bytes;
  const double fit = (there / at_once - program) / each;
  const double digits = std::pow(10, std::floor(std::log10(std::max(fit, 10.0))) - 1);
  char most[64];
  std::snprintf(most, sizeof most, "; expected at most %.0f grains", std::floor(fit / digits) * digits);
  std::string hint = fit < 1 ? "" : most;
  if (const int few = static_cast<int>(std::min(there / need, 1e6)); at_once > 1 && few > 0)
    hint += std::string(fit < 1 ? "; expected" : ", or") + " --at-once " + std::to_string(few);
  expect_memory(at_once * need,
                (at_once > 1 ? std::to_string(at_once) + " cases at once of " : "") +
                    "grains.count = " + std::to_string(c.grains.count) + " grains",
                hint);
}

}  // namespace moraine::run
