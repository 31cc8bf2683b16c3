// Memory order: grains that are close in space are close in memory.
#pragma once
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

// Wraps positions into the box along periodic sides, sorts the grains by halving the bed again and again
// across its longest side (first at the ends of chunks, grain.hpp, so that these are blocks), and takes
// contacts along (their springs turn round where i and j change places). Ties go by id, so the result depends
// on the state alone.
void sort_spatially(const Scene& scene, State& state);

// Contacts by their grains, those with walls by wall and grain.
void sort_contacts(State& state);

}  // namespace moraine::dem
