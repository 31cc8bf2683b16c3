// Viscous damping (Damsgaard et al. 2013, eq. 6): -gamma_n v.n along the normal, where the sum never pulls,
// and -gamma_t v_t along the contact's plane, within Coulomb's limit. v is that of the contact at step n,
// foreseen from the last two half steps, hence second order in dt: a contact remembers its velocity.
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/part.hpp"

namespace moraine::dem {

struct Undamped {
  static constexpr bool damps = false, restitutes = false;
};

struct Viscosity {
  static constexpr bool damps = true, restitutes = false;

  struct Parameters {
    double gamma_n = 0;  // N s/m
    double gamma_t = 0;  // N s/m
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple{Named{"gamma_n", &Parameters::gamma_n}, Named{"gamma_t", &Parameters::gamma_t}};
    }
  };
  MORAINE_HD static bool used(const Parameters& p) { return p.gamma_n > 0 || p.gamma_t > 0; }
  template <class P>
  static bool keeps(const P& p) {  // zeta: restitution.hpp
    return used(p) || p.zeta > 0;
  }

  template <class T>
  struct Memory {
    Vec3<T> v_before{};  // m/s, v_c at n - 1/2; zero where it did not touch at n
    static constexpr auto list() { return std::tuple{Named{"v_before", &Memory::v_before}}; }
  };
  // v_c at n + 1, from those at n + 1/2 and n - 1/2; the former alone in a contact's first step.
  template <class T>
  MORAINE_HD static Vec3<T> foreseen(const Vec3<T>& v_c, const Memory<T>& memory) {
    const Vec3<T>& v = memory.v_before;
    const auto touched = dot(v, v) > T(0);
    return select(touched, axpy(T(0.5), v_c - v, v_c), v_c);
  }

  // N s/m, on a normal force of law N.
  template <class N, class P, class T>
  MORAINE_HD static T gamma_n(const P& p, const Geometry<T>&, const typename N::template At<T>&) {
    return T(p.gamma_n);
  }
  // N, on top of an elastic normal force.
  template <class T>
  MORAINE_HD static T normal(const T& gamma_n, const Geometry<T>& g, const Vec3<T>& v, const T& elastic) {
    return max(fma(-gamma_n, dot(v, g.n), elastic), T(0));
  }
  // N, on top of an elastic tangential force, before Coulomb's limit.
  template <class T>
  MORAINE_HD static Vec3<T> tangential(const Parameters& p, const Geometry<T>& g, const Vec3<T>& v,
                                       const Vec3<T>& elastic) {
    return axpy(T(-p.gamma_t), less(v, dot(v, g.n), g.n), elastic);
  }
};

// For the account of energy: what damping does over a step is the mean of its force before and after, times
// the contact's displacement, so a contact remembers the force.
struct ViscousWork {
  template <class T>
  struct Memory {
    Vec3<T> f_viscous{};  // N, the part of the force at n that damping contributes
    static constexpr auto list() { return std::tuple{Named{"f_viscous", &Memory::f_viscous}}; }
  };
  template <class P>
  static bool keeps(const P& p) {
    return Viscosity::keeps(p);
  }
};

}  // namespace moraine::dem
