// A snapshot of an earlier run as where a case begins.
#pragma once
#include "case/case.hpp"
#include "run/own_grains.hpp"

namespace moraine::run {

// Grains, layers, the box where the case has none, and the place of the top wall. Contacts begin with the
// springs that bear the snapshot's tangential forces, f_t = -k_t delta_t: but for rounding those that they
// had where nothing damped along the contact. Throws Error.
OwnGrains read_snapshot_grains(const cases::Case& c);

}  // namespace moraine::run
