// Darcy flow between the cells of a grid, as an operator on cell pressures:
//
//   C dp/dt = b(t) - L p,   (L p)_c = sum over faces of T (p_c - p_neighbour),   T = A k_f/(mu_f l)
//
// C = beta phi V, m3/Pa. k_f: harmonic mean of both cells' k; l: distance of centres. A side of given
// pressure lies half a cell from the centre and counts in L with its T, in b with T p_side; a side of given
// flux counts in b alone; a closed one nowhere. Beside a wall k_f and l leave its gap out (WallGap). L is
// symmetric. SI throughout. Throws Error for sides that contradict themselves and for a medium that is
// impossible, naming the cell.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "fluid/grid.hpp"
#include "fluid/step.hpp"

namespace moraine::fluid {

class Darcy {
 public:
  Darcy(const Grid& grid, const Sides& sides);
  void set(const Grid& grid, const Medium& medium);  // same n and periodic as before

  const Grid& grid() const { return grid_; }
  std::uint64_t version() const { return version_; }  // of the coefficients: one more with each set()
  const std::vector<double>& storage() const { return storage_; }
  const std::vector<double>& transmissibility(int axis) const { return transmissibility_[axis]; }

  void apply(double s, const double* p, double* out) const;       // out = (C + s L) p; s in s
  void apply_flow(double s, const double* p, double* out) const;  // out = s L p
  void diagonal(double s, double* out) const;                     // of C + s L
  void add_sides(double s, double t, double* out) const;          // out += s b(t)
  // out = L p - b(t), m3/s that leave each cell. Both cells of a face see the same flux to the last bit.
  void outflow(double t, const double* p, double* out) const;
  void flux(int axis, double t, const double* p, double* out) const;  // m3/s, upwards along the axis
  Exchanged inflow(double t, const double* p) const;                  // m3/s through the sides, into the grid
  // W, sum of T (drop of p)^2; out: of outflow(t, p).
  double dissipation(double t, const double* p, const double* out) const;

  // Calls visit(axis, face, low cell, high cell); a side has no_cell there.
  static constexpr std::size_t no_cell = static_cast<std::size_t>(-1);
  template <class Visit>
  void each_face(int axis, Visit&& visit) const {
    const auto& n = grid_.n;
    std::array<int, 3> i{}, end = n;
    end[axis] = grid_.faces(axis);
    for (i[2] = 0; i[2] < end[2]; ++i[2])
      for (i[1] = 0; i[1] < end[1]; ++i[1])
        for (i[0] = 0; i[0] < end[0]; ++i[0]) {
          auto low = i;
          --low[axis];
          const bool below = low[axis] >= 0, above = i[axis] < n[axis];
          if (!below && grid_.periodic[axis]) low[axis] = n[axis] - 1;
          visit(axis, grid_.face(axis, i[0], i[1], i[2]),
                below || grid_.periodic[axis] ? grid_.cell(low[0], low[1], low[2]) : no_cell,
                above ? grid_.cell(i[0], i[1], i[2]) : no_cell);
        }
  }

 private:
  // Rows of one value, as neighbours beyond the sides.
  struct Beyond {
    std::array<double, 2> x{};
    std::array<const double*, 2> y{}, z{};
  };
  template <bool with_storage>
  void sweep(double s, const Beyond& beyond, const double* p, double* out) const;
  template <class Visit>
  void each_side_cell(int axis, bool high, Visit&& visit) const;
  double pressure_beyond(const Side& side, double t) const;

  Grid grid_;
  Sides sides_;
  std::uint64_t version_ = 0;
  std::vector<double> storage_;
  std::array<std::vector<double>, 3> transmissibility_;
  std::vector<double> zeros_;
  mutable std::array<std::vector<double>, 4> rows_;
};

}  // namespace moraine::fluid
