// Periodic sides of the box: the nearest image of a distance. The search has the cells' own way across a side
// (neighbours.hpp).
#pragma once
#include "dem/scene.hpp"

namespace moraine::dem {

// Sides of the box for the minimum image: x - side * round(x * inverse); both zero along an open side.
struct Sides {
  Vec3d side, inverse;
  static Sides of(const Scene& s) {
    const auto along = [](bool periodic, double length) { return periodic ? length : 0.0; };
    const Vec3d side{along(s.periodic_x, s.box.x), along(s.periodic_y, s.box.y),
                     along(s.periodic_z, s.box.z)};
    const auto inverse = [](double length) { return length > 0 ? 1 / length : 0.0; };
    return {side, {inverse(side.x), inverse(side.y), inverse(side.z)}};
  }
};

template <class T>
MORAINE_HD Vec3<T> nearest_image(const Sides& s, const Vec3<T>& d) {
  return {fma(T(-s.side.x), round(d.x * T(s.inverse.x)), d.x),
          fma(T(-s.side.y), round(d.y * T(s.inverse.y)), d.y),
          fma(T(-s.side.z), round(d.z * T(s.inverse.z)), d.z)};
}

}  // namespace moraine::dem
