// The account of energy: what has passed since the stage began, J. observe.hpp has the balance with what is
// stored.
#pragma once

namespace moraine::dem {

struct Ledger {
  double slip = 0;     // dissipated by sliding friction: law/contact.hpp, act()
  double viscous = 0;  // dissipated by gamma_n, gamma_t
  double planes = 0;   // work on the grains and the planes of what moves planes: body/motion.hpp, close()
  double layers = 0;   // work on the grains of the driven layers: likewise
  double viscous_power = 0;  // W, at the present step
  double water = 0;          // work on the grains and the top wall of pore water
};

}  // namespace moraine::dem
