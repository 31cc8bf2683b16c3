#include "dem/law/restitution.hpp"

#include <cmath>

#include "error.hpp"

namespace moraine::dem {

double restitution_of(double zeta) {
  const double d = 1 - zeta * zeta;
  if (std::abs(d) < 1e-12) return std::exp(-2);
  const double s = std::sqrt(std::abs(d));
  const double phase = d > 0 ? std::atan2(2 * zeta * s, 2 * zeta * zeta - 1)
                             : std::log((zeta + s) / (zeta - s));  // what the swing takes, times omega_0 s
  return std::exp(-zeta / s * phase);
}

double damping_ratio(double restitution) {
  constexpr double most = 3;
  if (!(restitution <= 1 && restitution >= restitution_of(most)))
    throw error("a coefficient of restitution of ", restitution, "; expected ", restitution_of(most),
                " to 1");
  double low = 0, high = most;
  while (high - low > 1e-15 * most) {
    const double middle = 0.5 * (low + high);
    (restitution_of(middle) > restitution ? low : high) = middle;
  }
  return restitution == 1 ? 0 : 0.5 * (low + high);
}

}  // namespace moraine::dem
