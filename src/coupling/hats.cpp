#include "coupling/hats.hpp"

#include <algorithm>
#include <cmath>

namespace moraine::coupling {

using dem::Vec3d;

namespace {

// Two neighbours on a line of points, the hat weight of the second, and the way from the first in cells.
struct Pair {
  int low, high;
  double t, xi;
};

// Points at whole numbers, 0 to `last`; on a periodic line 0 follows.
Pair between(double s, int last, bool periodic) {
  if (periodic) {
    const int n = last + 1;
    s -= n * std::floor(s / n);
    const int low = std::clamp(static_cast<int>(s), 0, last);
    return {low, low == last ? 0 : low + 1, s - low, s - low};
  }
  // Beyond the ends the last point's weight is one.
  if (last == 0) return {0, 0, 0, s};
  const int low = static_cast<int>(std::clamp(std::floor(s), 0.0, last - 1.0));
  return {low, low + 1, std::clamp(s - low, 0.0, 1.0), s - low};
}

}  // namespace

Stencil stencil(const fluid::Grid& g, int axis, const Vec3d& x) {
  Pair p[3];
  Index stride = 1, low[3], high[3];
  Stencil out;
  for (int a = 0; a < 3; ++a) {
    const int points = a == axis ? g.faces(a) : g.n[a];
    p[a] = between(x[a] / g.h(a) - (a == axis ? 0.0 : 0.5), points - 1, g.periodic[a]);
    low[a] = stride * p[a].low, high[a] = stride * p[a].high;
    stride *= points;
    out.xi[a][0] = p[a].xi, out.xi[a][1] = p[a].xi - 1;
  }
  for (int e = 0; e < 8; ++e) {
    const bool up[3] = {(e & 1) != 0, (e & 2) != 0, (e & 4) != 0};
    out.point[e] = (up[0] ? high[0] : low[0]) + (up[1] ? high[1] : low[1]) + (up[2] ? high[2] : low[2]);
    out.w[e] = (up[0] ? p[0].t : 1 - p[0].t) * (up[1] ? p[1].t : 1 - p[1].t) * (up[2] ? p[2].t : 1 - p[2].t);
  }
  return out;
}

Vec3d affine_correction(const Moments& m, double psi, double psi_min, int skip) {
  const double fade = std::clamp((psi - psi_min) / 0.1, 0.0, 1.0);
  if (fade == 0) return {0, 0, 0};
  double a[3][4] = {{m.m2[0], m.m2[3], m.m2[4], -m.m1.x},
                    {m.m2[3], m.m2[1], m.m2[5], -m.m1.y},
                    {m.m2[4], m.m2[5], m.m2[2], -m.m1.z}};
  for (int r = 0; r < 3; ++r) a[r][r] += 1e-3 * m.m0;  // of the 1/6 m0 of evenly spread grains
  if (skip >= 0) {
    for (int k = 0; k < 4; ++k) a[skip][k] = 0;
    for (auto& row : a) row[skip] = 0;
    a[skip][skip] = 1;
  }
  // Symmetric and positive: elimination needs no pivots.
  for (int c = 0; c < 3; ++c)
    for (int r = c + 1; r < 3; ++r) {
      const double f = a[r][c] / a[c][c];
      for (int k = c; k < 4; ++k) a[r][k] -= f * a[c][k];
    }
  Vec3d x;
  x.z = a[2][3] / a[2][2];
  x.y = (a[1][3] - a[1][2] * x.z) / a[1][1];
  x.x = (a[0][3] - a[0][1] * x.y - a[0][2] * x.z) / a[0][0];
  // Weights stay positive over most of the hat.
  const double steepest = std::max({std::abs(x.x), std::abs(x.y), std::abs(x.z)});
  return (fade * (steepest > 2 ? 2 / steepest : 1)) * x;
}

}  // namespace moraine::coupling
