// What all threads or blocks agree on. Each has a copy of its own, and all copies stay equal, because all
// work it out from the same sums at the same step.
#pragma once
#include "dem/fluid_coupling.hpp"

namespace moraine::dem {

struct Control {
  BodyMotion bodies;
  double moved = 0;      // m, bound on the approach of any two bodies since the last search
  double travelled = 0;  // m, the same since then, never measured; the CPU's near lists go by it
  bool stale = false;   // the lists have run out, or a grain is lost: grains are at this step, forces are not
  bool closed = true;   // the account of the present step is in bodies.ledger already
  WaterReaction water;  // of the last exchange

  // Bodies from step n to n + 1, once the forces on them at n are known.
  MORAINE_HD void close_and_advance(const Scene& scene, const Reaction& reaction) {
    if (!closed) bodies.close(scene, reaction, reaction_at(scene, water, bodies.step));
    bodies.advance(scene);
  }
};

}  // namespace moraine::dem
