#include "dem/cpu/pair_list.hpp"

namespace moraine::dem::cpu {

void PairList::clear() {
  pairs.clear(), across_sides.clear(), count = 0;
  MoreParts::for_each_memory([&]<class Part>() { of<Part>().clear(); });
}

void PairList::pad(Index i, Index far_away, Index target) {
  while (count % lanes != 0) add(i, far_away, target, false, {});
}

}  // namespace moraine::dem::cpu
