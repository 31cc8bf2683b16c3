// Hertz's normal force and Mindlin's tangential stiffness, of elastic spheres:
//
//   f_n = 4/3 E* a overlap,   a = sqrt(R overlap),   1/R = 1/r_i + 1/r_j (a plane: R = r_i)
//   k_t = 8 G* a
//   1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j,   1/G* = (2 - nu_i)/G_i + (2 - nu_j)/G_j,  G = E/(2 (1 + nu))
//   (Johnson 1985, Contact mechanics, eqs. 4.22 to 4.24 and 7.42)
//
// k_t changes with the normal force under a sheared spring. While a grows, the spring's force is kept, so
// that its displacement shrinks by k_t before/k_t; while a shrinks, its displacement is kept, so that its
// force falls with k_t. Both lose energy, which is booked as slip: the part of the contact that joins is not
// sheared yet, and the part that leaves gives up what it held. With either rule for both directions a cycle
// of normal and shear force creates energy (Elata & Berryman 1996, Mech. Mater. 24, 229). Over a step, with
// q = min(1, k_t before/k_t):
//
//   delta_t = q delta_t before + (1 + q)/2 v_t dt
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/linear_spring.hpp"
#include "dem/law/part.hpp"

namespace moraine::dem {

// Pa, of two materials with Young's moduli E (Pa) and Poisson's ratios nu.
inline double young_star(double E_i, double nu_i, double E_j, double nu_j) {
  return 1 / ((1 - nu_i * nu_i) / E_i + (1 - nu_j * nu_j) / E_j);
}
inline double shear_star(double E_i, double nu_i, double E_j, double nu_j) {
  return 1 / (2 * (2 - nu_i) * (1 + nu_i) / E_i + 2 * (2 - nu_j) * (1 + nu_j) / E_j);
}

struct Hertz {
  static constexpr bool linear = false, hertz = true;
  static constexpr bool needs_radius = true;

  struct Parameters {
    double E_star = 0, G_star = 0;  // Pa; 0: another law
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple{Named{"E_star", &Parameters::E_star}, Named{"G_star", &Parameters::G_star}};
    }
  };

  template <class T>
  struct Memory {
    T a_before{};  // m, at the step before; 0 where it did not touch
    static constexpr auto list() { return std::tuple{Named{"a_before", &Memory::a_before}}; }
  };
  template <class P>
  static bool keeps(const P& p) {
    return p.G_star > 0 && p.mu_s > 0;
  }

  template <class T>
  struct At {
    T a;  // m, radius of the contact
  };
  template <class P, class T>
  MORAINE_HD static At<T> at(const P&, const Geometry<T>& g, const Radius<T>& r) {
    return {sqrt(max(-g.delta_n, T(0)) * r.radius)};
  }

  template <class T>
  MORAINE_HD static T force(const Parameters& p, const Geometry<T>& g, const At<T>& at) {  // N
    return T(-4.0 / 3 * p.E_star) * at.a * g.delta_n;
  }
  template <class T>
  MORAINE_HD static T rest(const Parameters& p, const Geometry<T>& g, const At<T>& at, const T& f_n) {
    return fma(T(4.0 / 3 * p.E_star) * at.a, g.delta_n, f_n);
  }
  template <class P, class T>
  MORAINE_HD static T k_t(const P& p, const At<T>& at) {  // N/m
    return T(8 * p.G_star) * at.a;
  }
  template <class T>
  MORAINE_HD static T stiffness(const Parameters& p, const At<T>& at) {  // N/m, df_n/d(overlap)
    return T(2 * p.E_star) * at.a;
  }
  static double stored(const Parameters& p, const Geometry<double>& g, const At<double>& at) {  // J
    return -0.4 * force(p, g, at) * g.delta_n;
  }
};

// Either, of which the other's parameters are zero: for the law that has everything.
struct LinearOrHertz {
  static constexpr bool linear = true, hertz = true;
  static constexpr bool needs_radius = true;

  template <class T>
  using At = Hertz::At<T>;
  template <class P, class T>
  MORAINE_HD static At<T> at(const P& p, const Geometry<T>& g, const Radius<T>& r) {
    return Hertz::at(p, g, r);
  }
  template <class P, class T>
  MORAINE_HD static T force(const P& p, const Geometry<T>& g, const At<T>& at) {
    return LinearSpring::force(p, g, {}) + Hertz::force(p, g, at);
  }
  template <class P, class T>
  MORAINE_HD static T rest(const P& p, const Geometry<T>& g, const At<T>& at, const T& f_n) {
    return Hertz::rest(p, g, at, LinearSpring::rest(p, g, {}, f_n));
  }
  template <class P, class T>
  MORAINE_HD static T k_t(const P& p, const At<T>& at) {
    return LinearSpring::k_t(p, LinearSpring::At<T>{}) + Hertz::k_t(p, at);
  }
  template <class P, class T>
  MORAINE_HD static T stiffness(const P& p, const At<T>& at) {
    return LinearSpring::stiffness(p, LinearSpring::At<T>{}) + Hertz::stiffness(p, at);
  }
  template <class P>
  static double stored(const P& p, const Geometry<double>& g, const At<double>& at) {
    return LinearSpring::stored(p, g, {}) + Hertz::stored(p, g, at);
  }
};

}  // namespace moraine::dem
