// Blocks that work in step, which the engine of the GPU rests on.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <vector>

#include "backend/host.hpp"

namespace moraine {
namespace {

// A ring of numbers, each of which becomes the sum of its neighbours, many times over. Two buffers and one
// barrier a round must do.
struct Ring {
  struct Shared {
    int rounds;
  };
  std::vector<long>* numbers;  // [2]
  int rounds;

  void operator()(const Host::Team& team, Shared& shared) const {
    team.once([&] { shared.rounds = 0; });
    const int n = static_cast<int>(numbers[0].size()), at_once = team.items_at_once();
    while (shared.rounds < rounds) {
      const std::vector<long>& old = numbers[shared.rounds & 1];
      std::vector<long>& next = numbers[(shared.rounds + 1) & 1];
      for (int begin = team.block() * at_once; begin < n; begin += team.blocks() * at_once)
        team.for_each_item(std::min(at_once, n - begin), [&](const auto& item) {
          const int i = begin + item.index;
          item.in_order(old[(i + 1) % n], [&](long x) { next[i] = (old[(i + n - 1) % n] + x) % 1000003; });
        });
      team.barrier();
      team.once([&] { ++shared.rounds; });
    }
  }
};

TEST(Team, OneBarrierARoundIsEnoughForTwoBuffers) {
  const int n = 70, unit = 8;  // the last unit is not full
  std::vector<std::vector<long>> results;
  for (const int threads : {1, 2, 4, 20}) {
    std::vector<long> numbers[2] = {std::vector<long>(n, 0), std::vector<long>(n, 0)};
    for (int i = 0; i < n; ++i) numbers[0][i] = i * i;
    Host host;
    host.threads = threads;
    host.cooperate((n + unit - 1) / unit, unit, Ring{numbers, 300});
    results.push_back(numbers[0]);
  }
  for (const auto& r : results) EXPECT_EQ(r, results[0]);
}

// No block without work: it would only make the others wait.
TEST(Team, NoMoreBlocksThanUnits) {
  struct Count {
    struct Shared {};
    std::atomic<int>*blocks, *most;
    void operator()(const Host::Team& team, Shared&) const {
      ++*blocks;
      most->store(team.blocks());
    }
  };
  for (const auto& [units, threads, expected] :
       {std::array{3, 8, 3}, std::array{8, 3, 3}, std::array{1, 1, 1}, std::array{0, 2, 1}}) {
    std::atomic<int> blocks{0}, most{0};
    Host host;
    host.threads = threads;
    host.cooperate(units, 4, Count{&blocks, &most});
    EXPECT_EQ(blocks, expected);
    EXPECT_EQ(most, expected);
  }
}

}  // namespace
}  // namespace moraine
