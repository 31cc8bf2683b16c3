#include "dem/cpu/water_exchange.hpp"

namespace moraine::dem::cpu {

bool Exchange::remap(const Bed& bed, const BodyMotion& bodies, bool leader, Barrier& barrier) {
  if (leader) keep_failure(bodies.step, [&] { fluid_->remap(bed.grain.data(), bodies); });
  barrier.wait();
  return !has_failed(bodies.step);
}

void Exchange::arrive(const Bed& bed, const BodyMotion& bodies, int threads) {
  if (displaced_.fetch_add(1, std::memory_order_acq_rel) + 1 < threads) return;
  displaced_.store(0, std::memory_order_relaxed);
  keep_failure(bodies.step, [&] { reaction_ = fluid_->solve(bodies, bed.scene.time(bodies.step)); });
  solved_.store(bodies.step, std::memory_order_release);
}

void Exchange::alone(Bed& bed, const BodyMotion& bodies) {
  for (const Chunk& c : bed.chunks) displace(bed, c);
  reaction_ = fluid_->solve(bodies, bed.scene.time(bodies.step));
  for (const Chunk& c : bed.chunks) push(bed, c, bed.water.data());
}

}  // namespace moraine::dem::cpu
