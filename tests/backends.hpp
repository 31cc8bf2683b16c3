// Test bodies are written once and run on every backend: `class Bounce : public OnEveryBackend {};
// TEST_P(Bounce, ...) { auto engine = make(); ... }  ON_EVERY_BACKEND(Bounce);`
#pragma once
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "dem/engine.hpp"

namespace moraine {

struct BackendChoice {
  std::string name;
  dem::Backend backend;
  int threads;
};

inline void PrintTo(const BackendChoice& choice, std::ostream* out) { *out << choice.name; }

// Where the GPU's loop can run: on the host, and on a GPU if there is one.
inline std::vector<dem::Backend> gpu_loops() {
  if (dem::cuda_device_present()) return {dem::Backend::reference, dem::Backend::cuda};
  return {dem::Backend::reference};
}
inline std::vector<dem::Backend> both_engines() {
  std::vector<dem::Backend> all = gpu_loops();
  all.insert(all.begin(), dem::Backend::cpu);
  return all;
}

class OnEveryBackend : public testing::TestWithParam<BackendChoice> {
 protected:
  void SetUp() override {
    if (GetParam().backend != dem::Backend::cuda) return;
    if (!dem::cuda_built()) GTEST_SKIP() << "this build has no CUDA in it";
    if (!dem::cuda_device_present()) GTEST_SKIP() << "no NVIDIA GPU here";
  }
  std::unique_ptr<dem::Engine> make() const {
    return dem::make_engine(GetParam().backend, GetParam().threads);
  }
};

#define ON_EVERY_BACKEND(Suite)                                                                 \
  INSTANTIATE_TEST_SUITE_P(                                                                     \
      , Suite,                                                                                  \
      testing::Values(moraine::BackendChoice{"cpu_1_thread", moraine::dem::Backend::cpu, 1},    \
                      moraine::BackendChoice{"reference", moraine::dem::Backend::reference, 1}, \
                      moraine::BackendChoice{"cuda", moraine::dem::Backend::cuda, 1}),          \
      [](const auto& info) { return info.param.name; })

}  // namespace moraine
