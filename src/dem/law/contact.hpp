// The contact law: one function for grain against grain and grain against a plane, on the CPU and on the GPU.
// Damsgaard et al. (2013), eqs. 4-8; every quantity acts on grain i and points from j to i.
//
//   f_n = -k_n delta_n - gamma_n v.n        (eq. 6; never pulls)
//   v_c = v_ij + l_i n x omega_i + l_j n x omega_j,  l = r + delta_n/2   (eq. 7 with the lever arm of eq. 4)
//   delta_t turns with the contact, then grows by the tangential part of v_c dt
//   f_t = -k_t delta_t - gamma_t v_t,  |f_t| <= mu f_n        (eqs. 6 and 8)
//   torque on i: l_i f_t x n,  on j: l_j f_t x n              (eq. 4)
//
// This is the linear law; Hertz and Mindlin's (hertz.hpp) has another f_n, and a k_t that changes. Parts
// (spring, friction, damping, and more) are types of their own; which of them are compiled together is said
// in laws.hpp.
//
// Time levels: n and delta_n belong to step n, the velocities to n - 1/2, so v_c dt is the displacement
// between two steps (second order). Only the viscous parts need a velocity at step n (viscosity.hpp).
#pragma once
#include <type_traits>

#include "dem/law/friction.hpp"
#include "dem/law/geometry.hpp"
#include "dem/law/hertz.hpp"
#include "dem/law/linear_spring.hpp"
#include "dem/law/restitution.hpp"
#include "dem/law/rolling.hpp"
#include "dem/law/viscosity.hpp"

namespace moraine::dem {

// Whether what a contact dissipates is worked out.
enum class Account { none, energy };

// A law of such parts. More: what else acts while grains touch, each with
//   used(p)                whether these parameters ask for it
//   couples                false: a force along the normal, which limits do not see:
//     normal(p, g, closing)  N, positive pushes apart; closing: m, how much closer they came in this step
//     stored(p, g, closing)  J
//                          true: a couple:
//     couple(...)            see rolling.hpp
//     stored(p, memory)      J
template <class Normal_, class Friction_, class Damping_, class... More>
struct Law {
  using Normal = Normal_;
  using Friction = Friction_;
  using Damping = Damping_;
  static constexpr bool rubs = Friction::rubs, softens = Friction::softens, damps = Damping::damps;
  static constexpr bool linear = Normal::linear, hertz = Normal::hertz, restitutes = Damping::restitutes;
  static constexpr bool couples = (false || ... || More::couples);
  static constexpr bool has_more_normal = (false || ... || !More::couples);
  static constexpr bool needs_radius = Normal::needs_radius || couples;

  template <class P, class T>
  MORAINE_HD static T more_normal(const P& p, const Geometry<T>& g, const T& closing) {
    T sum(0);
    const auto add = [&]<class Part>(Part*) {
      if constexpr (!Part::couples) sum = sum + Part::normal(p, g, closing);
    };
    (add(static_cast<More*>(nullptr)), ...);
    return sum;
  }
  // use.operator()<Part>() for each part that makes a couple.
  template <class Use>
  MORAINE_HD static void for_each_couple(Use&& use) {
    const auto one = [&]<class Part>(Part*) {
      if constexpr (Part::couples) use.template operator()<Part>();
    };
    (one(static_cast<More*>(nullptr)), ...);
  }
  // J, along the normal.
  template <class P>
  static double stored_normal(const P& p, const Geometry<double>& g, double closing) {
    double sum = Normal::stored(p, g, Normal::at(p, g, reduced_radius(g)));
    const auto add = [&]<class Part>(Part*) {
      if constexpr (!Part::couples) sum += Part::stored(p, g, closing);
    };
    (add(static_cast<More*>(nullptr)), ...);
    return sum;
  }
  // J, of springs along the contact plane and of couples.
  template <class P, class Spring>
  static double stored_tangential(const P& p, const Geometry<double>& g, const Spring& spring) {
    double sum = Friction::stored(Normal::k_t(p, Normal::at(p, g, reduced_radius(g))), spring.delta_t);
    for_each_couple([&]<class Part>() { sum += Part::stored(p, spring); });
    return sum;
  }
  template <class Part>
  static constexpr bool has = (std::is_same_v<Part, More> || ...);
  // Whether a part makes a couple.
  template <class Part>
  static constexpr bool is_couple = [] {
    if constexpr (has<Part>) return Part::couples;
    return false;
  }();
  // Whether it reads and writes what this part remembers.
  template <class Part, Account account>
  static constexpr bool remembers = std::is_same_v<Part, Coulomb>            ? rubs
                                    : std::is_same_v<Part, Hertz>            ? hertz&& rubs
                                    : std::is_same_v<Part, SofteningCoulomb> ? softens
                                    : std::is_same_v<Part, Viscosity>        ? damps
                                    : std::is_same_v<Part, ViscousWork> ? damps&& account == Account::energy
                                                                        : has<Part>;
};

template <class T>
struct Action {
  Vec3<T> f;        // N, on i; j gets -f
  Vec3<T> f_x_n;    // N, f_t x n: times l gives the torque, on i and j alike
  T slip, viscous;  // J, dissipated by sliding and by damping in this step (with a ledger only)
  Vec3<T> couple;   // N m, on i besides; j gets the opposite (laws that couple)

  MORAINE_HD Vec3<T> torque_on_i(const Geometry<T>& g) const { return axpy(g.l_i, f_x_n, couple); }
  MORAINE_HD Vec3<T> torque_on_j(const Geometry<T>& g) const { return axpy(g.l_j, f_x_n, -couple); }
};

// What a law works out once of where a pair stands, besides its geometry; empty where it needs nothing.
template <class L, class T>
struct Patch : std::conditional_t<L::needs_radius, Radius<T>, NoRadius<T>>, L::Normal::template At<T> {
  MORAINE_HD const typename L::Normal::template At<T>& at() const { return *this; }
};
template <class L, class P, class T>
MORAINE_HD Patch<L, T> patch(const P& p, const Geometry<T>& g) {
  using Size = std::conditional_t<L::needs_radius, Radius<T>, NoRadius<T>>;
  Size size;
  if constexpr (L::needs_radius) size = reduced_radius(g);
  if constexpr (L::Normal::needs_radius)
    return {size, L::Normal::at(p, g, size)};
  else
    return {size, L::Normal::at(p, g, NoRadius<T>{})};
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

// v_c of the step that led to g, m/s. Without friction spins are no matter.
template <class L, class T>
MORAINE_HD Vec3<T> contact_velocity(double dt, const Geometry<T>& g, const Motion<T>& before) {
  if constexpr (L::rubs)
    return slide(dt, g, before).v_c;
  else
    return before.v;
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

// The same where k_t changes (hertz.hpp): what the spring held before counts with q, the step's displacement
// with (1 + q)/2.
template <class T>
MORAINE_HD T share_held(double dt, const T& k_before, const T& k_t) {
  return dt == 0 ? T(1) : min(k_before / k_t, T(1));
}
template <class L, class P, class T, class Spring>
MORAINE_HD Vec3<T> trial_spring(const P& p, double dt, const Geometry<T>& g, const Patch<L, T>& patch,
                                const Slide<T>& s, const Spring& spring) {
  if constexpr (L::hertz) {
    const T q = share_held(dt, L::Normal::k_t(p, typename L::Normal::template At<T>{spring.a_before}),
                           L::Normal::k_t(p, patch.at()));
    return carry(dt, g, Slide<T>{s.n_mid, T(0.5) * (T(1) + q) * s.v_c, s.twist}, q * spring.delta_t);
  } else {
    return carry(dt, g, s, spring.delta_t);
  }
}

// v_c at the step, for damping; dt = 0: velocities belong to the step already.
template <class L, class T, class Spring>
MORAINE_HD Vec3<T> velocity_at_step(double dt, const Vec3<T>& v_c, const Spring& spring) {
  if constexpr (L::damps)
    return dt == 0 ? v_c : L::Damping::foreseen(v_c, spring);
  else
    return v_c;
}

// Normal force, N; never pulls. v: the contact's velocity at the step, m/s.
template <class L, class P, class T>
MORAINE_HD T normal_force(const P& p, const Geometry<T>& g, const Patch<L, T>& patch, const Vec3<T>& v) {
  T f_n = L::Normal::force(p, g, patch.at());
  if constexpr (L::damps)
    f_n = L::Damping::normal(L::Damping::template gamma_n<typename L::Normal>(p, g, patch.at()), g, v, f_n);
  return select(g.delta_n < T(0), f_n, T(0));
}

// The tangential force before Coulomb's limit, N, where damping adds to the spring.
template <class L, class P, class T>
MORAINE_HD Vec3<T> damped_tangential(const P& p, const Geometry<T>& g, const T& k_t, const Vec3<T>& v,
                                     const Vec3<T>& delta_t) {
  return L::Damping::tangential(p, g, v, -k_t * delta_t);
}

// How firmly the contact holds: the normal force and the share of the tangential force that Coulomb's limit
// leaves, 1 where it does not slip. `delta_t` is what carry gives.
template <class T>
struct Grip {
  T f_n, share;
};

template <class L, class P, class T, class Spring>
MORAINE_HD Grip<T> grip(const P& p, const Geometry<T>& g, const Patch<L, T>& patch, const Vec3<T>& v,
                        const Vec3<T>& delta_t, const Spring& spring) {
  const T f_n = normal_force<L>(p, g, patch, v);
  if constexpr (!L::rubs) {
    return {f_n, T(0)};
  } else {
    const T limit = L::Friction::limit(p, f_n, spring), k_t = L::Normal::k_t(p, patch.at());
    T size2;  // |f_t|^2
    if constexpr (L::damps) {
      const Vec3<T> f_t = damped_tangential<L>(p, g, k_t, v, delta_t);
      size2 = dot(f_t, f_t);
    } else {
      size2 = k_t * k_t * dot(delta_t, delta_t);
    }
    return {f_n, select(size2 > limit * limit, T(p.mu_d) * f_n / sqrt(size2), T(1))};
  }
}

// J that friction takes in a step; `trial` is what trial_spring() gives, `kept` what Coulomb's limit leaves
// of it. Mean force times plastic displacement; a contact that opens gives up what its spring still held.
// Where k_t changes: work of the mean force less what is stored then, with the displacement (trial - q old)
// 2/(1 + q).
template <class L, class P, class T, class Spring>
MORAINE_HD T taken_by_friction(const P& p, double dt, const Patch<L, T>& patch, const Vec3<T>& trial,
                               const Vec3<T>& kept, const Spring& spring) {
  const T k_t = L::Normal::k_t(p, patch.at());
  const Vec3<T>& old = spring.delta_t;
  if constexpr (L::hertz) {
    const T k_before = dt == 0 ? k_t : L::Normal::k_t(p, typename L::Normal::template At<T>{spring.a_before});
    const T q = share_held(dt, k_before, k_t), inverse = T(1) / (T(1) + q);
    const T by_change = fma(T(1) - q, fma(k_t, dot(trial, trial), k_before * dot(old, old)),
                            T(2) * (k_before - q * k_t) * dot(old, trial));
    const Vec3<T> held = kept + inverse * (T(2) * q * old - (T(1) - q) * trial);
    return T(0.5) * fma(k_t, dot(held, trial - kept), inverse * by_change);
  } else {
    return T(0.5) * k_t * dot(old + kept, trial - kept);
  }
}

// How a step has moved the pair, for couples.
template <class T>
struct Moved {
  const Motion<T>& before;
  const Slide<T>& slide;
};

// The couples of rolling and twisting, with what they take; their memory is left at what it carries.
template <class L, Account account, class P, class T, class Spring>
MORAINE_HD Couple<T> couples_of(const P& p, double dt, const Geometry<T>& g, const Patch<L, T>& patch,
                                const Moved<T>& moved, const T& f_n, Spring& spring) {
  const T zero(0);
  Couple<T> sum{{zero, zero, zero}, zero};
  if constexpr (L::couples) {
    const Vec3<T> turn = (T(dt) * patch.radius) * (moved.before.omega_i - moved.before.omega_j);
    const auto carried = [&](const Vec3<T>& old, const Vec3<T>& grown) {
      return carry(1.0, g, Slide<T>{moved.slide.n_mid, grown, moved.slide.twist}, old);
    };
    L::for_each_couple([&]<class Part>() {
      typename Part::template Memory<T>& memory = spring;
      const Couple<T> c =
          Part::template couple<account == Account::energy>(p, g, patch.radius, f_n, turn, carried, memory);
      sum.on_i += c.on_i;
      if constexpr (account == Account::energy) sum.slip = sum.slip + c.slip;
    });
  }
  return sum;
}

// The forces; the spring is left at what it carries. dt = 0: no step was taken, so what slipped still slips.
// v_c: of the step that led here, v: at its end.
template <class L, Account account, class P, class T, class Spring>
MORAINE_HD Action<T> act(const P& p, double dt, const Geometry<T>& g, const Patch<L, T>& patch,
                         const Vec3<T>& v_c, const Vec3<T>& v, const Vec3<T>& delta_t, const Grip<T>& grip,
                         const Couple<T>& couple, Spring& spring) {
  constexpr bool ledger = account == Account::energy;
  const T zero(0);
  const Vec3<T> none{zero, zero, zero};
  Action<T> a{none, none, zero, zero, couple.on_i};
  const auto touching = g.delta_n < zero;
  Vec3<T> f_viscous = none;
  if constexpr (L::damps && ledger) f_viscous = L::Normal::rest(p, g, patch.at(), grip.f_n) * g.n;
  T f_n = grip.f_n;
  if constexpr (L::has_more_normal)
    f_n = f_n + select(touching, L::more_normal(p, g, T(-dt) * dot(v_c, g.n)), zero);
  if constexpr (!L::rubs) {
    a.f = f_n * g.n;
  } else {
    const T k_t = L::Normal::k_t(p, patch.at());
    Vec3<T> f_t, kept;
    if constexpr (!L::damps) {
      kept = grip.share * delta_t;
      if constexpr (L::hertz) kept = select(touching, kept, none);  // k_t is 0 there, too
      f_t = -k_t * kept;
    } else {  // f_t is not the spring's alone
      f_t = grip.share * damped_tangential<L>(p, g, k_t, v, delta_t);
      const T carried = k_t * sqrt(dot(delta_t, delta_t)), dynamic = T(p.mu_d) * grip.f_n;
      kept = select((grip.share < T(1)) & (carried > dynamic), dynamic / carried, T(1)) * delta_t;
      kept = select(touching, kept, none);
    }
    a.f = axpy(f_n, g.n, f_t);
    a.f_x_n = cross(f_t, g.n);
    if constexpr (ledger) {
      a.slip = taken_by_friction<L>(p, dt, patch, delta_t, kept, spring);
      if constexpr (L::damps) f_viscous += axpy(k_t, kept, f_t);
    }
    spring.delta_t = kept;
    if constexpr (L::hertz) spring.a_before = patch.a;
    if constexpr (L::couples && ledger) a.slip = a.slip + couple.slip;
    if constexpr (L::softens) {
      const T slips = select((grip.share < T(1)) & touching, T(1), zero);
      spring.slipping = dt == 0 ? max(slips, spring.slipping) : slips;
    }
  }
  if constexpr (L::damps) {
    spring.v_before = dt == 0 ? none : select(touching, v_c, none);
    if constexpr (ledger) {
      // A law that damps where these parameters do not leaves what rounding does.
      f_viscous = L::Damping::used(p) ? select(touching, f_viscous, none) : none;
      a.viscous = T(-0.5 * dt) * dot(spring.f_viscous + f_viscous, v_c);
      spring.f_viscous = f_viscous;
    }
  }
  return a;
}

// The force of a contact that remembers what damping did at this very step (ViscousWork).
template <class L, class P, class T, class Spring>
MORAINE_HD Vec3<T> remembered_force(const P& p, const Geometry<T>& g, const Spring& spring) {
  const Patch<L, T> at = patch<L>(p, g);
  const T f_n = L::Normal::force(p, g, at.at()) + L::more_normal(p, g, T(0));
  return axpy(f_n, g.n, axpy(-L::Normal::k_t(p, at.at()), spring.delta_t, spring.f_viscous));
}

// The whole law. dt = 0 evaluates the forces: the tangential spring stays, and what dampers remember begins.
template <class L, Account account, class P, class T, class Spring>
MORAINE_HD Action<T> contact_law(const P& p, double dt, const Geometry<T>& g, const Motion<T>& before,
                                 Spring& spring) {
  const Patch<L, T> at = patch<L>(p, g);
  Vec3<T> delta_t{}, v_c = before.v;
  Slide<T> s{};
  if constexpr (L::rubs) {
    s = slide(dt, g, before);
    delta_t = trial_spring<L>(p, dt, g, at, s, spring), v_c = s.v_c;
  }
  const Vec3<T> v = velocity_at_step<L>(dt, v_c, spring);
  const Grip<T> held = grip<L>(p, g, at, v, delta_t, spring);
  const Couple<T> couple = couples_of<L, account>(p, dt, g, at, Moved<T>{before, s}, held.f_n, spring);
  return act<L, account>(p, dt, g, at, v_c, v, delta_t, held, couple, spring);
}

}  // namespace moraine::dem
