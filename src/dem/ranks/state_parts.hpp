// A state in parts, as ranks have them.
#pragma once
#include "dem/cpu/bed.hpp"
#include "ranks/ranks.hpp"

namespace moraine::dem {

// The first chunk of each rank, and one after the last: about as much work for each, by contacts and grains.
std::vector<Index> deal_chunks(const State& state, int ranks);

// A rank's grains [first, end) with the contacts that are theirs, numbers from the first on, and behind the
// materials of those grains the ones of ghosts (Bed::load_state).
void put_part(Parcel& parcel, const State& state, Index first, Index end);
void get_part(Parcel& parcel, State& part);

// The same of a rank's own part, and added to a state of all grains before.
void put_all(Parcel& parcel, const State& part);
void add_part(Parcel& parcel, State& whole, Index first);

}  // namespace moraine::dem
