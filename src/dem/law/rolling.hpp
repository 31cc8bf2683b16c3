// Resistance to rolling and to twisting, elastic and perfectly plastic (Luding 2008, Granul. Matter 10, 235):
// a couple on i, and its opposite on j, of grains that are not round.
//
//   rolling    theta turns with the contact and grows by R (omega_i - omega_j) dt along the contact plane
//              couple = -R k_roll theta,   |k_roll theta| <= mu_roll f_n
//   twisting   the same about n, with k_twist and mu_twist
//
// R as in hertz.hpp. mu_roll is thus the tangent of the steepest slope on which a sphere can stand, if it
// does not slide.
#pragma once
#include "dem/law/geometry.hpp"
#include "dem/law/part.hpp"

namespace moraine::dem {

// What a couple does in a step.
template <class T>
struct Couple {
  Vec3<T> on_i;  // N m
  T slip;        // J, dissipated where it yields (with a ledger only)
};

struct Rolling {
  static constexpr bool couples = true;

  struct Parameters {
    double k_roll = 0;   // N/m
    double mu_roll = 0;  // 1
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple{Named{"k_roll", &Parameters::k_roll}, Named{"mu_roll", &Parameters::mu_roll}};
    }
  };
  template <class T>
  struct Memory {
    Vec3<T> rolled{};  // m, theta of i against j
    static constexpr auto list() { return std::tuple{Named{"rolled", &Memory::rolled}}; }
  };
  static bool used(const Parameters& p) { return p.k_roll > 0 && p.mu_roll > 0; }
  static bool keeps(const Parameters& p) { return used(p); }
  static double stored(const Parameters& p, const Memory<double>& m) {  // J
    return 0.5 * p.k_roll * dot(m.rolled, m.rolled);
  }

  // turn: m, R (omega_i - omega_j) dt. carried(old, grown): what carry() makes of a spring.
  template <bool ledger, class T, class Carried>
  MORAINE_HD static Couple<T> couple(const Parameters& p, const Geometry<T>&, const T& radius, const T& f_n,
                                     const Vec3<T>& turn, const Carried& carried, Memory<T>& memory) {
    const Vec3<T> trial = carried(memory.rolled, turn);
    const T limit = T(p.mu_roll) * f_n, size2 = T(p.k_roll * p.k_roll) * dot(trial, trial);
    const Vec3<T> kept = select(size2 > limit * limit, limit / sqrt(size2), T(1)) * trial;
    Couple<T> c{T(-p.k_roll) * radius * kept, T(0)};
    if constexpr (ledger) c.slip = T(0.5 * p.k_roll) * dot(memory.rolled + kept, trial - kept);
    memory.rolled = kept;
    return c;
  }
};

struct Twisting {
  static constexpr bool couples = true;

  struct Parameters {
    double k_twist = 0;   // N/m
    double mu_twist = 0;  // 1
    bool operator==(const Parameters&) const = default;
    static constexpr auto list() {
      return std::tuple{Named{"k_twist", &Parameters::k_twist}, Named{"mu_twist", &Parameters::mu_twist}};
    }
  };
  template <class T>
  struct Memory {
    T twisted{};  // m, theta about n
    static constexpr auto list() { return std::tuple{Named{"twisted", &Memory::twisted}}; }
  };
  static bool used(const Parameters& p) { return p.k_twist > 0 && p.mu_twist > 0; }
  static bool keeps(const Parameters& p) { return used(p); }
  static double stored(const Parameters& p, const Memory<double>& m) {  // J
    return 0.5 * p.k_twist * m.twisted * m.twisted;
  }

  template <bool ledger, class T, class Carried>
  MORAINE_HD static Couple<T> couple(const Parameters& p, const Geometry<T>& g, const T& radius, const T& f_n,
                                     const Vec3<T>& turn, const Carried&, Memory<T>& memory) {
    const T trial = memory.twisted + dot(turn, g.n);
    const T limit = T(p.mu_twist) * f_n, size2 = T(p.k_twist * p.k_twist) * trial * trial;
    const T kept = select(size2 > limit * limit, limit / sqrt(size2), T(1)) * trial;
    Couple<T> c{(T(-p.k_twist) * radius * kept) * g.n, T(0)};
    if constexpr (ledger) c.slip = T(0.5 * p.k_twist) * (memory.twisted + kept) * (trial - kept);
    memory.twisted = kept;
    return c;
  }
};

}  // namespace moraine::dem
