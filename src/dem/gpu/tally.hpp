// What a grain, a group of them, a chunk or all add to a step's sums, on the GPU. Each number of a tally is
// summed by a thread of its own, in the order of sums.hpp.
#pragma once
#include "dem/body/motion.hpp"

namespace moraine::dem::gpu {

struct Tally {
  static constexpr int most_sums = 2 + most_servos;
  double sum[most_sums] = {};  // see TallyLayout
  float speed2 = 0;            // m2/s2, the largest, rounded up; infinite where a grain is lost
};

// Which sum is which, with so many servos. `what` counts all numbers of a tally, the speed first.
struct TallyLayout {
  std::int32_t servos = 0;

  static constexpr int speed = 0, first_sum = 1;
  MORAINE_HD int end() const { return first_sum + 2 + servos; }

  static constexpr int slip = 0, viscous = 1;
  MORAINE_HD int force(int servo) const { return 2 + servo; }

  MORAINE_HD Reaction reaction(const Tally& t) const {
    Reaction r;
    for (int k = 0; k < servos; ++k) r.force[k] = t.sum[force(k)];
    return r;
  }
  MORAINE_HD static Dissipation dissipation(const Tally& t) { return {t.sum[slip], t.sum[viscous]}; }
};

// One number of `to` from those of the tallies, added up in order (or on top of what it is). Many are read
// before the first is added: memory is far away. Zeros at the end change nothing.
MORAINE_HD void reduce(Tally& to, int what, const Tally* tallies, Index count, bool on_top = false) {
  constexpr Index batch = 32;
  if (what == TallyLayout::speed) {
    float fastest = on_top ? to.speed2 : 0, next[batch];
    for (Index begin = 0; begin < count; begin += batch) {
      for (Index k = 0; k < batch; ++k) next[k] = begin + k < count ? tallies[begin + k].speed2 : 0;
      for (Index k = 0; k < batch; ++k) fastest = ::fmaxf(next[k], fastest);
    }
    to.speed2 = fastest;
  } else {
    const int which = what - TallyLayout::first_sum;
    double sum = on_top ? to.sum[which] : 0, next[batch];
    for (Index begin = 0; begin < count; begin += batch) {
      for (Index k = 0; k < batch; ++k) next[k] = begin + k < count ? tallies[begin + k].sum[which] : 0;
      for (Index k = 0; k < batch; ++k) sum += next[k];
    }
    to.sum[which] = sum;
  }
}

}  // namespace moraine::dem::gpu
