// The account of water, kept in WaterState: what drained through the sides since the stage began. Volumes in
// m3.
//
// U through an open side is the volume of solids and water that pass; the solids' part is known from where
// grains are (Outside), the rest is water.
#pragma once
#include "coupling/skeleton.hpp"
#include "coupling/water.hpp"

namespace moraine::coupling {

// Of a step of the pressure: u, of the solids; wall_swept, by the top wall upwards; in, by the water.
void book_flow(const fluid::Grid& grid, const Faces& u, double wall_swept, const fluid::Exchanged& in,
               WaterState& state);

// Where grains have left since, U counted volume through the side of which the grains' own was no water. By a
// tight side no water comes for them: the balance then lacks it.
void book_outside(const fluid::Grid& grid, const fluid::Sides& sides, const Outside& before,
                  const Outside& now, WaterState& state);

// What is there: sum of phi V (1 + beta p).
double water_volume(const dem::Scene& scene, const Skeleton& skeleton, const WaterState& state);

}  // namespace moraine::coupling
