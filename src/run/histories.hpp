// Loads that change: what drives the bodies of a stage, piece by piece of the histories that it follows
// (history.hpp). A piece counts from the first step at or after its time. Pore water looks into its histories
// itself (fluid::Side).
#pragma once
#include "case/case.hpp"
#include "dem/engine.hpp"

namespace moraine::run {

Histories histories_of(const cases::Stage& stage);
bool cover(const Histories& histories, double end);  // to this time, s

// The pieces of this step, into the scene.
void set_pieces(dem::Scene& scene, const Histories& histories, std::int64_t step);
// The next step that needs others; none: a very large number.
std::int64_t next_pieces(const dem::Scene& scene, const Histories& histories, std::int64_t step);

// The engine from one step to another. Where there are new pieces it is told before anybody looks at the step
// that it has come to, so that it does not matter where one stops.
void advance(dem::Engine& engine, dem::Scene& scene, const Histories& histories, std::int64_t step,
             std::int64_t until);

}  // namespace moraine::run
