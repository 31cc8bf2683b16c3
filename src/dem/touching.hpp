// Pairs of grains that touch, found from their places alone. For the host.
#pragma once
#include <cmath>

#include "dem/close_grains.hpp"

namespace moraine::dem {

class TouchingPairs {
 public:
  // Calls visit(i, j, overlap in m) for each pair, once, always in the same order. Throws Error if a
  // coordinate is not finite.
  template <class Visit>
  void each(const Scene& scene, const GrainRow* grains, Index n, Visit&& visit) {
    grains_.sort(Host{}, scene, grains, n, 0);
    for (Index k = 0; k < n; ++k)
      grains_.after(k, 0, [&](Index l, double reach, double distance2) {
        visit(grains_.grain(k), grains_.grain(l), reach - std::sqrt(distance2));
      });
  }

 private:
  CloseGrains grains_;
};

}  // namespace moraine::dem
