// Exact volumes of a ball that planes along the axes cut: its parts in the cells of a grid.
#pragma once
#include <array>
#include <vector>

#include "dem/vec3.hpp"
#include "fluid/grid.hpp"

namespace moraine::coupling {

// Of the unit ball (4 pi/3) where X > a, where also Y > b, and where also Z > c; any numbers.
double ball_beyond(double a);
double ball_beyond(double a, double b);
double ball_beyond(double a, double b, double c);
double ball_in_box(const dem::Vec3d& low, const dem::Vec3d& high);  // of the unit ball about the origin

// Sides of the grid that hold grains back: what overlaps with them counts in the cell before them, as what
// overlaps between grains counts in both. Beyond the others nothing counts.
struct Holds {
  std::array<bool, 3> low{}, high{};
  bool at(int axis, bool high_end) const { return high_end ? high[axis] : low[axis]; }
};

// The parts of one ball in the cells of a grid.
class BallParts {
 public:
  // Cuts the ball of radius r about x by the cells. Cells along a periodic axis may lie beyond the grid.
  void cut(const fluid::Grid& grid, const Holds& holds, const dem::Vec3d& x, double r);

  // visit(i, j, k, volume in m3), where it is not empty.
  template <class Visit>
  void each(Visit&& visit) const {
    if (volume_ == 0) return;
    if (whole_) return visit(first_[0], first_[1], first_[2], volume_);
    for (int k = 0; k < count_[2]; ++k)
      for (int j = 0; j < count_[1]; ++j)
        for (int i = 0; i < count_[0]; ++i)
          if (const double v = part(i, j, k); v > 0) visit(first_[0] + i, first_[1] + j, first_[2] + k, v);
  }

 private:
  double part(int i, int j, int k) const;
  double beyond(int i, int j, int k) const {
    return beyond_[(static_cast<std::size_t>(k) * (count_[1] + 1) + j) * (count_[0] + 1) + i];
  }

  std::array<int, 3> first_{}, count_{};
  std::array<std::vector<double>, 3> planes_;  // from the centre, in radii
  std::vector<double> beyond_;                 // of the unit ball, from each crossing of planes
  double volume_ = 0;                          // m3, of the ball; 0 where none of it is inside
  bool whole_ = false;                         // in one cell
};

}  // namespace moraine::coupling
