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
// multiple-time-step scheme), so that what the grains gain is what the fluid loses.
#pragma once
#include <cstdint>

#include "dem/body/motion.hpp"
#include "dem/grain.hpp"

namespace moraine::dem {

// Whether grains and pore water meet at this step.
MORAINE_HD bool exchanges(const Scene& scene, std::int64_t step) {
  return scene.exchange_interval > 0 && step % scene.exchange_interval == 0;
}
// What the water of the last exchange does to bodies at this step.
MORAINE_HD WaterReaction reaction_at(const Scene& scene, const WaterReaction& last_exchange,
                                     std::int64_t step) {
  if (exchanges(scene, step) || scene.exchange_interval == 0) return last_exchange;
  return {last_exchange.wall_between, 0, 0, last_exchange.wall_between};
}
// A load with the impulse of the water that this step adds to it, if any.
MORAINE_HD LoadRow with_water(const Scene& scene, std::int64_t step, LoadRow load, const Vec3d& water) {
  if (exchanges(scene, step)) load.f = axpy(static_cast<double>(scene.exchange_interval), water, load.f);
  return load;
}

class FluidCoupling {
 public:
  virtual ~FluidCoupling() = default;

  virtual bool stale() const = 0;  // changes in solve() only
  virtual void remap(const GrainRow* grains, const BodyMotion& bodies) = 0;
  virtual void displace(Index chunk, const GrainRow* grains) = 0;
  // bodies: at step n, planes already there. t: s, since the stage began.
  virtual WaterReaction solve(const BodyMotion& bodies, double t) = 0;
  // force: by grain in memory order, though only rows of the chunk's grains need exist.
  virtual void push(Index chunk, const GrainRow* grains, WaterRow* force) = 0;
};

}  // namespace moraine::dem
