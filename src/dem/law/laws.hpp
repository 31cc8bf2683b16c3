// The laws there are, and which of them are compiled: the list that a new law is added to.
//
// A part of a law (spring, friction, damping, ...) stands in a header of its own. What a scene does not use
// is not compiled into its loop: a scene takes the first row of CompiledLaws that has all it uses. The last
// row has everything.
#pragma once
#include <cmath>
#include <type_traits>

#include "dem/law/cohesion.hpp"
#include "dem/law/contact.hpp"

namespace moraine::dem {

// Further parts; see Law for what each must have.
template <class... Parts>
struct PartList {
  // Parameters of all parts, for one pair of materials.
  struct Parameters : LinearSpring::Parameters,
                      Hertz::Parameters,
                      Coulomb::Parameters,
                      Viscosity::Parameters,
                      Restitution::Parameters,
                      Parts::Parameters... {
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple_cat(LinearSpring::Parameters::list(), Hertz::Parameters::list(),
                            Coulomb::Parameters::list(), Viscosity::Parameters::list(),
                            Restitution::Parameters::list(), Parts::Parameters::list()...);
    }
  };
  // What a contact remembers, of all parts.
  template <class T>
  struct Memory : Coulomb::Memory<T>,
                  Hertz::Memory<T>,
                  SofteningCoulomb::Memory<T>,
                  Viscosity::Memory<T>,
                  ViscousWork::Memory<T>,
                  Parts::template Memory<T>... {
    static constexpr auto list() {
      return std::tuple_cat(Coulomb::Memory<T>::list(), Hertz::Memory<T>::list(),
                            SofteningCoulomb::Memory<T>::list(), Viscosity::Memory<T>::list(),
                            ViscousWork::Memory<T>::list(), Parts::template Memory<T>::list()...);
    }
  };
  // use.operator()<Part>() for each part that remembers something.
  template <class Use>
  static constexpr void for_each_memory(Use&& use) {
    use.template operator()<Coulomb>(), use.template operator()<Hertz>();
    use.template operator()<SofteningCoulomb>();
    use.template operator()<Viscosity>(), use.template operator()<ViscousWork>();
    (use.template operator()<Parts>(), ...);
  }
  // A list of each part's memory.
  template <template <class...> class List, class T>
  using MemoryLists = std::tuple<List<Coulomb::Memory<T>>, List<Hertz::Memory<T>>,
                                 List<SofteningCoulomb::Memory<T>>, List<Viscosity::Memory<T>>,
                                 List<ViscousWork::Memory<T>>, List<typename Parts::template Memory<T>>...>;

  using General = Law<LinearOrHertz, SofteningCoulomb, Restitution, Parts...>;
  template <class L>
  static bool covered_by(const Parameters& p) {
    return (true && ... && (L::template has<Parts> || !Parts::used(p)));
  }
};
using MoreParts = PartList<Rolling, Twisting, Cohesion>;

using ContactParameters = MoreParts::Parameters;
template <class T>
using Spring = MoreParts::Memory<T>;
using GeneralLaw = MoreParts::General;  // also evaluates forces where speed is no matter (observe.cpp)

// A contact as it may be where none is at hand: pressed in by a hundredth of the smaller radius. Laws whose
// stiffness grows with the overlap have theirs here where a step has to be chosen beforehand.
constexpr double usual_overlap = 0.01;
inline Geometry<double> usual_contact(double r_i, double r_j) {
  return between_grains(Vec3d{0, 0, r_i + r_j - usual_overlap * min(r_i, r_j)}, r_i + r_j, r_i - r_j);
}
inline Geometry<double> usual_contact_at_plane(double r) {
  return at_plane({0, 0, (1 - usual_overlap) * r}, r, 2, 0, 1);
}

// N/m, df_n/d(overlap) of a contact.
inline double stiffness_of(const ContactParameters& p, const Geometry<double>& g) {
  return GeneralLaw::Normal::stiffness(p, patch<GeneralLaw>(p, g).at());
}

inline double tangential_stiffness_of(const ContactParameters& p, const Geometry<double>& g) {  // N/m
  return GeneralLaw::Normal::k_t(p, patch<GeneralLaw>(p, g).at());
}
// Linear springs as stiff as the law is for equal grains under a pressure (Pa), of which each contact bears
// pressure (2 r)^2.
inline ContactParameters as_linear(ContactParameters p, double r, double pressure) {
  if (p.E_star > 0) {
    const double radius = 0.5 * r, f = 4 * pressure * r * r;
    const double a = std::cbrt(0.75 * f * radius / p.E_star);
    p.k_n += 2 * p.E_star * a, p.k_t += 8 * p.G_star * a;
    p.E_star = p.G_star = 0;
  }
  return p;
}

template <class Friction, class Damping, class... More>
using Linear = Law<LinearSpring, Friction, Damping, More...>;
template <class Friction, class Damping, class... More>
using HertzMindlin = Law<Hertz, Friction, Damping, More...>;

template <class BetweenGrains_, class AtPlanes_>
struct Laws {
  using BetweenGrains = BetweenGrains_;
  using AtPlanes = AtPlanes_;
};

using CompiledLaws = std::tuple<  // between grains, at planes
    Laws<Linear<Frictionless, Undamped>, Linear<Frictionless, Undamped>>,
    Laws<Linear<Frictionless, Undamped>, Linear<Frictionless, Viscosity>>,
    Laws<Linear<Frictionless, Viscosity>, Linear<Frictionless, Viscosity>>,
    Laws<Linear<Coulomb, Undamped>, Linear<Frictionless, Undamped>>,
    Laws<Linear<Coulomb, Undamped>, Linear<Coulomb, Undamped>>,
    Laws<Linear<Coulomb, Undamped>, Linear<Coulomb, Viscosity>>,
    Laws<Linear<Coulomb, Viscosity>, Linear<Frictionless, Undamped>>,
    Laws<Linear<Coulomb, Viscosity>, Linear<Coulomb, Viscosity>>,
    Laws<Linear<SofteningCoulomb, Undamped>, Linear<Frictionless, Undamped>>,
    Laws<Linear<SofteningCoulomb, Undamped>, Linear<SofteningCoulomb, Undamped>>,
    Laws<Linear<SofteningCoulomb, Undamped>, Linear<SofteningCoulomb, Viscosity>>,
    Laws<Linear<SofteningCoulomb, Viscosity>, Linear<SofteningCoulomb, Viscosity>>,
    Laws<Linear<Coulomb, Undamped, Rolling>, Linear<Frictionless, Undamped>>,
    Laws<Linear<Coulomb, Undamped, Rolling>, Linear<Coulomb, Restitution, Rolling>>,
    Laws<Linear<Coulomb, Restitution, Rolling>, Linear<Coulomb, Restitution, Rolling>>,
    Laws<HertzMindlin<Frictionless, Undamped>, HertzMindlin<Frictionless, Undamped>>,
    Laws<HertzMindlin<Coulomb, Undamped>, HertzMindlin<Frictionless, Undamped>>,
    Laws<HertzMindlin<Coulomb, Undamped>, HertzMindlin<Coulomb, Restitution>>,
    Laws<HertzMindlin<Coulomb, Undamped, Rolling>, HertzMindlin<Coulomb, Restitution, Rolling>>,
    Laws<HertzMindlin<Coulomb, Restitution>, HertzMindlin<Coulomb, Restitution>>,
    Laws<HertzMindlin<Coulomb, Restitution, Rolling>, HertzMindlin<Coulomb, Restitution, Rolling>>,
    Laws<GeneralLaw, GeneralLaw>>;

}  // namespace moraine::dem
