// The margin of the candidates goes to where searching and useless pairs cost the same.
#include "dem/cpu/search_margin.hpp"

#include <gtest/gtest.h>

namespace moraine::dem::cpu {
namespace {

// Searches last so long as the margin lets them: near lists are drawn in proportion to it, for a time that
// grows with the margin.
double settled(double search, double drawing, double first) {
  SearchMargin m(first, 1e-4, 1e-2);
  m.searched(search, 0, 0);  // the one that begins
  for (int k = 0; k < 100; ++k) {
    const double draws = 1e5 * m.margin(), each = drawing * (1 + 1e3 * m.margin());
    m.searched(search + each, each, draws);
  }
  return m.margin();
}

TEST(SearchMargin, SettlesFromAnywhereWhereBothCostTheSame) {
  const double margin = settled(1e-3, 1e-5, 1e-3);
  EXPECT_GT(margin, 1e-4);
  EXPECT_LT(margin, 1e-2);
  EXPECT_NEAR(settled(1e-3, 1e-5, 1e-4), margin, 1e-3 * margin);
  EXPECT_NEAR(settled(1e-3, 1e-5, 1e-2), margin, 1e-3 * margin);
  EXPECT_GT(settled(4e-3, 1e-5, 1e-3), 1.3 * margin);  // dearer searches: a wider margin
}

TEST(SearchMargin, StaysWithinItsBounds) {
  EXPECT_EQ(settled(1e3, 1e-9, 1e-3), 1e-2);
  EXPECT_EQ(settled(1e-9, 1, 1e-3), 1e-4);
  SearchMargin given(5e-4, 5e-4, 5e-4);
  for (int k = 0; k < 10; ++k) given.searched(1, 0.1, 50);
  EXPECT_EQ(given.margin(), 5e-4);
  EXPECT_DOUBLE_EQ(given.search_seconds(), 10);
}

}  // namespace
}  // namespace moraine::dem::cpu
