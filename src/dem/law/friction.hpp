// Coulomb friction on a tangential spring (Damsgaard et al. 2013, eqs. 6 to 8): f_t = -k_t delta_t, |f_t| <=
// mu f_n. mu is mu_s, and mu_d once the contact slips; where both are equal nothing has to be remembered of
// slip.
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/parameters.hpp"

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
      return std::tuple{Parameter<Parameters>{"k_t", &Parameters::k_t},
                        Parameter<Parameters>{"mu_s", &Parameters::mu_s},
                        Parameter<Parameters>{"mu_d", &Parameters::mu_d}};
    }
  };

  // Coulomb's limit, N.
  template <class T>
  MORAINE_HD static T limit(const Parameters& p, const T& f_n, const T& /*slipping*/) {
    return T(p.mu_s) * f_n;
  }
  static double stored(const Parameters& p, const Vec3d& delta_t) {
    return 0.5 * p.k_t * dot(delta_t, delta_t);
  }  // J
};

struct SofteningCoulomb : Coulomb {
  static constexpr bool softens = true;

  static bool used(const Parameters& p) { return p.mu_d < p.mu_s; }

  template <class T>
  MORAINE_HD static T limit(const Parameters& p, const T& f_n, const T& slipping) {
    return select(slipping > T(0), T(p.mu_d), T(p.mu_s)) * f_n;
  }
};

}  // namespace moraine::dem
