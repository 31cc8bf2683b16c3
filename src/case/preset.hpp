// Presets: settings that trade accuracy for time, by one name. A preset fills the keys below where a case
// does not state them itself:
//   model.f           time step in units of sqrt(min m / k), eq. 9
//   model.softening   k_n and k_t of grains and walls are divided by it; the step grows with its root
//   wall.gamma_n, wall.gamma_t   damping at the walls while settling and consolidating; about as much a step
//                                as in the paper, where 1e4 N s/m would be unstable with longer steps
// What each costs in accuracy is measured by bench/work-precision.
#pragma once
#include <string>
#include <vector>

#include "case/read.hpp"

namespace moraine::cases {

struct Preset {
  std::string name;
  double f;
  double softening;
  double wall_gamma;     // N s/m
  std::string evidence;  // the figures measured, and where
};
const std::vector<Preset>& presets();

// Enters what model.preset sets; does nothing where there is none.
void apply_preset(Draft& draft);

// For `moraine keys`: what each sets, and its evidence.
std::string preset_reference();

}  // namespace moraine::cases
