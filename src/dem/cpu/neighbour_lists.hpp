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
#include "dem/control.hpp"
#include "dem/cpu/bed.hpp"
#include "dem/neighbours.hpp"

namespace moraine::dem::cpu {

// Candidates of all chunks, links between chunks and their slots. Near lists keep their springs, but have no
// places for them until they are drawn. Throws Error if a coordinate is not finite, or if there are too many
// pairs.
void find_candidates(const Host& space, Bed& bed, Neighbours<Host>& neighbours, const BodyMotion& bodies);

// Near pairs of one chunk; springs move along.
void draw_near_pairs(Bed& bed, Chunk& chunk);

// The same, if a pair that is only watched touches.
void renew_near_pairs(Bed& bed, Chunk& chunk);

}  // namespace moraine::dem::cpu
