// A bed that several ranks share: each has a stretch of its chunks in a PairEngine of its own
// (cpu/pair_engine.hpp). Rank 0 runs the program; its engine is this one, which tells the others what to do
// and has their parts of a state sent. The others serve. Bits are those of one rank.
//
// Which chunks a rank has follows from contacts and grains counted, never from the clock: as a state is
// loaded, and anew when what the ranks have to do has drifted apart by more than a tenth.
#pragma once
#include <memory>

#include "dem/engine.hpp"
#include "ranks/ranks.hpp"

namespace moraine::dem {

// Of rank 0. threads: of each rank; 0: as many as its share of the host's cores. Loading throws Error where
// there are fewer chunks than ranks.
std::unique_ptr<Engine> make_ranked_engine(Ranks& ranks, int threads);

// Of all other ranks: does what rank 0 says until it says that it is over.
void serve(Ranks& ranks);
// Of rank 0, when it is over.
void dismiss(Ranks& ranks);

}  // namespace moraine::dem
