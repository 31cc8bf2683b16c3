// Something between the grains that they displace and that pushes them back: pore water (src/coupling). An
// engine meets it every Scene::exchange_interval steps m, at steps n that are multiples of it, once the
// grains are where step n finds them:
//
//   remap()    only if stale(); one thread alone
//   displace() for each chunk of grains (grain.hpp), by any thread: its way since it was last pushed. May be
//              called again, to the same end
//   solve()    once, after all of displace(); one thread
//   push()     for each chunk, after solve(): the force f on each of its grains, N
//
// Leapfrog then adds the impulse m f dt on this step and none on the m - 1 others (an impulse
// multiple-time-step scheme), so that what the grains gain is what the surroundings lose.
#pragma once
#include <cstdint>

#include "dem/body/motion.hpp"
#include "dem/grain.hpp"

namespace moraine::dem {

class Surroundings {
 public:
  virtual ~Surroundings() = default;

  virtual bool stale() const = 0;  // changes in solve() only
  virtual void remap(const GrainRow* grains, const BodyMotion& bodies) = 0;
  virtual void displace(Index chunk, const GrainRow* grains) = 0;
  // bodies: at step n, planes already there. t: s, since the stage began.
  virtual WaterReaction solve(const BodyMotion& bodies, double t) = 0;
  // force: by grain in memory order, though only rows of the chunk's grains need exist.
  virtual void push(Index chunk, const GrainRow* grains, WaterRow* force) = 0;
};

}  // namespace moraine::dem
