// Vectors in three dimensions over any number type: double, or a pack of doubles (backend/number.hpp).
#pragma once
#include "backend/number.hpp"

namespace moraine::dem {

template <class T>
struct Vec3 {
  T x, y, z;

  MORAINE_HD T& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }
  MORAINE_HD T operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
  // As v[axis] = value, but leaves the vector in registers where the axis is known only at run time.
  MORAINE_HD void set(int axis, const T& value) {
    x = axis == 0 ? value : x, y = axis == 1 ? value : y, z = axis == 2 ? value : z;
  }
  MORAINE_HD Vec3& operator+=(const Vec3& b) { return *this = *this + b; }
  MORAINE_HD Vec3& operator-=(const Vec3& b) { return *this = *this - b; }

  friend MORAINE_HD Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend MORAINE_HD Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend MORAINE_HD Vec3 operator*(const T& s, const Vec3& a) { return {s * a.x, s * a.y, s * a.z}; }
  friend MORAINE_HD Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
  friend bool operator==(const Vec3&, const Vec3&) = default;
};

template <class T>
MORAINE_HD T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}

template <class T>
MORAINE_HD Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {fma(a.y, b.z, -(a.z * b.y)), fma(a.z, b.x, -(a.x * b.z)), fma(a.x, b.y, -(a.y * b.x))};
}

// a x b + c
template <class T>
MORAINE_HD Vec3<T> cross_plus(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c) {
  return {fma(a.y, b.z, fnma(a.z, b.y, c.x)), fma(a.z, b.x, fnma(a.x, b.z, c.y)),
          fma(a.x, b.y, fnma(a.y, b.x, c.z))};
}

// s a + b
template <class T>
MORAINE_HD Vec3<T> axpy(const T& s, const Vec3<T>& a, const Vec3<T>& b) {
  return {fma(s, a.x, b.x), fma(s, a.y, b.y), fma(s, a.z, b.z)};
}

// b - s a
template <class T>
MORAINE_HD Vec3<T> less(const Vec3<T>& b, const T& s, const Vec3<T>& a) {
  return {fnma(s, a.x, b.x), fnma(s, a.y, b.y), fnma(s, a.z, b.z)};
}

using moraine::select;
template <class M, class T>
MORAINE_HD Vec3<T> select(const M& mask, const Vec3<T>& a, const Vec3<T>& b) {
  return {select(mask, a.x, b.x), select(mask, a.y, b.y), select(mask, a.z, b.z)};
}

using Vec3d = Vec3<double>;

}  // namespace moraine::dem
