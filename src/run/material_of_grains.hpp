// Which grain a case begins with is of which material.
#pragma once
#include <functional>
#include <string>

#include "case/case.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::run {

// Fills in State::material: what the grains bring along, or else by the rules of [[material]]. at(i): how
// messages call grain i. Throws Error where a grain is of no material of the case, or of two. The second is
// for grains that another case has left, with the names of its materials ("quartz, clay"; empty: one without
// a name) and its last scene. Its numbers become those of this case, in the scene that the grains come from,
// too.
void take_materials(const cases::Case& c, dem::State& s, const std::function<std::string(dem::Index)>& at);
void take_materials(const cases::Case& c, dem::State& s, dem::Scene& before, const std::string& names,
                    const std::function<std::string(dem::Index)>& at);

}  // namespace moraine::run
