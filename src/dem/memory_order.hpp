// Memory order: grains that are close in space are close in memory.
#pragma once
#include <vector>

#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

// Wraps positions into the box along periodic sides, sorts the grains by halving the bed again and again
// across its longest side (first at the ends of chunks, grain.hpp, so that these are blocks), and takes
// contacts along (their springs turn round where i and j change places). Ties go by id, so the result depends
// on the state alone.
void sort_spatially(const Scene& scene, State& state);

// Grains that shear past one another stay where they are in memory, and chunks spread through each other.
// Sorts them anew, also while a stage is under way, where contacts between grains of different chunks
// (sums.hpp) are more than `lost` times as many as after sorting; true if it did. Follows from the state
// alone. Positions stay as they are. also: other rows of the same grains, to be sorted with them.
bool renew_order(const Scene& scene, State& state, double lost, std::vector<Vec3d>* also = nullptr);

// Contacts by their grains, those with walls by wall and grain.
void sort_contacts(State& state);

}  // namespace moraine::dem
