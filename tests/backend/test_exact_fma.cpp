// The fma of processors that have none: the bits of the library's, which rounds once.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <random>

#include "backend/exact_fma.hpp"

namespace moraine {
namespace {

double with_exponents(std::uint64_t random, int lowest, int many) {
  const std::uint64_t exponent = 1023 + lowest + (random >> 54) % many;
  return std::bit_cast<double>((random & 0x800fffffffffffff) | (exponent << 52));
}

void expect_the_librarys(double a, double b, double c) {
  const exact::Two both = exact::fma(exact::Two{a, b}, exact::Two{b, a}, exact::Two{c, c});
  const double right = std::fma(a, b, c);
  for (int lane = 0; lane < 2; ++lane)
    if (std::isnan(right))
      EXPECT_TRUE(std::isnan(both[lane])) << a << " " << b << " " << c;
    else
      ASSERT_EQ(std::bit_cast<std::uint64_t>(double(both[lane])), std::bit_cast<std::uint64_t>(right))
          << std::hexfloat << a << " " << b << " " << c;
}

TEST(ExactFma, IsTheLibrarysForNumbersOfAllSizes) {
  std::mt19937_64 random(1);
  for (int k = 0; k < 300000; ++k) {
    const int many = k % 3 == 0 ? 6 : k % 3 == 1 ? 80 : 2040, lowest = -many / 2;
    expect_the_librarys(with_exponents(random(), lowest, many), with_exponents(random(), lowest, many),
                        with_exponents(random(), lowest, many));
  }
}

// Where a b and c all but cancel, what is left is the error of a b. Few bits make sums half way between two
// numbers.
TEST(ExactFma, IsTheLibrarysWhereSumsCancelOrLieHalfWay) {
  std::mt19937_64 random(2);
  for (int k = 0; k < 300000; ++k) {
    const double a = with_exponents(random(), -9, 18), b = with_exponents(random(), -9, 18);
    expect_the_librarys(a, b, -a * b);
    expect_the_librarys(a, b, std::nextafter(-a * b, 0));
    const auto few = [&] { return double(int(random() % 64) - 32); };
    expect_the_librarys(few() * 0x1p-54, few(), few());
    expect_the_librarys(1 + few() * 0x1p-52, 1 + few() * 0x1p-52, few());
  }
}

TEST(ExactFma, KnowsZeroesAndInfinities) {
  const double all[] = {0.0, -0.0, 1.0, -1.0, 1e-310, -1e300, 1e200, INFINITY, -INFINITY, NAN};
  for (const double a : all)
    for (const double b : all)
      for (const double c : all) expect_the_librarys(a, b, c);
}

}  // namespace
}  // namespace moraine
