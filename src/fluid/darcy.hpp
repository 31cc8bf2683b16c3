// The Darcy operator on a grid: transmissibilities T = A k_f/(mu_f l) between cells and towards open sides,
// and the storage C = beta phi V of each cell.
//
//   L p = sum over faces of T (p_c - p_neighbour) + sum over sides of given pressure of T p_c,  m3/s
//   b   = sum over sides of T p_side, or of the flux that enters,  m3/s
#pragma once
#include <array>
#include <vector>

#include "fluid/grid.hpp"
#include "fluid/step.hpp"

namespace moraine::fluid {

// Throws Error on sides that contradict themselves.
void check_sides(const Grid& grid, const Sides& sides);

class Darcy {
 public:
  Darcy(const Grid& grid, const Sides& sides);

  void set(const Grid& grid, const Medium& medium);  // throws Error naming the cell that is impossible

  const Grid& grid() const { return grid_; }
  const std::vector<double>& storage() const { return storage_; }
  const std::vector<double>& transmissibility(int axis) const { return t_[axis]; }
  // Sum of T around each cell: the diagonal of L.
  const std::vector<double>& outflow() const { return outflow_; }

  // y = (w C + dt L) x
  void apply(double w, double dt, const double* x, double* y) const;
  // y += factor b(t)
  void add_sides(double factor, double t, double* y) const;
  // y += factor times what enters through the sides at pressures p
  void add_inflow(double factor, double t, const std::vector<double>& p, double* y) const;
  // y += factor times what flows to neighbours
  void add_flow(double factor, const double* x, double* y) const;

  void flux(int axis, double t, const std::vector<double>& p, std::vector<double>& out) const;
  double dissipation(double t, const std::vector<double>& p) const;
  // Volumes that enter through the sides in dt at pressures p, m3.
  Exchanged through_sides(double t, double dt, const std::vector<double>& p) const;

  // Neighbours of a cell: low x, high x, low y, ...; itself where there is none (then T = 0).
  const std::array<int, 6>& neighbours(std::size_t c) const { return neighbour_[c]; }
  const std::array<double, 6>& links(std::size_t c) const { return link_[c]; }

 private:
  struct Opening {  // a face on a side through which water passes
    std::size_t cell, face;
    int axis;
    bool high;
  };
  const Side& side(const Opening& o) const { return o.high ? sides_.high[o.axis] : sides_.low[o.axis]; }
  double inflow(const Opening& o, double t, double p) const;  // m3/s

  Grid grid_;
  Sides sides_;
  std::vector<double> storage_, outflow_;
  std::array<std::vector<double>, 3> t_;
  std::vector<std::array<int, 6>> neighbour_;
  std::vector<std::array<double, 6>> link_;
  std::vector<Opening> openings_;
};

}  // namespace moraine::fluid
