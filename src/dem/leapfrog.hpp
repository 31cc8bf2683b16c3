// Half-step leapfrog (Damsgaard et al. 2013, par. 23): one grain from step n to n + 1, its velocities from n
// - 1/2 to n + 1/2. Row: Pack on the CPU (its fourth lane stays untouched where dt holds a zero), Triple
// elsewhere; dt has it in all lanes.
#pragma once
#include "dem/grain.hpp"

namespace moraine::dem {

struct Triple : Vec3d {
  MORAINE_HD Triple(const Vec3d& a) : Vec3d(a) {}
  friend MORAINE_HD Triple fma(const Triple& s, const Triple& a, const Triple& b) {
    return axpy<double>(s.x, a, b);
  }
};

// How a grain answers to forces. Held grains (par. 26) do not move along held directions, do not spin, feel
// no gravity.
struct Mobility {
  double inverse_mass_xy, inverse_mass_z;  // 1/kg
  Vec3d gravity;                           // m/s2
  double inverse_inertia;                  // 1/(kg m2)

  MORAINE_HD Vec3d acceleration(const Vec3d& f) const {
    return {fma(f.x, inverse_mass_xy, gravity.x), fma(f.y, inverse_mass_xy, gravity.y),
            fma(f.z, inverse_mass_z, gravity.z)};
  }
  MORAINE_HD Vec3d spin_acceleration(const Vec3d& torque) const { return inverse_inertia * torque; }
};

// A grain of a layer answers along z at most.
MORAINE_HD Mobility mobility(const Scene& scene, double r, Material material, BodyId part_of) {
  const double m = scene.inertial_mass(r, material);
  if (part_of == BodyId::none)
    return {1 / m, 1 / m, scene.fall(r, material) * scene.down, 1 / (0.4 * m * r * r)};
  return {0, scene.is_rigid(part_of) ? 0 : 1 / m, {0, 0, 0}, 0};
}
// The same from a grain's row, which says by its inverse_inertia whether the grain is free.
MORAINE_HD Mobility mobility(const Scene& scene, const GrainRow& g, Material material) {
  const bool free = g.inverse_inertia > 0;
  return {free ? g.inverse_mass : 0, g.inverse_mass,
          free ? scene.fall(g.r, material) * scene.down : Vec3d{0, 0, 0}, g.inverse_inertia};
}

template <class Row>
struct Kinematics {
  Row x, v, omega, rotation;
};

template <class Row>
MORAINE_HD void leapfrog(Kinematics<Row>& k, const Row& acceleration, const Row& spin_acceleration,
                         const Row& dt) {
  k.v = fma(dt, acceleration, k.v);
  k.x = fma(dt, k.v, k.x);
  k.omega = fma(dt, spin_acceleration, k.omega);
  k.rotation = fma(dt, k.omega, k.rotation);
}

}  // namespace moraine::dem
