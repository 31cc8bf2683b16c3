// Viscous damping (Damsgaard et al. 2013, eq. 6): -gamma_n v.n along the normal, where the sum never pulls,
// and -gamma_t v_t along the contact's plane, within Coulomb's limit. Needs the velocities at step n, which
// are foreseen (leapfrog.hpp).
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/part.hpp"

namespace moraine::dem {

struct Undamped {
  static constexpr bool damps = false;
};

struct Viscosity {
  static constexpr bool damps = true;

  struct Parameters {
    double gamma_n = 0;  // N s/m
    double gamma_t = 0;  // N s/m
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple{Named{"gamma_n", &Parameters::gamma_n}, Named{"gamma_t", &Parameters::gamma_t}};
    }
  };
  static bool used(const Parameters& p) { return p.gamma_n > 0 || p.gamma_t > 0; }

  // N, on top of an elastic normal force.
  template <class T>
  MORAINE_HD static T normal(const Parameters& p, const Geometry<T>& g, const Motion<T>& now,
                             const T& elastic) {
    return max(fma(T(-p.gamma_n), dot(now.v, g.n), elastic), T(0));
  }
  // N, on top of an elastic tangential force, before Coulomb's limit.
  template <class T>
  MORAINE_HD static Vec3<T> tangential(const Parameters& p, const Geometry<T>& g, const Motion<T>& now,
                                       const Vec3<T>& elastic) {
    const Vec3<T> c = cross_plus(g.n, axpy(g.l_i, now.omega_i, g.l_j * now.omega_j), now.v);
    return axpy(T(-p.gamma_t), less(c, dot(c, g.n), g.n), elastic);
  }
};

}  // namespace moraine::dem
