// One sphere that strikes a plane, or a sphere that is held, by Hertz and Mindlin's law: the differential
// equations themselves, integrated apart from the program at steps so small that they count as exact. The law
// is the program's, written another way: the tangential force is the variable here, not the spring.
//
//   overlap x, a = sqrt(R x), F = 4/3 E* a x + sqrt(5) zeta sqrt(m* 4/3 E* a) x', never below 0
//   Q' = 8 G* a v_c while a grows, and Q' = 8 G* a v_c + Q a'/a while it shrinks;  |Q| <= mu F
//   v_c = v.t - l w,  l = r - x/2 (eqs. 4 and 7 of the paper)
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace moraine::dem {

struct Impact {
  double r, mass;         // m, kg, of the sphere
  double r_j = 0;         // m, of the sphere that is held; 0: a plane
  double e_star, g_star;  // Pa
  double zeta = 0, mu = 0;
  double v_n, v_t = 0, spin = 0;  // m/s along the normal, across, rad/s; before

  double radius() const { return r_j > 0 ? r * r_j / (r + r_j) : r; }

  // Hertz (1882), without damping: m* v^2/2 = 8/15 E* sqrt(R) x^(5/2). m; N; s.
  double greatest_overlap() const {
    return std::pow(15 * mass * v_n * v_n / (16 * e_star * std::sqrt(radius())), 0.4);
  }
  double greatest_force() const {
    return 4.0 / 3 * e_star * std::sqrt(radius()) * std::pow(greatest_overlap(), 1.5);
  }
  double duration() const {  // 2 x/v times the integral of (1 - s^(5/2))^(-1/2) from 0 to 1
    return 0.8 * std::sqrt(std::numbers::pi) * std::tgamma(0.4) / std::tgamma(0.9) * greatest_overlap() / v_n;
  }
};

struct Rebound {
  double v_n, v_t, spin;  // m/s along and across the normal as it was before; rad/s
};

inline Rebound exact(const Impact& c, int steps = 40000) {
  // Place of the centre from the plane or the held centre: x across, z along the normal; velocities; spin; Q.
  using Y = std::array<double, 6>;
  struct Contact {
    double n_x, n_z, overlap, closing, normal, k_t;  // N, N/m
  };
  const auto contact = [&c](const Y& y) {
    const double far = c.r_j > 0 ? std::hypot(y[0], y[1]) : y[1];
    const double n_x = c.r_j > 0 ? y[0] / far : 0, n_z = c.r_j > 0 ? y[1] / far : 1;
    const double overlap = std::max(0.0, c.r + c.r_j - far), a = std::sqrt(c.radius() * overlap);
    const double closing = -(y[2] * n_x + y[3] * n_z), k = 4.0 / 3 * c.e_star * a;
    const double f = k * overlap + std::sqrt(5.0) * c.zeta * std::sqrt(c.mass * k) * closing;
    return Contact{n_x, n_z, overlap, closing, std::max(0.0, f), 8 * c.g_star * a};
  };
  const auto slope = [&](const Y& y) {
    const Contact at = contact(y);
    const double lever = c.r - 0.5 * at.overlap, f = at.normal, q = std::clamp(y[5], -c.mu * f, c.mu * f);
    const double v_c = y[2] * at.n_z - y[3] * at.n_x - lever * y[4];
    const double thins = at.closing < 0 && at.overlap > 0 ? 0.5 * at.closing / at.overlap * q : 0;
    return Y{y[2],
             y[3],
             (f * at.n_x + q * at.n_z) / c.mass,
             (f * at.n_z - q * at.n_x) / c.mass,
             -lever * q / (0.4 * c.mass * c.r * c.r),
             -at.k_t * v_c + thins};
  };
  const auto add = [](const Y& y, double h, const Y& dy) {
    Y sum = y;
    for (int k = 0; k < 6; ++k) sum[k] += h * dy[k];
    return sum;
  };
  Y y{0, c.r + c.r_j, c.v_t, -c.v_n, c.spin, 0};
  const double h = c.duration() / steps;
  for (int n = 0; n < 10 * steps; ++n) {
    const Y k1 = slope(y), k2 = slope(add(y, h / 2, k1)), k3 = slope(add(y, h / 2, k2)),
            k4 = slope(add(y, h, k3));
    for (int k = 0; k < 6; ++k) y[k] += h / 6 * (k1[k] + 2 * k2[k] + 2 * k3[k] + k4[k]);
    const Contact at = contact(y);
    y[5] = std::clamp(y[5], -c.mu * at.normal, c.mu * at.normal);
    if (at.overlap == 0) break;
  }
  return {y[3], y[2], y[4]};
}

}  // namespace moraine::dem
