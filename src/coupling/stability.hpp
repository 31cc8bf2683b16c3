// How often grains and water must meet. Undrained water and skeleton swing with w_f and w_sk at most, and
// with impulses every m steps they stay bounded while m dt sqrt(w_sk^2 + w_f^2) < 2.
#pragma once
#include <cstdint>
#include <vector>

#include "coupling/water.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::coupling {

class Skeleton;

struct Stability {
  double w_sk = 0,
         w_f = 0;  // rad/s; largest of the dry contact network, and of the grains on the water's stiffness
  std::int64_t longest = 0;  // steps; 0: not even every step
  double longest_dt = 0;     // s, with which an exchange at every step would be stable
};

// storage: m3/Pa, C of each cell.
Stability stability_of(const Skeleton& skeleton, const Water& water, const std::vector<double>& storage,
                       const dem::Scene& scene, const dem::State& grains);

// Steps between exchanges: those asked for, or for 0 the longest. Throws Error where that is unstable, naming
// what is not.
std::int64_t choose_interval(const Stability& stability, std::int64_t asked, double dt);

}  // namespace moraine::coupling
