// Which of the contact law's features a scene uses.
#pragma once
#include "dem/contact.hpp"

namespace moraine::dem {

inline Features features_of(const Scene& s) {
  const bool walls = s.floor || s.top_wall.drive != TopWall::Drive::none;
  const auto any = [&](auto test) { return test(s.grain) || (walls && test(s.wall)); };
  Features f;
  f.friction = any([](const ContactParameters& p) { return p.mu_s > 0 && (p.k_t > 0 || p.gamma_t > 0); });
  const auto viscous = [](const ContactParameters& p) { return p.gamma_n > 0 || p.gamma_t > 0; };
  f.viscous = viscous(s.grain), f.damped = any(viscous);
  f.softening = f.friction && any([](const ContactParameters& p) { return p.mu_d < p.mu_s; });
  f.ledger = s.ledger;
  f.water = s.exchange_interval > 0;
  return f;
}

// What of it the grains' contacts with one another and those with walls need.
constexpr Features between_grains(Features f) {
  f.damped = f.viscous, f.water = false;
  return f;
}
constexpr Features at_walls(Features f) {
  f.viscous = f.damped, f.water = false;
  return f;
}

// Calls use.operator()<F>() with the compiled set of features that equals f.
template <class Use>
void with_features(const Features& f, Use&& use) {
  const auto water = [&]<bool friction, bool viscous, bool damped, bool softening, bool ledger>() {
    if (f.water)
      use.template operator()<Features{friction, viscous, softening, ledger, damped, true}>();
    else
      use.template operator()<Features{friction, viscous, softening, ledger, damped, false}>();
  };
  const auto ledger = [&]<bool friction, bool viscous, bool damped, bool softening>() {
    if (f.ledger)
      water.template operator()<friction, viscous, damped, softening, true>();
    else
      water.template operator()<friction, viscous, damped, softening, false>();
  };
  const auto viscous = [&]<bool friction, bool softening>() {
    if (f.viscous)
      ledger.template operator()<friction, true, true, softening>();
    else if (f.damped)
      ledger.template operator()<friction, false, true, softening>();
    else
      ledger.template operator()<friction, false, false, softening>();
  };
  if (!f.friction)
    viscous.template operator()<false, false>();
  else if (f.softening)
    viscous.template operator()<true, true>();
  else
    viscous.template operator()<true, false>();
}

}  // namespace moraine::dem
