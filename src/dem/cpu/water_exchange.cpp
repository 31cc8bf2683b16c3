#include "dem/cpu/water_exchange.hpp"

#include <algorithm>

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
  if (bed.part.ranks) {
    meet(bed, bodies);
    if (failure_) rethrow();
    return;
  }
  for (const Chunk& c : bed.chunks) displace(bed, c);
  reaction_ = fluid_->solve(bodies, bed.scene.time(bodies.step));
  for (const Chunk& c : bed.chunks) push(bed, c, bed.water.data());
}

// Of rank 0, for the grains of all.
void Exchange::solve_for_all(const Bed& bed, const BodyMotion& bodies) {
  const Index chunks = bed.part.first_chunks.back();
  push_.resize(whole_.size());
  if (fluid_->stale()) fluid_->remap(whole_.data(), bodies);
  for (Index c = 0; c < chunks; ++c) fluid_->displace(c, whole_.data());
  reaction_ = fluid_->solve(bodies, bed.scene.time(bodies.step));
  for (Index c = 0; c < chunks; ++c) fluid_->push(c, whole_.data(), push_.data());
}

void Exchange::meet(Bed& bed, const BodyMotion& bodies) {
  struct Place {
    Vec3d x, v;
  };
  struct Answer {
    WaterReaction reaction;
    bool failed = false;
  } answer;
  Ranks& ranks = *bed.part.ranks;
  const auto first = [&](int rank) {
    return std::min(bed.part.all, bed.order.begin_of(bed.part.first_chunks[rank]));
  };
  std::vector<Ranks::Message> messages;
  std::vector<Place> places(ranks.rank() == 0 ? bed.part.all : bed.n);
  if (ranks.rank() > 0) {
    for (Index i = 0; i < bed.n; ++i) places[i] = {bed.grain.data()[i].x, bed.grain.data()[i].v};
    messages.push_back(ranks.send(0, Tag::displacements, places.data(), places.size() * sizeof(Place)));
    messages.push_back(ranks.receive(0, Tag::pushes, bed.water.data(), bed.n * sizeof(WaterRow)));
  } else {
    for (int r = 1; r < ranks.size(); ++r)
      messages.push_back(ranks.receive(r, Tag::displacements, places.data() + first(r),
                                       (first(r + 1) - first(r)) * sizeof(Place)));
    for (Index i = 0; i < bed.n; ++i)
      whole_[i].x = bed.grain.data()[i].x, whole_[i].v = bed.grain.data()[i].v;
    for (Ranks::Message& m : messages) ranks.wait(m);
    messages.clear();
    for (Index i = bed.n; i < bed.part.all; ++i) whole_[i].x = places[i].x, whole_[i].v = places[i].v;
    keep_failure(bodies.step, [&] { solve_for_all(bed, bodies); });
    push_.resize(whole_.size());
    std::copy(push_.begin(), push_.begin() + bed.n, bed.water.data());
    for (int r = 1; r < ranks.size(); ++r)
      messages.push_back(
          ranks.send(r, Tag::pushes, push_.data() + first(r), (first(r + 1) - first(r)) * sizeof(WaterRow)));
    answer = {reaction_, has_failed()};
  }
  for (Ranks::Message& m : messages) ranks.wait(m);
  ranks.broadcast(&answer, sizeof answer);
  reaction_ = answer.reaction;
  if (answer.failed && !failure_)
    keep_failure(bodies.step, [] { throw error("the pore water failed on rank 0"); });
  solved_.store(bodies.step, std::memory_order_release);
}

}  // namespace moraine::dem::cpu
