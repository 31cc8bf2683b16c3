// What one reads off the water at an exchange: fields over the grid for snapshots, a row of the series.
#pragma once
#include "coupling/skeleton.hpp"
#include "coupling/water.hpp"

namespace moraine::coupling {

// t: s, of the sides' values. water: last set() for this skeleton.
WaterFields fields_of(const Skeleton& skeleton, const fluid::PressureStep& water, double t,
                      const std::vector<double>& p);

// Pressures over all cells, or over the upper half of their levels. storage: m3/Pa, C of each cell.
WaterRecord record_of(const dem::Scene& scene, const Skeleton& skeleton, const std::vector<double>& storage,
                      const WaterState& state, bool upper_half);

}  // namespace moraine::coupling
