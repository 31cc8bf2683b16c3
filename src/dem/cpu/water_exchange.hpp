// How the threads of the CPU's engine meet the pore water (fluid_coupling.hpp). The thread that is last to
// say where its grains went solves for the pressure, while others go on to their pairs.
//
// Where several ranks share the bed, the water is that of rank 0: at an exchange it is sent the places and
// velocities of all grains, and sends back the forces. Other threads go on to their pairs in the meantime.
//
// An exception that left a team of threads would end the program without a word: what the fluid throws is
// kept until all threads have met at a barrier. A step number goes with it, for one thread may fail at the
// next step before another has looked whether this one went well.
#pragma once
#include <atomic>
#include <exception>

#include "backend/team.hpp"
#include "dem/control.hpp"
#include "dem/cpu/bed.hpp"

namespace moraine::dem::cpu {

class Exchange {
 public:
  // fluid: null where the bed is dry, and on all ranks but the first. whole: grains of all ranks, on rank 0
  // where there are several and water.
  Exchange(FluidCoupling* fluid, const WaterReaction& last, std::vector<GrainRow> whole = {})
      : fluid_(fluid), reaction_(last), whole_(std::move(whole)) {}

  const WaterReaction& reaction() const { return reaction_; }  // of the last exchange
  bool stale() const { return fluid_->stale(); }

  // New weights, where the old ones have run out; all threads come here. False: it failed.
  bool remap(const Bed& bed, const BodyMotion& bodies, bool leader, Barrier& barrier);
  void displace(const Bed& bed, const Chunk& chunk) { fluid_->displace(chunk.number, bed.grain.data()); }
  // Once a thread has displaced all its chunks.
  void arrive(const Bed& bed, const BodyMotion& bodies, int threads);
  bool is_solved(std::int64_t step) const { return solved_.load(std::memory_order_acquire) == step; }
  // push: by grain, though only rows of the chunk's grains need exist.
  void push(const Bed& bed, const Chunk& chunk, WaterRow* push) {
    fluid_->push(chunk.number, bed.grain.data(), push);
  }
  // All of it by one thread, with the grains at rest in between: what the pressures of the start do. Throws
  // what the fluid throws.
  void alone(Bed& bed, const BodyMotion& bodies);
  // The same for all ranks together, each with one thread; forces into bed.water.
  void meet(Bed& bed, const BodyMotion& bodies);

  bool has_failed(std::int64_t step) const { return failed_ <= step; }
  bool has_failed() const { return failed_ != never; }
  [[noreturn]] void rethrow() const { std::rethrow_exception(failure_); }

 private:
  template <class Act>
  void keep_failure(std::int64_t step, Act&& act) {
    try {
      act();
    } catch (...) {
      failure_ = std::current_exception();
      failed_ = step;
    }
  }

  static constexpr std::int64_t never = INT64_MAX;
  void solve_for_all(const Bed& bed, const BodyMotion& bodies);

  FluidCoupling* fluid_;
  WaterReaction reaction_;
  std::vector<GrainRow> whole_;
  std::vector<WaterRow> push_;  // on them
  std::exception_ptr failure_;
  std::atomic<std::int64_t> failed_{never};
  std::atomic<int> displaced_{0};         // threads that have, at the present exchange
  std::atomic<std::int64_t> solved_{-1};  // the last exchange whose pressures are known
};

}  // namespace moraine::dem::cpu
