// The contact law: one function for grain against grain and grain against wall, on the CPU and on the GPU.
// Damsgaard et al. (2013), eqs. 4-8; every quantity acts on grain i and points from j to i.
//
//   f_n = -k_n delta_n - gamma_n v.n        (eq. 6; never pulls)
//   v_c = v_ij + l_i n x omega_i + l_j n x omega_j,  l = r + delta_n/2   (eq. 7 with the lever arm of eq. 4)
//   delta_t turns with the contact, then grows by the tangential part of v_c dt
//   f_t = -k_t delta_t - gamma_t v_t,  |f_t| <= mu f_n        (eqs. 6 and 8)
//   torque on i: l_i f_t x n,  on j: l_j f_t x n              (eq. 4)
//
// Time levels: n and delta_n belong to step n, the velocities to n - 1/2, so v_c dt is the displacement
// between two steps (second order). Only the viscous parts need velocities at step n; they come as a second
// Motion.
#pragma once
#include "dem/scene.hpp"
#include "dem/vec3.hpp"

namespace moraine::dem {

// What a scene uses; the rest is not compiled into its loop.
struct Features {
  bool friction = true;    // tangential springs and torques
  bool viscous = false;    // gamma_n or gamma_t between grains
  bool softening = false;  // mu_d < mu_s
  bool ledger = true;      // dissipated energy
  bool damped = viscous;   // gamma_n or gamma_t between grains or at walls
  bool water = false;      // pore water pushes the grains
};

// Where two bodies stand to one another.
template <class T>
struct Geometry {
  Vec3<T> n;    // unit normal, from j to i
  T delta_n;    // m; < 0 in contact
  T l_i, l_j;   // m, lever arms; a wall has l_j = 0
  T curvature;  // 1/m, 1/|x_ij|: how fast n turns with v_ij; a wall has 0
};

// How they move.
template <class T>
struct Motion {
  Vec3<T> v;                 // m/s, v_i - v_j
  Vec3<T> omega_i, omega_j;  // rad/s
};

// What a contact remembers.
template <class T>
struct Spring {
  Vec3<T> delta_t;  // m
  T slipping;       // 1 after a step that slipped, else 0 (softening only)
};

template <class T>
struct Action {
  Vec3<T> f;                         // N, on i; j gets -f
  Vec3<T> f_x_n;                     // N, f_t x n: times l gives the torque, on i and j alike
  T slip;                            // J, dissipated by sliding in this step (with a ledger only)
  Vec3<T> f_viscous, f_x_n_viscous;  // the part of both that damping contributes (with a ledger only)
};

template <class T>
MORAINE_HD Geometry<T> between_grains(const Vec3<T>& x_ij, const T& r_sum, const T& r_difference) {
  const T distance = sqrt(dot(x_ij, x_ij));
  const T inverse = T(1) / distance;
  return {inverse * x_ij, distance - r_sum, T(0.5) * (distance + r_difference),
          T(0.5) * (distance - r_difference), inverse};
}

// A horizontal wall: facing = 1 for the floor (below the grain), -1 for the top wall.
MORAINE_HD Geometry<double> at_wall(double z, double r, double wall_z, double facing) {
  const double delta_n = facing * (z - wall_z) - r;
  return {{0, 0, facing}, delta_n, r + 0.5 * delta_n, 0, 0};
}

// How a contact moves in a step, with normal and lever arms as they were in the middle of it: taken at its
// end they would make the work of the spring first order in dt.
template <class T>
struct Slide {
  Vec3<T> n_mid;
  Vec3<T> v_c;  // m/s, with a part along n_mid that carry() takes out
  T twist;      // rad, about n: the mean spin of both, times dt
};

template <class T>
MORAINE_HD Slide<T> slide(double dt, const Geometry<T>& g, const Motion<T>& before) {
  const T v_n = dot(before.v, g.n);
  const T half_turn = T(0.5 * dt) * g.curvature;
  const Vec3<T> n_mid = less(g.n, half_turn, less(before.v, v_n, g.n));
  const T shortening = T(0.25 * dt) * v_n;
  const Vec3<T> spin = axpy(g.l_i - shortening, before.omega_i, (g.l_j - shortening) * before.omega_j);
  return {n_mid, cross_plus(n_mid, spin, before.v), T(0.5 * dt) * dot(g.n, before.omega_i + before.omega_j)};
}

// Where a step puts a contact's spring if it does not slip. The old spring turns with the pair: about n, then
// from the old tangent plane into the new one. Both keep its length to fourth order in the angle, so a
// contact that is carried round for long loses nothing.
template <class T>
MORAINE_HD Vec3<T> carry(double dt, const Geometry<T>& g, const Slide<T>& s, const Vec3<T>& old) {
  const Vec3<T> mean = axpy(T(0.5 * dt), s.v_c, old);
  const Vec3<T> turned = cross_plus(s.twist * g.n, mean, less(old, T(0.5) * s.twist * s.twist, old));
  const Vec3<T> sum = axpy(T(dt), s.v_c, turned);
  return less(sum, dot(g.n, sum), s.n_mid);
}

// Normal force, N; never pulls.
template <Features F, class T>
MORAINE_HD T normal_force(const ContactParameters& p, const Geometry<T>& g, const Motion<T>& now) {
  T f_n = T(-p.k_n) * g.delta_n;
  if constexpr (F.viscous) f_n = max(fma(T(-p.gamma_n), dot(now.v, g.n), f_n), T(0));
  return select(g.delta_n < T(0), f_n, T(0));
}

// The tangential force before Coulomb's limit, N, where damping adds to the spring.
template <class T>
MORAINE_HD Vec3<T> damped_tangential(const ContactParameters& p, const Geometry<T>& g, const Motion<T>& now,
                                     const Vec3<T>& delta_t) {
  const Vec3<T> c = cross_plus(g.n, axpy(g.l_i, now.omega_i, g.l_j * now.omega_j), now.v);
  return axpy(T(-p.gamma_t), less(c, dot(c, g.n), g.n), T(-p.k_t) * delta_t);
}

// How firmly the contact holds: the normal force and the share of the tangential force that Coulomb's limit
// leaves, 1 where it does not slip. `delta_t` is what carry gives.
template <class T>
struct Grip {
  T f_n, share;
};

template <Features F, class T>
MORAINE_HD Grip<T> grip(const ContactParameters& p, const Geometry<T>& g, const Motion<T>& now,
                        const Vec3<T>& delta_t, const T& slipping) {
  const T f_n = normal_force<F>(p, g, now);
  if constexpr (!F.friction) return {f_n, T(0)};
  T mu(p.mu_s);
  if constexpr (F.softening) mu = select(slipping > T(0), T(p.mu_d), mu);
  const T limit = mu * f_n;
  T size2;  // |f_t|^2
  if constexpr (F.viscous) {
    const Vec3<T> f_t = damped_tangential(p, g, now, delta_t);
    size2 = dot(f_t, f_t);
  } else {
    size2 = T(p.k_t * p.k_t) * dot(delta_t, delta_t);
  }
  return {f_n, select(size2 > limit * limit, T(p.mu_d) * f_n / sqrt(size2), T(1))};
}

// The forces; the spring is left at what it carries. dt = 0: no step was taken, so what slipped still slips.
template <Features F, class T>
MORAINE_HD Action<T> act(const ContactParameters& p, double dt, const Geometry<T>& g, const Motion<T>& now,
                         const Vec3<T>& delta_t, const Grip<T>& grip, Spring<T>& spring) {
  const T zero(0), f_n = grip.f_n;
  const Vec3<T> none{zero, zero, zero};
  Action<T> a{none, none, zero, none, none};
  const auto touching = g.delta_n < zero;
  if constexpr (F.viscous && F.ledger)
    a.f_viscous = select(touching, fma(T(p.k_n), g.delta_n, f_n), zero) * g.n;
  if constexpr (!F.friction) {
    a.f = f_n * g.n;
    return a;
  }

  Vec3<T> f_t, kept;
  if constexpr (!F.viscous) {
    kept = grip.share * delta_t;
    f_t = T(-p.k_t) * kept;
  } else {  // f_t is not the spring's alone
    f_t = grip.share * damped_tangential(p, g, now, delta_t);
    const T carried = T(p.k_t) * sqrt(dot(delta_t, delta_t)), dynamic = T(p.mu_d) * f_n;
    kept = select((grip.share < T(1)) & (carried > dynamic), dynamic / carried, T(1)) * delta_t;
    kept = select(touching, kept, none);
  }
  a.f = axpy(f_n, g.n, f_t);
  a.f_x_n = cross(f_t, g.n);
  if constexpr (F.ledger) {
    // Mean force times plastic displacement; a contact that opens gives up what its spring still held.
    a.slip = T(0.5 * p.k_t) * dot(spring.delta_t + kept, delta_t - kept);
    if constexpr (F.viscous) {
      const Vec3<T> f_t_viscous = axpy(T(p.k_t), kept, f_t);
      a.f_viscous += f_t_viscous;
      a.f_x_n_viscous = cross(f_t_viscous, g.n);
    }
  }
  spring.delta_t = kept;
  if constexpr (F.softening) {
    const T slips = select((grip.share < T(1)) & touching, T(1), zero);
    spring.slipping = dt == 0 ? max(slips, spring.slipping) : slips;
  }
  return a;
}

// The whole law. dt = 0 evaluates the forces and leaves the spring as it is.
template <Features F, class T>
MORAINE_HD Action<T> contact_law(const ContactParameters& p, double dt, const Geometry<T>& g,
                                 const Motion<T>& before, const Motion<T>& now, Spring<T>& spring) {
  Vec3<T> delta_t{};
  if constexpr (F.friction) delta_t = carry(dt, g, slide(dt, g, before), spring.delta_t);
  return act<F>(p, dt, g, now, delta_t, grip<F>(p, g, now, delta_t, spring.slipping), spring);
}

}  // namespace moraine::dem
