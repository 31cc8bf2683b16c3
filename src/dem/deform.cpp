#include "dem/deform.hpp"

#include <cmath>

#include "dem/engine.hpp"
#include "dem/observe.hpp"
#include "dem/periodic_sides.hpp"
#include "dem/state_rows.hpp"

namespace moraine::dem {

namespace {

Vec3d times(const Vec3d& a, const Vec3d& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

}  // namespace

double box_volume(const Scene& scene) { return scene.box.x * scene.box.y * scene.box.z; }

double solid_volume(const State& s) {
  double volume = 0;
  for (const double r : s.r) volume += sphere_volume(r);
  return volume;
}

BoxStress box_stress(const Scene& scene, const State& s) {
  const Sides sides = Sides::of(scene);
  BoxStress out;
  double stiffness = 0;  // sum of k l^2, N m
  for (const ContactForce& c : contact_forces(scene, s)) {
    const Vec3d x_ij = nearest_image(sides, s.x[c.i] - s.x[c.j]);
    out.normal += times(c.f_n + c.f_t, x_ij);
    const Geometry<double> g = between_grains(x_ij, s.r[c.i] + s.r[c.j], s.r[c.i] - s.r[c.j]);
    stiffness += stiffness_of(scene.between(s.material_of(c.i), s.material_of(c.j)), g) * dot(x_ij, x_ij);
  }
  const double volume = box_volume(scene);
  out.normal = (1 / volume) * out.normal;
  out.stiffness = stiffness / (3 * volume);
  return out;
}

SpringEnergy spring_energy(const Scene& scene, const State& s) {
  const Sides sides = Sides::of(scene);
  SpringEnergy e;
  for (const Contact& c : s.contacts) {
    const ContactParameters& law = scene.between(s.material_of(c.i), s.material_of(c.j));
    const Vec3d x_ij = nearest_image(sides, s.x[c.i] - s.x[c.j]);
    const Geometry<double> g = between_grains(x_ij, s.r[c.i] + s.r[c.j], s.r[c.i] - s.r[c.j]);
    if (g.delta_n < 0) e.normal += GeneralLaw::stored_normal(law, g, 0);
    e.tangential += GeneralLaw::stored_tangential(law, g, c.spring);
  }
  return e;
}

double kinetic_energy(const Scene& scene, const State& s) {
  double sum = 0;
  for (Index i = 0; i < s.size(); ++i) {
    const double m = scene.inertial_mass(s.r[i], s.material_of(i)), inertia = 0.4 * m * s.r[i] * s.r[i];
    Vec3d v = s.v[i], omega = s.omega[i];
    if (s.staggered) {
      const Mobility mob = mobility(scene, s.r[i], s.material_of(i), s.part_of[i]);
      v = axpy(scene.dt, mob.acceleration(kick(scene, s, i)), v);
      omega = axpy(scene.dt, mob.spin_acceleration(s.torque[i]), omega);
    }
    sum += 0.5 * m * dot(s.v[i], v) + 0.5 * inertia * dot(s.omega[i], omega);
  }
  return sum;
}

void deform(Scene& scene, State& s, const Vec3d& factor) {
  synchronise(scene, s);
  const Sides sides = Sides::of(scene);
  const Vec3d strain = factor - Vec3d{1, 1, 1};
  for (Contact& c : s.contacts) {
    const Vec3d old = nearest_image(sides, s.x[c.i] - s.x[c.j]), moved = times(strain, old);
    const Geometry<double> g = between_grains(old + moved, s.r[c.i] + s.r[c.j], s.r[c.i] - s.r[c.j]);
    const Vec3d none{0, 0, 0};
    if (Coulomb::keeps(scene.between(s.material_of(c.i), s.material_of(c.j))))  // as in a step of 1 s
      c.spring.delta_t = carry(1.0, g, slide(1.0, g, Motion<double>{moved, none, none}), c.spring.delta_t);
  }
  scene.box = times(factor, scene.box);
  for (Index i = 0; i < s.size(); ++i)
    s.x[i] = times(factor, s.x[i]), s.x_start[i] = times(factor, s.x_start[i]);
}

}  // namespace moraine::dem
