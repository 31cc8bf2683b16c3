#include "case/units.hpp"

#include <dlfcn.h>
#include <udunits2.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>

#include "case/quantity.hpp"
#include "error.hpp"

namespace moraine::cases {
namespace {

struct Free {
  void operator()(ut_system* system) const { ut_free_system(system); }
  void operator()(ut_unit* unit) const { ut_free(unit); }
  void operator()(cv_converter* converter) const { cv_free(converter); }
};
template <class T>
using Owned = std::unique_ptr<T, Free>;

// The file that holds this code: the program, or a library where a process of Python has loaded it.
std::filesystem::path own_file() {
  std::error_code none;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", none);
  Dl_info info{};
  if (!dladdr(reinterpret_cast<const void*>(&own_file), &info) || !info.dli_fname) return program;
  const auto file = std::filesystem::absolute(info.dli_fname, none);
  return file.string().ends_with(".so") ? file : program;  // of a program it has only what was typed
}

// The table of units that came along with the program, in share/udunits of a folder above it; empty: that of
// the machine, or of UDUNITS2_XML_PATH.
std::string table_beside_program() {
  if (std::getenv("UDUNITS2_XML_PATH")) return "";
  std::error_code none;
  auto folder = own_file().parent_path();
  for (int up = 0; up < 4;
       ++up, folder = folder.parent_path()) {  // lib/glibc-hwcaps/x86-64-v3 is three below
    const auto table = folder / "share/udunits/udunits2.xml";
    if (std::filesystem::exists(table, none)) return table.string();
  }
  return "";
}

ut_system* unit_system() {
  static const Owned<ut_system> system = [] {
    ut_set_error_message_handler(ut_ignore);
    const std::string table = table_beside_program();
    Owned<ut_system> read(ut_read_xml(table.empty() ? nullptr : table.c_str()));
    if (!read) return read;
    const Owned<ut_unit> degree(ut_get_unit_by_name(read.get(), "degree"));
    if (degree) ut_map_name_to_unit("deg", UT_UTF8, degree.get());  // which it does not know
    return read;
  }();
  if (!system)
    throw error(
        "UDUNITS-2 cannot read its table of units: install libudunits2-data or set UDUNITS2_XML_PATH");
  return system.get();
}

Owned<ut_unit> parse_unit(const std::string& text) {
  return Owned<ut_unit>(ut_parse(unit_system(), text.c_str(), UT_UTF8));
}

// Powers of metre, second, ... and of the radian, which counts as one of them: an angle is no friction, and
// 1 rad/s is not 1 Hz. Not ut_are_convertible(): that takes radians for 1, and a period for a frequency.
struct Dimension {
  std::map<std::string, int> powers;
  bool proportional = true;  // no degrees Celsius, decibels or dates
  bool operator==(const Dimension&) const = default;
};

Dimension dimension_of(const ut_unit* unit) {
  const ut_visitor visitor = {
      [](const ut_unit* basic, void* out) {
        static_cast<Dimension*>(out)->powers[ut_get_name(basic, UT_ASCII)] = 1;
        return UT_SUCCESS;
      },
      [](const ut_unit*, int count, const ut_unit* const* basics, const int* powers, void* out) {
        for (int k = 0; k < count; ++k)
          static_cast<Dimension*>(out)->powers[ut_get_name(basics[k], UT_ASCII)] = powers[k];
        return UT_SUCCESS;
      },
      [](const ut_unit*, double, const ut_unit* underlying, double offset, void* out) {
        *static_cast<Dimension*>(out) = dimension_of(underlying);
        if (offset != 0) static_cast<Dimension*>(out)->proportional = false;
        return UT_SUCCESS;
      },
      [](const ut_unit*, const ut_unit*, double, void* out) {
        static_cast<Dimension*>(out)->proportional = false;
        return UT_SUCCESS;
      },
      [](const ut_unit*, double, const ut_unit*, void* out) {
        static_cast<Dimension*>(out)->proportional = false;
        return UT_SUCCESS;
      }};
  Dimension dimension;
  ut_accept_visitor(unit, &visitor, &dimension);
  return dimension;
}

// Throws where a name is none of a unit, or one that scales others: "kPa %" would be 10 Pa.
void check_names(const UnitExpression& unit, const std::string& expected) {
  const auto& factors = unit.factors;
  for (std::size_t k = 0; k < factors.size(); ++k) {
    const auto known = parse_unit(factors[k].name);
    if (!known) throw error("\"", factors[k].name, "\" is no unit", expected);
    const Dimension d = dimension_of(known.get());
    if (!d.proportional)
      throw error("\"", factors[k].name, "\" counts from an origin or by logarithms", expected);
    const bool above_others =
        k == 0 && factors[0].power == 1 &&
        std::all_of(factors.begin() + 1, factors.end(), [](const auto& other) { return other.power < 0; });
    if (d.powers.empty() && !above_others)
      throw error("\"", factors[k].name,
                  "\" is a number, which may only stand alone or above a bar, as in %/s", expected);
  }
}

}  // namespace

double to_si(const std::string& text, const std::string& si_unit) {
  const auto [digits, name] = split_quantity(text);
  const bool plain = si_unit == "1";
  const std::string example = plain ? "" : " and a unit, as in \"1 " + si_unit + "\"";
  if (digits.empty()) throw error("expected a number", example);
  double number = 0;
  if (std::from_chars(digits.data(), digits.data() + digits.size(), number).ec != std::errc())
    throw error(digits, " is too large or too small a number");
  if (name.empty() && plain) return number;
  const std::string convertible = " convertible to " + si_unit;
  if (name.empty()) throw error("expected a unit", convertible, " after the number");

  UnitExpression spelled;
  try {
    spelled = read_unit(name);
  } catch (const Error& e) {
    throw error("understood the number ", digits, " and the unit \"", name, "\", but ", e.what(),
                "; expected one number", example);
  }
  check_names(spelled, "; expected one" + convertible);
  const auto unit = parse_unit(spelled.plain), si = parse_unit(si_unit);
  if (!si) throw error("\"", si_unit, "\" is no unit");
  if (!unit) throw error("\"", name, "\" is no unit; expected one", convertible);
  if (dimension_of(unit.get()) != dimension_of(si.get()))
    throw error("\"", name, "\" has the wrong dimension; expected a unit", convertible);
  const Owned<cv_converter> to(ut_get_converter(unit.get(), si.get()));
  if (!to) throw error("\"", name, "\" cannot be converted to ", si_unit);
  return cv_convert_double(to.get(), number);
}

}  // namespace moraine::cases
