// Three lists. Candidates are within the neighbour margin, found by cells every few thousand steps. Of these
// the near pairs are drawn every few dozen steps; their forces are computed. The ones that are further apart
// are watched: their distances are looked at as often as they might touch, which costs a tenth of computing
// their forces, and when one does the chunk draws anew. So near pairs are those that touch or soon will,
// however fast some grain flies elsewhere. Candidates so far apart that nothing is fast enough to bring them
// together before the next draw are not even watched. When a list is renewed changes no bit: pairs that do
// not touch add exact zeros.
//
// When candidates run out: schedule.cpp, Worker::lists_last() sees it, the run ends, and pair_engine.cpp,
// advance() searches.
#pragma once
#include "dem/close_grains.hpp"
#include "dem/control.hpp"
#include "dem/cpu/bed.hpp"
#include "dem/cpu/traffic.hpp"

namespace moraine::dem::cpu {

// Bounds on how far any two bodies have come closer since the search, and do so in a step, m.
struct Closing {
  double so_far, in_step;
};

// Candidates within bed.margin and near pairs of all chunks, links between chunks and their slots; springs
// move along. Returns how long drawing the near pairs took, s. Throws Error if a coordinate is not finite, or
// if there are too many pairs. On all ranks together; traffic: null where there are no others.
double find_candidates(const Host& space, Bed& bed, CloseGrains& grains, const Control& control,
                       Traffic* traffic);

// Draws near pairs of one chunk anew, if it is time.
void renew_near_pairs(Bed& bed, Chunk& chunk, const Closing& closing);

}  // namespace moraine::dem::cpu
