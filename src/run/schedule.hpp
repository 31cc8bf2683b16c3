// When a stage stops to record, and with dt = "auto" the steps in between. Both follow from the case and the
// state alone, so neither threads nor a restart change them.
//
// With dt = "auto", dt <= safety times the critical step of the contact network (dem/spectrum.hpp), or of the
// first contact where that is shorter; made to fit a whole number of times until the next record. The network
// is looked at again every `steps_between_estimates`.
#pragma once
#include "run/stages.hpp"

namespace moraine::run {

// An estimate takes as long as some tens of steps.
constexpr std::int64_t steps_between_estimates = 1000;

struct Event {
  double time;        // s, of the scene's clock
  std::int64_t step;  // nearest to it, with the present dt; an exchange where there is pore water
  bool series, snapshot, end;
};
Event next_event(const Stage& stage, std::int64_t step);

std::int64_t last_step(const Stage& stage);  // of the stage, with the present dt

// The same or the first later step at which grains meet pore water: only there is the state whole.
std::int64_t at_exchange(const Stage& stage, std::int64_t step);

// Where it is decided whether grains are to be sorted in memory anew: at every multiple of `between`, or at
// the first exchange after. The next one is that of a later step, before at_exchange.
bool looks_at_order(const Stage& stage, std::int64_t step, std::int64_t between);
std::int64_t next_look_at_order(std::int64_t step, std::int64_t between);

double critical_step(const dem::Scene& scene, const dem::State& state);  // s

// Sets the step from here on: the longest up to `longest` that meets the next event.
void fit_step(Stage& stage, dem::State& state, double longest);

}  // namespace moraine::run
