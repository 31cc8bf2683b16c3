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
  LawUses& operator|=(const LawUses& also) {
    friction |= also.friction, softening |= also.softening, damping |= also.damping;
    restitution |= also.restitution, linear |= also.linear, hertz |= also.hertz, couples |= also.couples;
    return *this;
  }
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
// use(parameters) of each pair of materials that grains of the scene may be of, and of each with walls.
template <class Use>
void for_each_pair_of_grains(const Scene& s, Use&& use) {
  for (int i = 0; i < s.materials; ++i)
    for (int j = 0; j < s.materials; ++j) use(s.between(static_cast<Material>(i), static_cast<Material>(j)));
}
template <class Use>
void for_each_pair_with_walls(const Scene& s, Use&& use) {
  for (int i = 0; i < s.materials; ++i) use(s.between(static_cast<Material>(i), Material::wall));
}
inline Uses asked_by(const Scene& s) {
  Uses u;
  u.ledger = s.ledger, u.water = s.exchange_interval > 0;
  for_each_pair_of_grains(s, [&](const ContactParameters& p) { u.grains |= asked_by(p); });
  if (s.has_planes())
    for_each_pair_with_walls(s, [&](const ContactParameters& p) { u.planes |= asked_by(p); });
  return u;
}

// Calls use.operator()<Row, account>() with the first row of CompiledLaws that has all the scene asks for.
template <class Use>
void with_laws(const Scene& s, Use&& use) {
  const Uses u = asked_by(s);
  const auto covers = [&]<class L>(const LawUses& asked, L*) {
    return L::rubs >= asked.friction && L::softens >= asked.softening && L::damps >= asked.damping &&
           L::restitutes >= asked.restitution && L::linear >= asked.linear && L::hertz >= asked.hertz &&
           L::couples >= asked.couples;
  };
  const auto covers_parts = [&]<class Grains, class Planes>(Grains*, Planes*) {
    bool all = true;
    for_each_pair_of_grains(s, [&](const ContactParameters& p) { all &= MoreParts::covered_by<Grains>(p); });
    if (s.has_planes())
      for_each_pair_with_walls(s,
                               [&](const ContactParameters& p) { all &= MoreParts::covered_by<Planes>(p); });
    return all;
  };
  const auto try_row = [&]<class Row>(Row*) {
    using Grains = typename Row::BetweenGrains;
    using Planes = typename Row::AtPlanes;
    if (!covers(u.grains, static_cast<Grains*>(nullptr)) ||
        !covers(u.planes, static_cast<Planes*>(nullptr)) ||
        !covers_parts(static_cast<Grains*>(nullptr), static_cast<Planes*>(nullptr)))
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
