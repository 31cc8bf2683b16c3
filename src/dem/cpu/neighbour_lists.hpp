// Two lists, the second drawn from the first: candidates within the neighbour margin (found by cells, every
// few thousand steps), and of these the near pairs, whose forces are computed. All other candidates are
// watched: each step looks whether one of them touches, which costs a tenth of computing its force, and then
// the chunk draws its near pairs anew. So near pairs need no margin for how far grains may move, only enough
// of one that they are not drawn at every step. When a list is renewed changes no bit: pairs that do not
// touch add exact zeros.
//
// When candidates run out: schedule.cpp, Worker::lists_last() sees it, the run ends, and pair_engine.cpp,
// advance() searches.
#pragma once
#include "dem/close_grains.hpp"
#include "dem/control.hpp"
#include "dem/cpu/bed.hpp"

namespace moraine::dem::cpu {

// Candidates within bed.margin and near pairs of all chunks, links between chunks and their slots; springs
// move along. Throws Error if a coordinate is not finite, or if there are too many pairs.
void find_candidates(const Host& space, Bed& bed, CloseGrains& grains, const BodyMotion& bodies);

// Draws near pairs of one chunk anew, if a pair that is only watched touches.
void renew_near_pairs(Bed& bed, Chunk& chunk);

}  // namespace moraine::dem::cpu
