// A team of threads that work in step, with a barrier cheap enough for several in each time step.
#pragma once
#include <omp.h>
#include <sched.h>

#include <atomic>

namespace moraine {

// Cores that this process may use.
inline int available_cores() { return omp_get_num_procs(); }

// Passes the time while a thread has nothing to do: spins briefly, then lets others run, for the machine may
// be shared.
class SpinWait {
 public:
  void once() {
    if (++turns_ < 1000) {
#if defined(__x86_64__)
      __builtin_ia32_pause();
#elif defined(__aarch64__)
      asm volatile("isb");  // waits about as long
#endif
    } else {
      sched_yield();
    }
  }
  int turns() const { return turns_; }  // some 20 to 40 ns each
  void start_anew() { turns_ = 0; }

 private:
  int turns_ = 0;
};

class Barrier {
 public:
  explicit Barrier(int members) : members_(members) {}

  void wait() {
    if (members_ == 1) return;
    const unsigned phase = phase_.load(std::memory_order_relaxed);
    if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == members_) {
      arrived_.store(0, std::memory_order_relaxed);
      phase_.store(phase + 1, std::memory_order_release);
      return;
    }
    for (SpinWait wait; phase_.load(std::memory_order_acquire) == phase;) wait.once();
  }

 private:
  const int members_;
  alignas(64) std::atomic<int> arrived_{0};
  alignas(64) std::atomic<unsigned> phase_{0};
};

// Runs body(thread) on `threads` threads at once.
template <class Body>
void run_team(int threads, Body&& body) {
  if (threads == 1) {
    body(0);
    return;
  }
#pragma omp parallel num_threads(threads)
  body(omp_get_thread_num());
}

}  // namespace moraine
