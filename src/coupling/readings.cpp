#include "coupling/readings.hpp"

#include <algorithm>

#include "coupling/account.hpp"

namespace moraine::coupling {

WaterFields fields_of(const Skeleton& skeleton, const fluid::PressureStep& water, double t,
                      const std::vector<double>& p) {
  const fluid::Grid& grid = skeleton.grid();
  WaterFields out{grid, p, skeleton.mapping().porosity(), skeleton.medium().permeability, {}};
  out.flux.resize(grid.cells());
  for (int a = 0; a < 3; ++a) {
    std::vector<double> flow(grid.face_count(a));
    water.flux(a, t, p, flow);
    for_each_run(grid, a, [&](std::size_t c, std::size_t low, std::size_t high, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i)
        out.flux[c + i][a] = 0.5 * (flow[low + i] + flow[high + i]) / grid.face_area(a);
    });
  }
  return out;
}

WaterRecord record_of(const dem::Scene& scene, const Skeleton& skeleton, const std::vector<double>& storage,
                      const WaterState& state, bool upper_half) {
  const fluid::Grid& grid = skeleton.grid();
  WaterRecord r;
  r.least = 1e300, r.most = -1e300;
  const std::size_t first = grid.cell(0, 0, upper_half ? grid.n[2] / 2 : 0), count = state.p.size() - first;
  for (std::size_t c = first; c < state.p.size(); ++c) {
    r.mean += state.p[c];
    r.least = std::min(r.least, state.p[c]), r.most = std::max(r.most, state.p[c]);
  }
  r.mean /= static_cast<double>(count);
  for (std::size_t c = 0; c < state.q.size(); ++c) r.stored += 0.5 * state.q[c] * state.q[c] / storage[c];
  r.volume = water_volume(scene, skeleton, state);
  r.balance = r.volume + state.drained_top + state.drained_bottom + state.drained_sides - state.volume_0;
  return r;
}

}  // namespace moraine::coupling
