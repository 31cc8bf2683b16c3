#include "dem/cpu/pair_list.hpp"

namespace moraine::dem::cpu {

void PairList::clear() {
  pairs.clear(), runs.clear(), count = 0;
  MoreParts::for_each_memory([&]<class Part>() { of<Part>().clear(); });
}

void PairList::pad(Index i, Index far_away, Index target) {
  while (count % lanes != 0) add(i, far_away, target, false, {});
}

bool PairList::remembers(Index place) const {
  bool any = false;
  const Spring<double> s = spring(place);
  const auto look = [&](const char*, const auto& value, const auto&) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, Vec3d>)
      any = any || value != Vec3d{};
    else
      any = any || value != 0;
  };
  for_each_remembered([&]<class Part>() {
    const typename Part::template Memory<double>& memory = s;
    for_each_named(memory, memory, look);
  });
  return any;
}

}  // namespace moraine::dem::cpu
