#include "fluid/regrid.hpp"

#include <algorithm>
#include <cstdint>

namespace moraine::fluid {

// One axis after another.
std::vector<double> regrid(std::vector<double> p, const std::array<int, 3>& from,
                           const std::array<int, 3>& to) {
  std::array<int, 3> n = from;
  for (int a = 0; a < 3; ++a) {
    const int before = n[a];
    n[a] = to[a];
    const int stride = a == 0   ? 1
                       : a == 1 ? n[0]
                                : n[0] * n[1],
              rest = a == 2   ? 1
                     : a == 1 ? n[2]
                              : n[1] * n[2];
    std::vector<double> next(static_cast<std::size_t>(stride) * n[a] * rest, 0);
    for (int r = 0; r < rest; ++r)
      for (int i = 0; i < n[a]; ++i)
        for (int j = 0; j < before; ++j) {
          // In whole numbers, so that equal grids give equal bits.
          const std::int64_t low = std::max<std::int64_t>(std::int64_t{i} * before, std::int64_t{j} * n[a]),
                             high = std::min<std::int64_t>((i + std::int64_t{1}) * before,
                                                           (j + std::int64_t{1}) * n[a]);
          if (low >= high) continue;
          const double share = static_cast<double>(high - low) / before;
          for (int s = 0; s < stride; ++s)
            next[(static_cast<std::size_t>(r) * n[a] + i) * stride + s] +=
                share * p[(static_cast<std::size_t>(r) * before + j) * stride + s];
        }
    p = std::move(next);
  }
  return p;
}

}  // namespace moraine::fluid
