// The laws there are, and which of them are compiled: the list that a new law is added to.
//
// A part of a law (spring, friction, damping, ...) stands in a header of its own. What a scene does not use
// is not compiled into its loop: a scene takes the first row of CompiledLaws that has all it uses. The last
// row has everything.
#pragma once
#include <type_traits>

#include "dem/law/contact.hpp"

namespace moraine::dem {

// Further parts; see Law for what each must have.
template <class... Parts>
struct PartList {
  // Parameters of all parts, for one pair of materials.
  struct Parameters : LinearSpring::Parameters,
                      Coulomb::Parameters,
                      Viscosity::Parameters,
                      Parts::Parameters... {
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple_cat(LinearSpring::Parameters::list(), Coulomb::Parameters::list(),
                            Viscosity::Parameters::list(), Parts::Parameters::list()...);
    }
  };
  // What a contact remembers, of all parts.
  template <class T>
  struct Memory : Coulomb::Memory<T>,
                  SofteningCoulomb::Memory<T>,
                  Viscosity::Memory<T>,
                  ViscousWork::Memory<T>,
                  Parts::template Memory<T>... {
    static constexpr auto list() {
      return std::tuple_cat(Coulomb::Memory<T>::list(), SofteningCoulomb::Memory<T>::list(),
                            Viscosity::Memory<T>::list(), ViscousWork::Memory<T>::list(),
                            Parts::template Memory<T>::list()...);
    }
  };
  // use.operator()<Part>() for each part that remembers something.
  template <class Use>
  static constexpr void for_each_memory(Use&& use) {
    use.template operator()<Coulomb>(), use.template operator()<SofteningCoulomb>();
    use.template operator()<Viscosity>(), use.template operator()<ViscousWork>();
    (use.template operator()<Parts>(), ...);
  }
  // A list of each part's memory.
  template <template <class...> class List, class T>
  using MemoryLists =
      std::tuple<List<Coulomb::Memory<T>>, List<SofteningCoulomb::Memory<T>>, List<Viscosity::Memory<T>>,
                 List<ViscousWork::Memory<T>>, List<typename Parts::template Memory<T>>...>;

  using General = Law<LinearSpring, SofteningCoulomb, Viscosity, Parts...>;
  template <class L>
  static bool covered_by(const Parameters& p) {
    return (true && ... && (L::template has<Parts> || !Parts::used(p)));
  }
};
using MoreParts = PartList<>;

using ContactParameters = MoreParts::Parameters;
template <class T>
using Spring = MoreParts::Memory<T>;
using GeneralLaw = MoreParts::General;  // also evaluates forces where speed is no matter (observe.cpp)

template <class Friction, class Damping, class... More>
using Linear = Law<LinearSpring, Friction, Damping, More...>;

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
    Laws<GeneralLaw, GeneralLaw>>;

}  // namespace moraine::dem
