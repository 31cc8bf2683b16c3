// Where two bodies stand to one another and how they move: what every contact law starts from. All of it is
// seen from i; a plane takes the place of j.
#pragma once
#include "dem/vec3.hpp"

namespace moraine::dem {

template <class T>
struct Geometry {
  Vec3<T> n;    // unit normal, from j to i
  T delta_n;    // m; < 0 in contact
  T l_i, l_j;   // m, lever arms; a plane has l_j = 0
  T curvature;  // 1/m, 1/|x_ij|: how fast n turns with v_ij; a plane has 0
};

template <class T>
struct Motion {
  Vec3<T> v;                 // m/s, v_i - v_j
  Vec3<T> omega_i, omega_j;  // rad/s
};

// Both radii, m; that of j at a grain only.
template <class T>
MORAINE_HD T radius_i(const Geometry<T>& g) {
  return fma(T(-0.5), g.delta_n, g.l_i);
}
template <class T>
MORAINE_HD T radius_j(const Geometry<T>& g) {
  return fma(T(-0.5), g.delta_n, g.l_j);
}
// Whether j is a grain, not a plane.
template <class T>
MORAINE_HD auto at_grain(const Geometry<T>& g) {
  return g.curvature > T(0);
}

// R of laws that have it, m: 1/R = 1/r_i + 1/r_j, of a plane 1/r_i.
template <class T>
struct Radius {
  T radius;
};
template <class T>
struct NoRadius {};
template <class T>
MORAINE_HD Radius<T> reduced_radius(const Geometry<T>& g) {
  const T r_i = radius_i(g), r_j = radius_j(g);
  return {select(at_grain(g), r_i * r_j / (r_i + r_j), r_i)};
}

template <class T>
MORAINE_HD Geometry<T> between_grains(const Vec3<T>& x_ij, const T& r_sum, const T& r_difference) {
  const T distance = sqrt(dot(x_ij, x_ij));
  const T inverse = T(1) / distance;
  return {inverse * x_ij, distance - r_sum, T(0.5) * (distance + r_difference),
          T(0.5) * (distance - r_difference), inverse};
}

// How far a grain is from a plane at `place` along one axis, m; < 0 in contact. facing = 1: the grain belongs
// on the side of larger coordinates (a floor), -1: of smaller ones (a top wall).
MORAINE_HD double gap_to_plane(double x, double r, double place, double facing) {
  return facing * (x - place) - r;
}

MORAINE_HD Geometry<double> at_plane(const Vec3d& x, double r, int axis, double place, double facing) {
  const double delta_n = gap_to_plane(x[axis], r, place, facing);
  Geometry<double> g{{0, 0, 0}, delta_n, r + 0.5 * delta_n, 0, 0};
  g.n.set(axis, facing);
  return g;
}

}  // namespace moraine::dem
