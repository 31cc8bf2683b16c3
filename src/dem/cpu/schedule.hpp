// Which thread does which task of which chunk, and when: steps one after the other on a team of threads.
//
// A chunk's pairs need no one. Once all earlier chunks that are linked to it are through with theirs, it is
// completed and its grains move on to the next step at once, while they are still in the cache: one pass over
// memory and one barrier a step. A layer that a stress drives needs all forces on it before it moves, and a
// second barrier.
//
// Each thread owns a stretch of neighbouring chunks, most of which it finds in its own cache from the last
// step, and begins with those that other threads wait for. It helps others only after it has waited for
// longer than it costs to bring a chunk into another core's cache. Where that does not do, because other
// programs want the cores, fewer threads take over (thread_count.hpp). Who does what changes no bit.
//
// Where several ranks share the bed, the first thread of each sends and receives between its chunks
// (traffic.hpp). Chunks whose pairs need ghosts wait for their rows, those that earlier ranks know for these
// ranks' shares, and all for the totals of the step.
#pragma once
#include <atomic>
#include <memory>
#include <vector>

#include "dem/control.hpp"
#include "dem/cpu/neighbour_lists.hpp"
#include "dem/cpu/tasks.hpp"
#include "dem/cpu/traffic.hpp"
#include "dem/cpu/water_exchange.hpp"

namespace moraine::dem::cpu {

class Schedule {
 public:
  enum class Pause { done, search, lost, failed };

  // Deals the chunks out to so many threads. traffic: null where there are no other ranks.
  Schedule(Bed& bed, Traffic* traffic, int threads);

  // Steps until all are done, or until new candidates are needed (then control.stale, and the forces of the
  // step that it has come to are still to be done). `steps` counts down.
  Pause run(const StepTasks& tasks, Exchange& exchange, Control& control, std::int64_t& steps);

  int threads() const { return threads_; }
  // How often the system took a thread off its core in the last run, for another program.
  std::int64_t interruptions() const { return interruptions_; }

  // Forces of all chunks where the grains are, into bed.load; dt as in ChunkStep. One thread, all ranks.
  void evaluate(const StepTasks& tasks, const BodyMotion& bodies, double dt);

 private:
  friend class Worker;
  // The last step at which a thread took a chunk on, and at which its pairs were done.
  struct alignas(64) Progress {
    std::atomic<std::int64_t> taken{-1}, done{-1};
    bool is_taken(std::int64_t step) const { return taken.load(std::memory_order_relaxed) == step; }
    bool take(std::int64_t step) { return !is_taken(step) && taken.exchange(step) != step; }
  };
  // Loads and pushes of a chunk while it is under way; a thread uses them again for its next chunk.
  class Buffers {
   public:
    Host::Array<WaterRow> push;  // empty where there is no water

    // Loads of a chunk, all zero when taken and when given back.
    LoadRow* take(Index rows);
    void give_back(LoadRow* buffer) { free_.push_back(buffer); }

   private:
    std::vector<Host::Array<LoadRow>> all_;
    std::vector<LoadRow*> free_;
  };

  Bed& bed_;
  Traffic* const traffic_;
  const int threads_;
  std::unique_ptr<Progress[]> progress_;  // by chunk
  std::vector<Buffers> buffers_;          // by thread
  std::atomic<std::int64_t> interruptions_{0};
  bool lost_ = false;  // a grain, on some rank
};

}  // namespace moraine::dem::cpu
