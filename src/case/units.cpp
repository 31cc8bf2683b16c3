#include "case/units.hpp"

#include <udunits2.h>

#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <memory>

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

// The table of units that came along with the program; empty: that of the machine, or of UDUNITS2_XML_PATH.
std::string table_beside_program() {
  std::error_code none;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", none);
  const auto table = program.parent_path().parent_path() / "share/udunits/udunits2.xml";
  if (std::getenv("UDUNITS2_XML_PATH") || !std::filesystem::exists(table, none)) return "";
  return table.string();
}

ut_system* unit_system() {
  static const Owned<ut_system> system = [] {
    ut_set_error_message_handler(ut_ignore);
    const std::string table = table_beside_program();
    return Owned<ut_system>(ut_read_xml(table.empty() ? nullptr : table.c_str()));
  }();
  if (!system)
    throw error(
        "UDUNITS-2 cannot read its table of units: install libudunits2-data or set UDUNITS2_XML_PATH");
  return system.get();
}

Owned<ut_unit> parse_unit(const std::string& text) {
  return Owned<ut_unit>(ut_parse(unit_system(), text.c_str(), UT_UTF8));
}

std::string trimmed(const std::string& text) {
  const auto begin = text.find_first_not_of(" \t");
  return begin == text.npos ? "" : text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

}  // namespace

double to_si(const std::string& text, const std::string& si_unit) {
  const std::string quantity = trimmed(text);
  double number = 0;
  const char* end = quantity.data() + quantity.size();
  const auto [after, fault] = std::from_chars(quantity.data() + quantity.starts_with('+'), end, number);
  const bool plain = si_unit == "1";
  if (fault != std::errc())
    throw error("expected a number", plain ? "" : " and a unit, as in \"1 " + si_unit + "\"");

  std::string name = trimmed({after, end});
  if (name.empty() && !plain) throw error("expected a unit convertible to ", si_unit, " after the number");
  if (name.empty() || name.front() == '/') name = "1" + name;

  const auto unit = parse_unit(name), si = parse_unit(si_unit);
  if (!si) throw error("\"", si_unit, "\" is no unit");
  if (!unit) throw error("\"", name, "\" is no unit; expected one convertible to ", si_unit);
  // Not ut_are_convertible(): that lets a period pass for a frequency.
  const Owned<ut_unit> ratio(ut_divide(unit.get(), si.get()));
  if (!ratio || !ut_is_dimensionless(ratio.get()))
    throw error("\"", name, "\" has the wrong dimension; expected a unit convertible to ", si_unit);
  const Owned<cv_converter> to(ut_get_converter(unit.get(), si.get()));
  if (!to) throw error("\"", name, "\" cannot be converted to ", si_unit);
  return cv_convert_double(to.get(), number);
}

}  // namespace moraine::cases
