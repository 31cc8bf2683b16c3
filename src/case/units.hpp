// Quantities with units, by UDUNITS-2: "80 kPa" -> 80000 for Pa. The rest of the program knows only SI.
#pragma once
#include <string>

namespace moraine::cases {

// The number of `si_unit` in `text`, a number and a unit: "80 kPa", "12 500 Pa", "0.05 1/s", "30 %". Throws
// Error with what was understood.
double to_si(const std::string& text, const std::string& si_unit);

}  // namespace moraine::cases
