// The cases of a sweep: --set KEY=10,20,40 kPa gives one case for each value, several lists their product. A
// unit behind the last value is that of all values without one. Commas in quotes or brackets belong to the
// value, all others separate values (never thousands or decimals); a comma behind one value makes it a list
// of one.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "case/case.hpp"

namespace moraine::run {

struct PlannedCase {
  std::string name;  // from the values, safe in a shell: "normal_stress-10kPa", "mu_s-0.3+seed-1", in the
                     // order of the alphabet whatever that of the lists
  std::vector<cases::Override> overrides;
  std::vector<std::string> values;  // one for each column of the plan
};

struct Plan {
  std::vector<std::string> columns;  // "normal_stress (kPa)"; without the unit where values differ in it
  std::vector<PlannedCase> cases;    // the last list changes fastest
  std::string understood;            // "normal_stress = 10 kPa, 20 kPa; seed = 1, 2"
};

// Throws Error for an empty value, for a value given twice, for numbers of which only some have a unit or
// that seem to be parts of one with commas, and where there is nothing to sweep.
Plan plan_sweep(const std::vector<cases::Override>& sets);

}  // namespace moraine::run
