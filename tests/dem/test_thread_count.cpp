// Threads follow what a busy machine leaves; a quiet one keeps all of them at work.
#include "dem/cpu/thread_count.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace moraine::dem::cpu {
namespace {

// A machine on which a step takes so long with one thread, two, ..., s, and threads are interrupted so often
// in a second.
struct Machine {
  std::vector<double> s_per_step;
  double interruptions_per_s;

  // Runs for that long, s; how many seconds each number of threads had.
  std::vector<double> run(ThreadCount& count, double seconds) const {
    std::vector<double> had(s_per_step.size() + 1, 0);
    for (double t = 0; t < seconds;) {
      const int threads = count.now();
      const std::int64_t steps = count.steps_together();
      const double took = static_cast<double>(steps) * s_per_step[threads - 1];
      count.ran(steps, took, static_cast<std::int64_t>(took * interruptions_per_s));
      had[threads] += took, t += took;
    }
    return had;
  }
};

const Machine quiet{{2e-4, 1.1e-4}, 2}, shared{{2e-4, 4e-4}, 300}, hardly_shared{{2e-4, 1.5e-4}, 300};

TEST(ThreadCount, KeepsAllOnAQuietMachine) {
  ThreadCount count(2);
  EXPECT_EQ(quiet.run(count, 60)[1], 0);
}

TEST(ThreadCount, TakesFewerWhereThatIsFaster) {
  ThreadCount count(2);
  shared.run(count, 5);
  const auto had = shared.run(count, 60);
  EXPECT_GT(had[1], 0.9 * 60);
  EXPECT_GT(had[2], 0);  // looks whether that still holds
}

TEST(ThreadCount, KeepsAllWhereFewerAreSlower) {
  ThreadCount count(2);
  EXPECT_GT(hardly_shared.run(count, 60)[2], 0.9 * 60);
}

TEST(ThreadCount, TakesAllAgainOnceTheMachineIsQuiet) {
  ThreadCount count(2);
  shared.run(count, 30);
  quiet.run(count, 5);
  EXPECT_EQ(quiet.run(count, 60)[1], 0);
}

TEST(ThreadCount, GoesDownAsFarAsItPays) {
  ThreadCount count(4);
  const Machine two_left{{2e-4, 1.1e-4, 3e-4, 4e-4}, 300};
  two_left.run(count, 20);
  const auto had = two_left.run(count, 60);
  EXPECT_GT(had[2], 0.9 * 60);
}

TEST(ThreadCount, OneThreadStaysOne) {
  ThreadCount count(1);
  Machine{{2e-4}, 300}.run(count, 10);
  EXPECT_EQ(count.now(), 1);
}

}  // namespace
}  // namespace moraine::dem::cpu
