// Pressures carried over to another grid.
#include "fluid/problems.hpp"
#include "fluid/regrid.hpp"

namespace moraine::fluid {
namespace {

TEST(Regrid, EqualGridsGiveEqualBits) {
  const std::vector<double> p = Random(1).vector(3 * 4 * 7, -1e4, 1e4);
  EXPECT_EQ(regrid(p, {3, 4, 7}, {3, 4, 7}), p);
}

TEST(Regrid, TheMeanIsKept) {
  const std::vector<double> p = Random(2).vector(3 * 4 * 7, 0, 1e4);
  const double mean = sum(p) / static_cast<double>(p.size());
  for (const std::array<int, 3>& to : {std::array{5, 4, 7}, {3, 1, 7}, {3, 4, 6}, {2, 9, 8}, {1, 1, 1}}) {
    const std::vector<double> q = regrid(p, {3, 4, 7}, to);
    ASSERT_EQ(q.size(), static_cast<std::size_t>(to[0]) * to[1] * to[2]);
    EXPECT_NEAR(sum(q) / static_cast<double>(q.size()) / mean, 1, 1e-14);  // some hundred roundings
  }
}

// Each axis by itself, in the order of cells (grid.hpp).
TEST(Regrid, ByWhatCellsCover) {
  const std::vector<double> p{0, 6, 12};  // over thirds
  const std::vector<double> halves{2, 10}, quarters{0, 4, 8, 12};
  for (int axis = 0; axis < 3; ++axis) {
    std::array<int, 3> from{1, 1, 1}, to{1, 1, 1};
    from[axis] = 3, to[axis] = 2;
    EXPECT_LT(largest_difference(regrid(p, from, to), halves), 1e-14);
    to[axis] = 4;
    EXPECT_LT(largest_difference(regrid(p, from, to), quarters), 1e-14);
  }
  EXPECT_EQ(regrid({1, 2, 3, 4}, {2, 1, 2}, {1, 2, 2}), (std::vector<double>{1.5, 1.5, 3.5, 3.5}));
}

}  // namespace
}  // namespace moraine::fluid
