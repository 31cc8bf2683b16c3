// The contact law: one function for grain against grain and grain against wall, on the CPU and on the GPU.
// Damsgaard et al. (2013), eqs. 4-8; every quantity acts on grain i and points from j to i.
//
//   f_n = -k_n delta_n - gamma_n v.n        (eq. 6; never pulls)
//   v_c = v_ij + l_i n x omega_i + l_j n x omega_j,  l = r + delta_n/2   (eq. 7 with the lever arm of eq. 4)
//   delta_t turns with the contact, then grows by the tangential part of v_c dt
//   f_t = -k_t delta_t - gamma_t v_t,  |f_t| <= mu f_n        (eqs. 6 and 8)
//   torque on i: -l_i n x f_t,  on j: -l_j n x f_t            (eq. 4)
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
  bool viscous = false;    // gamma_n or gamma_t, on grains or walls
  bool softening = false;  // mu_d < mu_s
  bool ledger = true;      // dissipated energy
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
  Vec3<T> n_x_f;                     // N, n x f_t: times -l gives the torque, on i and j alike
  T slip;                            // J, dissipated by sliding in this step
  Vec3<T> f_viscous, n_x_f_viscous;  // the part of both that damping contributes (with a ledger only)
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

// Where a step puts a contact's spring if it does not slip.
template <class T>
struct Trial {
  Vec3<T> turned;   // m, the old spring, turned with the pair; exactly zero if it was
  Vec3<T> delta_t;  // m, that plus the tangential displacement in the step
};

template <class T>
MORAINE_HD Trial<T> stretch(double dt, const Geometry<T>& g, const Motion<T>& before, const Vec3<T>& old) {
  // The contact's displacement over the step, with normal and lever arms as they were in the middle of it:
  // taken at its end they would make the work of the spring first order in dt.
  const T v_n = dot(before.v, g.n);
  const T half_turn = T(0.5 * dt) * g.curvature;
  const Vec3<T> n_mid = less(g.n, half_turn, less(before.v, v_n, g.n));
  const T shortening = T(0.25 * dt) * v_n;
  const Vec3<T> spin = axpy(g.l_i - shortening, before.omega_i, (g.l_j - shortening) * before.omega_j);
  const Vec3<T> v_c = before.v + cross(n_mid, spin);
  const Vec3<T> step = T(dt) * less(v_c, dot(v_c, n_mid), n_mid);

  // The old spring turns with the pair: about n by the mean spin of both, then from the old tangent plane
  // into the new one. Both keep its length to fourth order in the angle, so a contact that is carried round
  // for long loses nothing.
  const T twist = T(0.5 * dt) * dot(g.n, before.omega_i + before.omega_j);
  const Vec3<T> turned = axpy(twist, cross(g.n, old), axpy(T(-0.5) * twist * twist, old, old));
  const Vec3<T> sum = turned + axpy(T(0.5) * twist, cross(g.n, step), step);
  return {turned, less(sum, dot(g.n, sum), n_mid)};
}

// Normal force, and the tangential one cut to Coulomb's limit; the spring is left at what it carries.
template <Features F, class T>
MORAINE_HD Action<T> respond(const ContactParameters& p, const Geometry<T>& g, const Motion<T>& now,
                             const Trial<T>& trial, Spring<T>& spring) {
  const T zero(0);
  const auto touching = g.delta_n < zero;
  const T f_elastic = T(-p.k_n) * g.delta_n;
  T f_n = f_elastic;
  if constexpr (F.viscous) f_n = max(fma(T(-p.gamma_n), dot(now.v, g.n), f_n), zero);
  f_n = select(touching, f_n, zero);

  const Vec3<T> none{zero, zero, zero};
  Action<T> a{f_n * g.n, none, zero, none, none};
  if constexpr (F.viscous && F.ledger) a.f_viscous = select(touching, f_n - f_elastic, zero) * g.n;
  if constexpr (!F.friction) return a;

  Vec3<T> f_t = T(-p.k_t) * trial.delta_t;
  if constexpr (F.viscous) {
    const Vec3<T> c = now.v + cross(g.n, axpy(g.l_i, now.omega_i, g.l_j * now.omega_j));
    f_t = axpy(T(-p.gamma_t), less(c, dot(c, g.n), g.n), f_t);
  }
  T mu(p.mu_s);
  if constexpr (F.softening) mu = select(spring.slipping > zero, T(p.mu_d), mu);
  const T limit = mu * f_n;
  const T size2 = dot(f_t, f_t);
  const auto slips = size2 > limit * limit;
  const T cut = select(slips, T(p.mu_d) * f_n / sqrt(size2), T(1));
  f_t = cut * f_t;

  Vec3<T> kept = cut * trial.delta_t;
  if constexpr (F.viscous) {  // here f_t is not the spring's alone
    const T carried = T(p.k_t) * sqrt(dot(trial.delta_t, trial.delta_t));
    const T dynamic = T(p.mu_d) * f_n;
    kept = select(slips & (carried > dynamic), dynamic / carried, T(1)) * trial.delta_t;
    kept = {select(touching, kept.x, zero), select(touching, kept.y, zero), select(touching, kept.z, zero)};
  }
  spring.delta_t = kept;
  if constexpr (F.softening) spring.slipping = select(slips & touching, T(1), zero);

  a.f += f_t;
  a.n_x_f = cross(g.n, f_t);
  if constexpr (F.ledger) {
    // Mean force times plastic displacement; a contact that opens gives up what its spring still held.
    a.slip = T(0.5 * p.k_t) * dot(trial.turned + kept, trial.delta_t - kept);
    if constexpr (F.viscous) {
      const Vec3<T> f_t_viscous = axpy(T(p.k_t), kept, f_t);
      a.f_viscous += f_t_viscous;
      a.n_x_f_viscous = cross(g.n, f_t_viscous);
    }
  }
  return a;
}

// The whole law. dt = 0 evaluates the forces and leaves the spring as it is.
template <Features F, class T>
MORAINE_HD Action<T> contact_law(const ContactParameters& p, double dt, const Geometry<T>& g,
                                 const Motion<T>& before, const Motion<T>& now, Spring<T>& spring) {
  Trial<T> trial{};
  if constexpr (F.friction) trial = stretch(dt, g, before, spring.delta_t);
  return respond<F>(p, g, now, trial, spring);
}

}  // namespace moraine::dem
