// Constant cohesion: grains that touch pull at each other with c, whatever their overlap. Coulomb's limit and
// those of rolling see the force without it.
//
// The force jumps by c where a contact opens or closes, which is between steps. In the one step in which a
// contact is met first or last, c counts with the share of the step that the contact lasted: with u, the way
// that the grains close in a step, and an overlap x < |u|,
//
//   f_n = -c (1/2 + x/|u|),   energy -c |u|/2 (1/2 + x/|u|)
//
// in place of -c and -c x. The impulse is then that of the exact jump, and the account of energy stays second
// order; with -c at every step that overlaps, each contact that opens or closes would lose or gain c |u|/2 at
// most.
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/part.hpp"

namespace moraine::dem {

struct Cohesion : WithoutMemory<Cohesion> {
  static constexpr bool couples = false;

  struct Parameters {
    double cohesion = 0;  // N
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() { return std::tuple{Named{"cohesion", &Parameters::cohesion}}; }
  };
  static bool used(const Parameters& p) { return p.cohesion > 0; }

  // closing: m, u, positive where grains come closer.
  template <class T>
  MORAINE_HD static T share(const T& delta_n, const T& closing) {
    const T way = max(closing, -closing);
    return select(-delta_n < way, fma(T(-1), delta_n / way, T(0.5)), T(1));
  }
  template <class T>
  MORAINE_HD static T normal(const Parameters& p, const Geometry<T>& g, const T& closing) {  // N, on i
    return T(-p.cohesion) * share(g.delta_n, closing);
  }
  static double stored(const Parameters& p, const Geometry<double>& g, double closing) {  // J
    const double way = max(closing, -closing), part = share(g.delta_n, closing);
    return -p.cohesion * (-g.delta_n < way ? 0.5 * way * part : -g.delta_n);
  }
};

}  // namespace moraine::dem
