// Three lists, each drawn from the one before: candidates within the neighbour margin (found by cells, every
// few thousand steps), near pairs within a much smaller margin (every few dozen), and of these the
// overlapping ones carry force. When a list is renewed changes no bit: pairs that do not touch add exact
// zeros.
//
// When they run out: schedule.cpp, Worker::lists_last() sees it. Near pairs are then renewed along with the
// forces; for new candidates the run ends, and pair_engine.cpp, advance() searches.
#pragma once
#include "dem/control.hpp"
#include "dem/cpu/bed.hpp"
#include "dem/neighbours.hpp"

namespace moraine::dem::cpu {

// How long the near lists last.
struct NearMargin {
  double margin = 0;  // m
  double moved = 0;   // m, bound on the approach of any two bodies since they were made
};

// Long enough to last for some dozens of steps, never beyond what the candidates cover. speed: m/s, a bound
// on that of anything; moved: m, since the search.
NearMargin near_margin(const Bed& bed, double speed, double moved);

// Candidates of all chunks, links between chunks and their slots. Near lists keep their springs, but have no
// places for them until they are renewed. Throws Error if a coordinate is not finite, or if there are too
// many pairs.
void find_candidates(const Host& space, Bed& bed, Neighbours<Host>& neighbours);

// Near pairs of one chunk, between grains and with planes; springs move along.
void renew_near_pairs(Bed& bed, Chunk& chunk, const BodyMotion& bodies, double near_margin);

}  // namespace moraine::dem::cpu
