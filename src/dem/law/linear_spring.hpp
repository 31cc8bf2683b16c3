// Normal force of a linear spring (Damsgaard et al. 2013, eq. 6): f_n = -k_n delta_n. Tangential stiffness
// k_t.
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/part.hpp"

namespace moraine::dem {

struct LinearSpring {
  static constexpr bool linear = true, hertz = false;
  static constexpr bool needs_radius = false;

  struct Parameters {
    double k_n = 1.16e9;  // N/m
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() { return std::tuple{Named{"k_n", &Parameters::k_n}}; }
  };

  // What it works out once of where a pair stands: nothing.
  template <class T>
  struct At {};
  template <class P, class T>
  MORAINE_HD static At<T> at(const P&, const Geometry<T>&, const NoRadius<T>&) {
    return {};
  }

  template <class T>
  MORAINE_HD static T force(const Parameters& p, const Geometry<T>& g, const At<T>&) {  // N
    return T(-p.k_n) * g.delta_n;
  }
  // What of f_n is not the spring's, N.
  template <class T>
  MORAINE_HD static T rest(const Parameters& p, const Geometry<T>& g, const At<T>&, const T& f_n) {
    return fma(T(p.k_n), g.delta_n, f_n);
  }
  template <class P, class T>
  MORAINE_HD static T k_t(const P& p, const At<T>&) {  // N/m
    return T(p.k_t);
  }
  template <class T>
  MORAINE_HD static T stiffness(const Parameters& p, const At<T>&) {  // N/m, df_n/d(overlap)
    return T(p.k_n);
  }
  static double stored(const Parameters& p, const Geometry<double>& g, const At<double>&) {  // J
    const double overlap = -g.delta_n;
    return 0.5 * p.k_n * overlap * overlap;
  }
};

}  // namespace moraine::dem
