// What a scene uses, and the compiled laws it takes for that. What it does not use costs it nothing: neither
// a term in a loop nor a task in its step.
#pragma once
#include <utility>

#include "dem/scene.hpp"
#include "error.hpp"

namespace moraine::dem {

struct Uses {
  bool friction = false;   // tangential springs and torques, between grains or at planes
  bool softening = false;  // mu_d < mu_s
  bool damped_grains = false;
  bool damped = false;  // between grains or at planes
  bool ledger = false;
  bool water = false;
};

// What its parameters ask for.
inline Uses asked_by(const Scene& s) {
  const ContactParameters &grain = s.with(Material::grain), &wall = s.with(Material::wall);
  const auto any = [&](auto test) { return test(grain) || (s.has_planes() && test(wall)); };
  Uses u;
  u.friction = any([](const ContactParameters& p) { return p.mu_s > 0 && (p.k_t > 0 || p.gamma_t > 0); });
  u.softening = u.friction && any([](const ContactParameters& p) { return SofteningCoulomb::keeps(p); });
  u.damped_grains = Viscosity::used(grain);
  u.damped = any([](const ContactParameters& p) { return Viscosity::used(p); });
  u.ledger = s.ledger;
  u.water = s.exchange_interval > 0;
  return u;
}

// Calls use.operator()<Row, account>() with the first row of CompiledLaws that has all the scene asks for.
template <class Use>
void with_laws(const Scene& s, Use&& use) {
  const Uses u = asked_by(s);
  const auto covers = [&]<class L>(bool damped, Material with, L*) {
    return L::rubs >= u.friction && L::softens >= u.softening && L::damps >= damped &&
           MoreParts::covered_by<L>(s.with(with));
  };
  const auto try_row = [&]<class Row>(Row*) {
    using Grains = typename Row::BetweenGrains;
    using Planes = typename Row::AtPlanes;
    if (!covers(u.damped_grains, Material::grain, static_cast<Grains*>(nullptr)) ||
        !covers(u.damped, Material::wall, static_cast<Planes*>(nullptr)))
      return false;
    if (u.ledger)
      use.template operator()<Row, Account::energy>();
    else
      use.template operator()<Row, Account::none>();
    return true;
  };
  const bool found = [&]<class... Rows>(std::tuple<Rows...>*) {
    return (try_row(static_cast<Rows*>(nullptr)) || ...);
  }(static_cast<CompiledLaws*>(nullptr));
  if (!found) throw error("internal: no row of CompiledLaws has all that the scene asks for");
}

// Which row of CompiledLaws it is.
template <class Row>
constexpr int row_number = []<class... Rows>(std::tuple<Rows...>*) {
  int number = 0;
  const bool found = ((std::is_same_v<Row, Rows> || (++number, false)) || ...);
  return found ? number : -1;
}(static_cast<CompiledLaws*>(nullptr));

// What it asks for, and what else the row has that it takes.
inline Uses uses_of(const Scene& s) {
  Uses u = asked_by(s);
  with_laws(s, [&]<class Row, Account>() {
    using Grains = typename Row::BetweenGrains;
    using Planes = typename Row::AtPlanes;
    u.friction = Grains::rubs || Planes::rubs, u.softening = Grains::softens || Planes::softens;
    u.damped_grains = Grains::damps, u.damped = Grains::damps || Planes::damps;
  });
  return u;
}

}  // namespace moraine::dem
