#include "case/units.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "error.hpp"

namespace moraine::cases {
namespace {

TEST(Units, converts_to_si) {
  EXPECT_DOUBLE_EQ(to_si("80 kPa", "Pa"), 80000);
  EXPECT_DOUBLE_EQ(to_si("0.05 1/s", "1/s"), 0.05);
  EXPECT_DOUBLE_EQ(to_si("0.05/s", "1/s"), 0.05);
  EXPECT_DOUBLE_EQ(to_si("1e4 N s/m", "N s/m"), 1e4);
  EXPECT_DOUBLE_EQ(to_si("1.16e9 N/m", "N/m"), 1.16e9);
  EXPECT_DOUBLE_EQ(to_si("90 degree", "rad"), std::numbers::pi / 2);
  EXPECT_DOUBLE_EQ(to_si("2.6 g/cm3", "kg/m3"), 2600);
  EXPECT_DOUBLE_EQ(to_si(" -20 mm ", "m"), -0.02);
  EXPECT_DOUBLE_EQ(to_si("30 %", "1"), 0.3);
  EXPECT_DOUBLE_EQ(to_si("0.3", "1"), 0.3);
}

std::string fault(const std::string& text, const std::string& unit) {
  try {
    to_si(text, unit);
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(Units, says_what_was_expected) {
  EXPECT_EQ(fault("80 m", "Pa"), "\"m\" has the wrong dimension; expected a unit convertible to Pa");
  EXPECT_EQ(fault("80", "Pa"), "expected a unit convertible to Pa after the number");
  EXPECT_EQ(fault("kPa", "Pa"), "expected a number and a unit, as in \"1 Pa\"");
  EXPECT_EQ(fault("much", "1"), "expected a number");
  EXPECT_EQ(fault("80 foo", "Pa"), "\"foo\" is no unit; expected one convertible to Pa");
}

TEST(Units, a_period_is_no_frequency) {
  EXPECT_EQ(fault("20 s", "1/s"), "\"s\" has the wrong dimension; expected a unit convertible to 1/s");
}

}  // namespace
}  // namespace moraine::cases
