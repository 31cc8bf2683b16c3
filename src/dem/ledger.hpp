// The account of energy: what has passed since the stage began, J. observe.hpp has the balance with what is
// stored.
#pragma once
#include "backend/host_device.hpp"

namespace moraine::dem {

// What contacts dissipate in a step, J.
struct Dissipation {
  double slip = 0, viscous = 0;
};

struct Ledger {
  double slip = 0;     // dissipated by sliding friction: law/contact.hpp, act()
  double viscous = 0;  // dissipated by gamma_n, gamma_t: likewise
  double planes = 0;   // work on the grains and the planes of what moves planes: body/motion.hpp, close()
  double layers = 0;   // work on the grains of the driven layers: likewise
  double water = 0;    // work on the grains and the top wall of pore water

  MORAINE_HD void add(const Dissipation& d) { slip += d.slip, viscous += d.viscous; }
};

}  // namespace moraine::dem
