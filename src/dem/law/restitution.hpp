// Damping of the normal direction that gives a wanted coefficient of restitution e, whatever the speed, the
// sizes and the stiffness:
//
//   gamma_n = 2 zeta sqrt(m* k_n)                  linear spring
//   gamma_n = sqrt(5) zeta sqrt(m* 4/3 E* a)       Hertz (Tsuji et al. 1992, Powder Technol. 71, 239)
//   1/m* = 1/m_i + 1/m_j (a plane: m* = m_i), masses as they resist acceleration
//
// beside the gamma_n that is given. Masses are those of free grains: against a grain that is held, or a wall
// that gives way, the true m* is another one, and e with it (0.40 for 0.3 between a free grain and a held
// one). The sum never pulls, so that a contact ends where its force does, before the overlap does. For the
// linear spring zeta(e) is then that of Schwager & Poeschel (2007, Granul. Matter 9, 465). For Hertz it is
// the same: in y = overlap^(5/4) its path v(y) is that of a linear spring, and its force ends on the same
// line in (y, v).
#pragma once
#include <numbers>

#include "dem/law/viscosity.hpp"

namespace moraine::dem {

// zeta of a coefficient of restitution in [0.05, 1].
double damping_ratio(double restitution);
// The coefficient of restitution of zeta >= 0.
double restitution_of(double damping_ratio);

struct Restitution : Viscosity {
  static constexpr bool restitutes = true;

  struct Parameters {
    double zeta = 0;                            // 1; 0: no damping of this kind
    double density_i = 2600, density_j = 2600;  // kg/m3, of the grains in contact; > 0
    double least_inertia = 0;                   // m, smaller grains have the mass of this radius
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple{Named{"zeta", &Parameters::zeta}, Named{"density_i", &Parameters::density_i},
                        Named{"density_j", &Parameters::density_j},
                        Named{"least_inertia", &Parameters::least_inertia}};
    }
  };
  template <class P>
  MORAINE_HD static bool used(const P& p) {
    return p.zeta > 0 || Viscosity::used(p);
  }

  // kg, m*.
  template <class T>
  MORAINE_HD static T reduced_mass(const Parameters& p, const Geometry<T>& g) {
    constexpr double ball = 4.0 / 3 * std::numbers::pi;
    const T r_i = max(radius_i(g), T(p.least_inertia)), r_j = max(radius_j(g), T(p.least_inertia));
    const T m_i = T(ball * p.density_i) * (r_i * r_i * r_i), m_j = T(ball * p.density_j) * (r_j * r_j * r_j);
    return select(at_grain(g), m_i * m_j / (m_i + m_j), m_i);
  }
  template <class N, class P, class T>
  MORAINE_HD static T gamma_n(const P& p, const Geometry<T>& g, const typename N::template At<T>& at) {
    T stiffness(0);  // (gamma_n/(2 zeta))^2/m*
    if constexpr (N::linear) stiffness = T(p.k_n);
    if constexpr (N::hertz) stiffness = fma(T(5.0 / 3 * p.E_star), at.a, stiffness);
    return fma(T(2 * p.zeta), sqrt(reduced_mass(p, g) * stiffness), T(p.gamma_n));
  }
};

}  // namespace moraine::dem
