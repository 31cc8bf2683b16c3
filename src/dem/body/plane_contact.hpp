// What a plane does to a grain: the same contact law as between grains, with a body of infinite radius.
#pragma once
#include "dem/body/motion.hpp"
#include "dem/grain.hpp"
#include "dem/law/contact.hpp"

namespace moraine::dem {

struct PlaneAction {
  Vec3d f, torque;       // N, N m, on the grain
  double slip, viscous;  // J
};

template <class L, Account account>
MORAINE_HD PlaneAction plane_action(const Scene& scene, double dt, const Plane& plane, const GrainRow& grain,
                                    Spring<double>& spring, Material material = Material::grain) {
  const Geometry<double> g = plane.geometry(grain.x, grain.r);
  const Action<double> a = contact_law<L, account>(scene.between(material, plane.material), dt, g,
                                                   {grain.v - plane.v, grain.omega, {0, 0, 0}}, spring);
  if constexpr (L::couples) return {a.f, a.torque_on_i(g), a.slip, a.viscous};
  return {a.f, g.l_i * a.f_x_n, a.slip, a.viscous};
}

// A grain that is held in all directions is not tested against planes, nor against its like (Neighbours).
MORAINE_HD bool meets_planes(const Scene& scene, BodyId part_of) { return !scene.is_rigid(part_of); }

// A grain that is no longer finite, or on the wrong side of a plane.
MORAINE_HD bool is_lost(const BodyMotion& bodies, const GrainRow& g) {
  const double sum = dot(g.x, g.x) + dot(g.v, g.v) + dot(g.omega, g.omega);
  if (!(sum < 1e300)) return true;
  for (int k = 0; k < bodies.planes; ++k)
    if (bodies.plane[k].gap(g.x, g.r) < -2 * g.r) return true;
  return false;
}

}  // namespace moraine::dem
