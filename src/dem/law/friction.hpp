// Coulomb friction on a tangential spring (Damsgaard et al. 2013, eqs. 6 to 8): f_t = -k_t delta_t, |f_t| <=
// mu f_n. mu is mu_s, and mu_d once the contact slips; where both are equal nothing has to be remembered of
// slip.
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/part.hpp"

namespace moraine::dem {

struct Frictionless {
  static constexpr bool rubs = false, softens = false;
};

struct Coulomb {
  static constexpr bool rubs = true, softens = false;

  struct Parameters {
    double k_t = 1.16e9;  // N/m
    double mu_s = 0.3;    // static friction, >= mu_d
    double mu_d = 0.3;    // dynamic friction
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple{Named{"k_t", &Parameters::k_t}, Named{"mu_s", &Parameters::mu_s},
                        Named{"mu_d", &Parameters::mu_d}};
    }
  };

  template <class T>
  struct Memory {
    Vec3<T> delta_t{};  // m, tangential spring of i against j
    static constexpr auto list() { return std::tuple{Named{"delta_t", &Memory::delta_t}}; }
  };
  template <class P>
  static bool keeps(const P& p) {
    return (p.k_t > 0 || p.G_star > 0) && p.mu_s > 0;
  }

  // Coulomb's limit, N.
  template <class T, class Spring>
  MORAINE_HD static T limit(const Parameters& p, const T& f_n, const Spring&) {
    return T(p.mu_s) * f_n;
  }
  static double stored(double k_t, const Vec3d& delta_t) { return 0.5 * k_t * dot(delta_t, delta_t); }  // J
};

struct SofteningCoulomb : Coulomb {
  static constexpr bool softens = true;

  template <class T>
  struct Memory {
    T slipping{};  // 1 after a step that slipped, else 0
    static constexpr auto list() { return std::tuple{Named{"slipping", &Memory::slipping}}; }
  };
  static bool keeps(const Parameters& p) { return p.mu_d < p.mu_s; }

  template <class T>
  MORAINE_HD static T limit(const Parameters& p, const T& f_n, const Memory<T>& spring) {
    return select(spring.slipping > T(0), T(p.mu_d), T(p.mu_s)) * f_n;
  }
};

}  // namespace moraine::dem
