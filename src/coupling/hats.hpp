// Hats about the points of a grid, and what makes weights of them reproduce affine motion.
#pragma once
#include <array>

#include "dem/grain.hpp"
#include "fluid/grid.hpp"

namespace moraine::coupling {

using dem::Index;

// The eight points around a place.
struct Stencil {
  std::array<Index, 8> point;  // the first names them all
  std::array<double, 8> w;     // hats, later weights b in m2
  double xi[3][2];             // from the lower and the higher points of each axis, in cells

  dem::Vec3d from(int e) const { return {xi[0][e & 1], xi[1][(e >> 1) & 1], xi[2][e >> 2]}; }
};
// axis: of the faces, or -1 for cell centres.
Stencil stencil(const fluid::Grid& grid, int axis, const dem::Vec3d& x);

// Moments of solid volume about a point, xi in cells.
struct Moments {
  double m0 = 0;
  dem::Vec3d m1{0, 0, 0};
  double m2[6] = {0, 0, 0, 0, 0, 0};  // xx, yy, zz, xy, xz, yz

  void add(double v, const dem::Vec3d& xi) {
    m0 += v;
    m1 += v * xi;
    m2[0] += v * xi.x * xi.x, m2[1] += v * xi.y * xi.y, m2[2] += v * xi.z * xi.z;
    m2[3] += v * xi.x * xi.y, m2[4] += v * xi.x * xi.z, m2[5] += v * xi.y * xi.z;
  }
  void add(double share, const Moments& m) {
    m0 += share * m.m0, m1 += share * m.m1;
    for (int k = 0; k < 6; ++k) m2[k] += share * m.m2[k];
  }
};

// a with M2 a = -M1, without the component `skip` (-1: none), shortened where grains are few: psi is the
// solid fraction, and at psi_min nothing is left.
dem::Vec3d affine_correction(const Moments& m, double psi, double psi_min, int skip);

}  // namespace moraine::coupling
