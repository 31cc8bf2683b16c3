// How a quantity is spelled: one number, then a unit expression. UDUNITS-2 takes a number inside of a unit
// for a factor, a shift or an exponent ("12 500 Pa" for 6000 Pa), so the spelling is ours and only the names
// of units go there.
#pragma once
#include <string>
#include <vector>

namespace moraine::cases {

// "12 500 kPa" -> 12500, kPa. The number has its spaces between thousands taken out; it is empty where the
// text does not begin with one. The unit is what follows, whatever it may be.
struct Quantity {
  std::string number, unit;
};
Quantity split_quantity(const std::string& text);

// "1/(Pa·s)", "kg m^-3", "N per m": names of units with their powers, negative below the bar, and the same in
// the plainest words of UDUNITS-2, "1/(Pa s)", "kg m-3", "N/m".
struct UnitExpression {
  struct Factor {
    std::string name;
    int power;
  };
  std::vector<Factor> factors;
  std::string plain;
};
// Throws Error with what in it is no part of a unit, such as another number.
UnitExpression read_unit(const std::string& unit);

}  // namespace moraine::cases
