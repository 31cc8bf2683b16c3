// Every way to spell a quantity has its value or is refused: a number too many never scales another one.
#include "case/quantity.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "case/units.hpp"
#include "error.hpp"

namespace moraine::cases {
namespace {

using std::string;

struct Number {
  string text;
  double value;
};
const std::vector<Number> numbers{
    {"12", 12},
    {"+12", 12},
    {"-12", -12},
    {"\u221212", -12},
    {"12.", 12},
    {".5", 0.5},
    {"0.5", 0.5},
    {"12.5", 12.5},
    {"1.2e3", 1200},
    {"1E3", 1000},
    {"1e+3", 1000},
    {"1.25e-3", 1.25e-3},
    {"1 200", 1200},
    {"12 500", 12500},
    {"-12 500", -12500},
    {"1 234 567.5", 1234567.5},
    {"1\u00a0200", 1200},
    {"12\u2009500", 12500},
    {"12\u202f500", 12500},
    {"100", 100},
    {"0", 0},
    {"012", 12},
};

struct Unit {
  string text;
  double factor;
  string si;
};
const std::vector<Unit> units{
    {"Pa", 1, "Pa"},
    {"kPa", 1e3, "Pa"},
    {"N/m2", 1, "Pa"},
    {"kN m-2", 1e3, "Pa"},
    {"N/mm\u00b2", 1e6, "Pa"},
    {"kN m^-2", 1e3, "Pa"},
    {"kN m\u207b\u00b2", 1e3, "Pa"},
    {"kg/(m s2)", 1, "Pa"},
    {"kg m-1 s**-2", 1, "Pa"},
    {"bar", 1e5, "Pa"},
    {"cm_H2O", 98.0665, "Pa"},
    {"1/s", 1, "1/s"},
    {"/s", 1, "1/s"},
    {"s-1", 1, "1/s"},
    {"per s", 1, "1/s"},
    {"%/s", 0.01, "1/s"},
    {"1 / ms", 1e3, "1/s"},
    {"s\u207b\u00b9", 1, "1/s"},
    {"s^-1", 1, "1/s"},
    {"1/Pa", 1, "1/Pa"},
    {"1/GPa", 1e-9, "1/Pa"},
    {"GPa^-1", 1e-9, "1/Pa"},
    {"m2/N", 1, "1/Pa"},
    {"N s/m", 1, "N s/m"},
    {"N\u00b7s/m", 1, "N s/m"},
    {"N*s/m", 1, "N s/m"},
    {"N.s/m", 1, "N s/m"},
    {"kN-s/m", 1e3, "N s/m"},
    {"N s m-1", 1, "N s/m"},
    {"N s per m", 1, "N s/m"},
    {"(kN) s/(m)", 1e3, "N s/m"},
    {"m2", 1, "m2"},
    {"mm2", 1e-6, "m2"},
    {"m\u00b2", 1, "m2"},
    {"m^2", 1, "m2"},
    {"kg/m3", 1, "kg/m3"},
    {"g/cm3", 1e3, "kg/m3"},
    {"g cm-3", 1e3, "kg/m3"},
    {"t m-3", 1e3, "kg/m3"},
    {"m s-2", 1, "m/s2"},
    {"m/s^2", 1, "m/s2"},
    {"m/s/s", 1, "m/s2"},
    {"cm s\u207b\u00b2", 0.01, "m/s2"},
    {"mPa s", 1e-3, "Pa s"},
    {"Hz", 1, "Hz"},
    {"1/min", 1.0 / 60, "Hz"},
    {"%", 0.01, "1"},
    {"", 1, "1"},
    {"mm/m", 1e-3, "1"},
    {"rad", 1, "rad"},
    {"\u00b0", std::numbers::pi / 180, "rad"},
    {"degree", std::numbers::pi / 180, "rad"},
    {"\u00b5m", 1e-6, "m"},
    {"m/yr", 1 / 31556925.9747, "m/s"},
};

// With a number in each of these ways, behind any unit or in front of it.
const std::vector<string> stray{
    "2 50 U",    "2 5000 U",     "0 500 U",
    "1.5 500 U", "1e3 500 U",    "2  500 U",
    "2.5.1 U",   "2 x 5 U",      "2*5 U",
    "2 * U",     "2\u00b75 U",   "2 \u00d7 10 U",
    "10^3 U",    "10\u00b3 U",   "10**3 U",
    "1e5e3 U",   "12,500 U",     "12,5 U",
    "1_000 U",   "0x10 U",       "1'000 U",
    "5 U 3",     "5 U.5",        "5 U 0.5",
    "5 U @ 3",   "5 U from 3",   "5 U since 2001-01-01",
    "5 U*2",     "5 U/2",        "5 2 U",
    "5 (2 U)",   "5 1e2 U",      "5 U ref 3",
    "5 U,",      "5 U;",         "5 U.",
    "5 U/",      "5 (U",         "5 U)",
    "5 2/U",     "1/2 U",        "5 U 10 m/m",
    "5 U (2)",   "5 U \u00b7 2", "5 1 U",
    "5 U - 3",   "5 U + 3",      "5, U",
    "5 ,U",      "5 .U",
};

// No number to begin with, or none that a computer can hold.
const std::vector<string> no_number{"U",    "inf U",   "nan U",    "infinity U", ". U", "+-5 U",
                                    "e5 U", "1e400 U", "1e-400 U", "--5 U",      ""};

string with(string pattern, const string& unit) {
  const auto at = pattern.find('U');
  return at == pattern.npos ? pattern : pattern.replace(at, 1, unit);
}

bool refused(const string& text, const string& si) {
  try {
    to_si(text, si);
  } catch (const Error& e) {
    EXPECT_EQ(string(e.what()).find('\n'), string::npos) << e.what();
    return true;
  }
  return false;
}

TEST(Quantity, EveryNumberWithEveryUnit) {
  int spellings = 0;
  for (const Number& n : numbers)
    for (const Unit& u : units)
      for (const string& between : {" ", "", "\u00a0", "\u202f"}) {
        if (between.empty() && (u.text.starts_with('1') || u.text == "per s")) continue;
        const string text = n.text + between + u.text;
        const double expected = n.value * u.factor;
        EXPECT_NEAR(to_si(text, u.si), expected, 4e-16 * std::abs(expected)) << text;
        ++spellings;
      }
  EXPECT_GE(spellings, 200);
}

TEST(Quantity, NoSecondNumberWithAnyUnit) {
  int spellings = 0;
  for (const Unit& u : units)
    for (const auto* patterns : {&stray, &no_number})
      for (const string& pattern : *patterns) {
        if (pattern == "U" && u.text.starts_with('1')) continue;      // 1/Pa is one and a unit
        if (pattern == "5 1 U" && u.text.starts_with('/')) continue;  // as is 5 1 /s
        const string text = with(pattern, u.text);
        EXPECT_TRUE(refused(text, u.si)) << text << " for " << u.si;
        ++spellings;
      }
  EXPECT_GE(spellings, 200);
}

TEST(Quantity, UnitsThatScaleShiftOrCountOtherwise) {
  const std::vector<std::pair<string, string>> wrong{
      {"80 kPa %", "Pa"},     {"80 % kPa", "Pa"},       {"80 %kPa", "Pa"},
      {"80 kPa rad", "Pa"},   {"80 kPa degree", "Pa"},  {"80 kPa pi", "Pa"},
      {"80 kPa m/m2", "Pa"},  {"80 kPa dozen", "Pa"},   {"80 kPa0", "Pa"},
      {"80 kPa m0", "Pa"},    {"80 kPa1.5", "Pa"},      {"80 kPa^1.5", "Pa"},
      {"80 kPa22", "Pa"},     {"80 kPa^2", "Pa"},       {"80 kPa2", "Pa"},
      {"80 kPa^", "Pa"},      {"80 kPa e", "Pa"},       {"80 kPa count", "Pa"},
      {"80 kPa per", "Pa"},   {"80 kPa per ppm", "Pa"}, {"80 kPa since", "Pa"},
      {"80 dB", "Pa"},        {"80 lg(re 1 Pa)", "Pa"}, {"80 kPa(m)", "Pa"},
      {"80 (kPa", "Pa"},      {"80 ()", "Pa"},          {"80 kPa+2", "Pa"},
      {"80 \u2080kPa", "Pa"}, {"30 %2", "1"},           {"30 %%", "1"},
      {"30 % %", "1"},        {"30 1/%", "1"},          {"30 degree", "1"},
      {"30 rad", "1"},        {"0.5 1", "1"},           {"0.5 0.5", "1"},
      {"1/3", "1"},           {"50 %", "rad"},          {"5 degC", "K"},
      {"5 \u00b0C", "K"},     {"10 rpm", "Hz"},         {"10 rad/s", "Hz"},
      {"10 cycle/s", "Hz"},   {"20 s", "1/s"},          {"5 s since 1990-01-01", "s"},
      {"2000-01-01", "s"},    {"12:30 s", "s"},         {"5 m 20 cm", "m"},
      {"5 m20", "m"},         {"5 kg/m3 2", "kg/m3"},
  };
  for (const auto& [text, si] : wrong) EXPECT_TRUE(refused(text, si)) << text << " for " << si;
}

TEST(Quantity, SaysWhatWasUnderstood) {
  const auto fault = [](const string& text) {
    try {
      return std::to_string(to_si(text, "Pa"));
    } catch (const Error& e) {
      return string(e.what());
    }
  };
  const string expected = "; expected one number and a unit, as in \"1 Pa\"";
  EXPECT_EQ(fault("12 50 Pa"),
            "understood the number 12 and the unit \"50 Pa\", but \"50 Pa\" is another number" + expected);
  EXPECT_EQ(fault("12 kPa 3"),
            "understood the number 12 and the unit \"kPa 3\", but \"3\" is another number" + expected);
  EXPECT_EQ(
      fault("12,500 Pa"),
      "understood the number 12 and the unit \",500 Pa\", but \",500 Pa\" begins with a comma; decimals "
      "take a point, thousands none" +
          expected);
  EXPECT_EQ(
      fault("1_000 Pa"),
      "understood the number 1 and the unit \"_000 Pa\", but \"_000 Pa\" is no part of a unit" + expected);
  EXPECT_EQ(fault("1e400 Pa"), "1e400 is too large or too small a number");
}

}  // namespace
}  // namespace moraine::cases
