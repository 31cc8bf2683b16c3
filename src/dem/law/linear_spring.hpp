// Normal force of a linear spring (Damsgaard et al. 2013, eq. 6): f_n = -k_n delta_n.
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/part.hpp"

namespace moraine::dem {

struct LinearSpring {
  struct Parameters {
    double k_n = 1.16e9;  // N/m
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() { return std::tuple{Named{"k_n", &Parameters::k_n}}; }
  };

  template <class T>
  MORAINE_HD static T force(const Parameters& p, const Geometry<T>& g) {  // N
    return T(-p.k_n) * g.delta_n;
  }
  // What of f_n is not the spring's, N.
  template <class T>
  MORAINE_HD static T rest(const Parameters& p, const Geometry<T>& g, const T& f_n) {
    return fma(T(p.k_n), g.delta_n, f_n);
  }
  static double stored(const Parameters& p, double overlap) { return 0.5 * p.k_n * overlap * overlap; }  // J
};

}  // namespace moraine::dem
