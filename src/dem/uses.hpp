// What a scene uses, and the compiled laws it takes for that. What it does not use costs it nothing: neither
// a term in a loop nor a task in its step.
#pragma once
#include <utility>

#include "dem/scene.hpp"
#include "error.hpp"

namespace moraine::dem {

struct LawUses {
  bool friction = false;   // tangential springs and torques
  bool softening = false;  // mu_d < mu_s
  bool damping = false;
  bool restitution = false;  // damping by a coefficient of restitution
  bool linear = false, hertz = false;
  bool couples = false;  // rolling or twisting
  bool operator==(const LawUses&) const = default;
};
struct Uses {
  LawUses grains, planes;
  bool ledger = false;
  bool water = false;
  bool damping() const { return grains.damping || planes.damping; }
  bool operator==(const Uses&) const = default;
};

// What its parameters ask for.
inline LawUses asked_by(const ContactParameters& p) {
  const bool couples = Rolling::used(p) || Twisting::used(p);
  const bool friction = couples || (p.mu_s > 0 && (p.k_t > 0 || p.gamma_t > 0 || p.G_star > 0));
  return {.friction = friction,
          .softening = friction && SofteningCoulomb::keeps(p),
          .damping = Restitution::used(p),
          .restitution = p.zeta > 0,
          .linear = p.k_n > 0 || p.k_t > 0,
          .hertz = p.E_star > 0,
          .couples = couples};
}
inline Uses asked_by(const Scene& s) {
  return {asked_by(s.with(Material::grain)), s.has_planes() ? asked_by(s.with(Material::wall)) : LawUses{},
          s.ledger, s.exchange_interval > 0};
}

// Calls use.operator()<Row, account>() with the first row of CompiledLaws that has all the scene asks for.
template <class Use>
void with_laws(const Scene& s, Use&& use) {
  const Uses u = asked_by(s);
  const auto covers = [&]<class L>(const LawUses& asked, Material with, L*) {
    return L::rubs >= asked.friction && L::softens >= asked.softening && L::damps >= asked.damping &&
           L::restitutes >= asked.restitution && L::linear >= asked.linear && L::hertz >= asked.hertz &&
           L::couples >= asked.couples && MoreParts::covered_by<L>(s.with(with));
  };
  const auto try_row = [&]<class Row>(Row*) {
    using Grains = typename Row::BetweenGrains;
    using Planes = typename Row::AtPlanes;
    if (!covers(u.grains, Material::grain, static_cast<Grains*>(nullptr)) ||
        !covers(u.planes, Material::wall, static_cast<Planes*>(nullptr)))
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
    const auto of = []<class L>(L*) {
      return LawUses{L::rubs, L::softens, L::damps, L::restitutes, L::linear, L::hertz, L::couples};
    };
    u.grains = of(static_cast<Grains*>(nullptr)), u.planes = of(static_cast<Planes*>(nullptr));
  });
  return u;
}

}  // namespace moraine::dem
