// The sine that every processor works out alike.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "backend/number.hpp"

namespace moraine {
namespace {

// The library's is right to 0.6 of a last bit of 1, which is 1.1e-16; three are allowed.
TEST(Sine, IsTheLibrarysToTheLastBits) {
  for (const double step : {0.01, 0.7, 31.3})
    for (int k = -2000; k <= 2000; ++k) {
      const double x = step * k + 1e-3;
      ASSERT_NEAR(sine(x), std::sin(x), 3.4e-16) << x;
    }
  EXPECT_EQ(sine(0), 0);
  EXPECT_EQ(sine(1e-200), 1e-200);
}

// Where it is next to nothing its last bits still count.
TEST(Sine, CrossesZeroWhereTheLibrarysDoes) {
  for (int k = -50; k <= 50; ++k) {
    if (k == 0) continue;
    const double x = k * std::numbers::pi;
    EXPECT_NEAR(sine(x) / std::sin(x), 1, 1e-15) << k;
  }
}

}  // namespace
}  // namespace moraine
