// The structured grid that pore pressure lives on: nx x ny x nz equal cells over a box whose floor is z = 0
// and whose height may change from step to step (a stretched grid: h_z = height / nz). Plain data; knows
// nothing of grains.
//
// Cells: (i, j, k) is number (k ny + j) nx + i. Faces normal to axis a: face f lies below cell f along a;
// along a periodic axis there are n_a of them (face 0 joins cells n_a - 1 and 0), else n_a + 1 (faces 0 and
// n_a are sides). Within an axis, faces are numbered as cells are, with faces(a) in place of n_a.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "history.hpp"

namespace moraine::fluid {

struct Grid {
  std::array<int, 3> n{1, 1, 1};          // cells along x, y, z
  std::array<double, 3> length{1, 1, 1};  // m; length[2] is the present height
  std::array<bool, 3> periodic{true, true, false};

  std::size_t cells() const { return static_cast<std::size_t>(n[0]) * n[1] * n[2]; }
  double h(int axis) const { return length[axis] / n[axis]; }           // m
  double cell_volume() const { return h(0) * h(1) * h(2); }             // m3
  double face_area(int axis) const { return cell_volume() / h(axis); }  // m2
  std::size_t cell(int i, int j, int k) const { return (static_cast<std::size_t>(k) * n[1] + j) * n[0] + i; }

  int faces(int axis) const { return n[axis] + (periodic[axis] ? 0 : 1); }  // along that axis
  std::size_t face_count(int axis) const { return cells() / n[axis] * faces(axis); }
  std::size_t face(int axis, int i, int j, int k) const {
    const int nx = axis == 0 ? faces(0) : n[0], ny = axis == 1 ? faces(1) : n[1];
    return (static_cast<std::size_t>(k) * ny + j) * nx + i;
  }
  bool operator==(const Grid&) const = default;
};

// What happens at one side of the grid.
struct Side {
  enum class Kind { closed, pressure, flux };
  Kind kind = Kind::closed;
  double value = 0;  // Pa, excess pressure on the side; or m/s, water that enters through it (Darcy velocity)
  double amplitude = 0;  // of value + amplitude sin(2 pi frequency t + phase), in the unit of value
  double frequency = 0;  // Hz
  double phase = 0;      // rad
  History history{};     // of value, in its unit; empty: it does not change

  bool changes() const { return amplitude != 0 || history.is_there(); }
  double at(double t) const {  // t in s since the stage began
    return (history.is_there() ? history.at(t) : value) +
           (amplitude != 0 ? amplitude * std::sin(2 * std::numbers::pi * frequency * t + phase) : 0);
  }
  bool operator==(const Side&) const = default;
};

// Low and high side of each axis; those of periodic axes do not count.
struct Sides {
  std::array<Side, 3> low, high;
  bool operator==(const Sides&) const = default;
};

}  // namespace moraine::fluid
