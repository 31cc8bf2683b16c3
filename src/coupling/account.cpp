#include "coupling/account.hpp"

#include "coupling/walls.hpp"

namespace moraine::coupling {

// Of solids through one side, along its axis.
static double through(const fluid::Grid& grid, const Faces& u, int axis, bool high) {
  if (grid.periodic[axis]) return 0;
  std::array<int, 3> i{}, begin{}, end = grid.n;
  begin[axis] = high ? grid.n[axis] : 0, end[axis] = begin[axis] + 1;
  double sum = 0;
  for (i[2] = begin[2]; i[2] < end[2]; ++i[2])
    for (i[1] = begin[1]; i[1] < end[1]; ++i[1])
      for (i[0] = begin[0]; i[0] < end[0]; ++i[0]) sum += u[axis][grid.face(axis, i[0], i[1], i[2])];
  return sum;
}

void book_flow(const fluid::Grid& grid, const Faces& u, double wall_swept, const fluid::Exchanged& in,
               WaterState& state) {
  // What grains push out through a drained wall that does not follow them is water, too.
  state.drained_top += (through(grid, u, 2, true) - wall_swept) - in.high[2];
  state.drained_bottom -= through(grid, u, 2, false) + in.low[2];
  for (int a = 0; a < 2; ++a)
    state.drained_sides +=
        (through(grid, u, a, true) - through(grid, u, a, false)) - (in.low[a] + in.high[a]);
}

void book_outside(const fluid::Grid& grid, const fluid::Sides& sides, const Outside& before,
                  const Outside& now, WaterState& state) {
  for (int a = 0; a < 3; ++a)
    for (const bool high : {false, true}) {
      const fluid::Side& side = high ? sides.high[a] : sides.low[a];
      if (grid.periodic[a] || side.kind == fluid::Side::Kind::closed) continue;
      double& drained = a < 2 ? state.drained_sides : high ? state.drained_top : state.drained_bottom;
      drained -= now.volume[a][high] - before.volume[a][high];
    }
}

double water_volume(const dem::Scene& scene, const Skeleton& skeleton, const WaterState& state) {
  double volume =
      scene.area() * (has_wall(scene) ? state.wall_z : skeleton.grid().length[2]) - skeleton.solids();
  for (const auto& axis : skeleton.mapping().outside().volume) volume += axis[0] + axis[1];
  double stored = 0;
  for (const double q : state.q) stored += q;
  return volume + stored;
}

}  // namespace moraine::coupling
