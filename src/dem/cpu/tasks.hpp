// The tasks of a step (step.hpp) that the CPU's engine does chunk by chunk, as functions, and the list of
// them for a scene. Which function stands for a task depends on the laws (uses.hpp).
#pragma once
#include <vector>

#include "dem/cpu/bed.hpp"
#include "dem/step.hpp"

namespace moraine::dem::cpu {

// Where and when a task works.
struct ChunkStep {
  const BodyMotion& bodies;
  std::int64_t step;  // whose forces move the grains on
  double dt;          // s; 0: forces are evaluated where the grains are, springs as they are
  LoadRow* load;      // where that of grain 0 would be, though only those of the chunk's grains need exist
  const WaterRow* push = nullptr;  // likewise, of the water at this step; null where there is none
};
using ChunkTask = void (*)(Bed&, Chunk&, const ChunkStep&);

// In the order of step::tasks. Searching, water and sums are the schedule's (schedule.hpp).
struct StepTasks {
  std::vector<ChunkTask> at_once;  // on what a chunk has or later ones hold still: pair forces
  std::vector<ChunkTask>
      after_shares;  // once all earlier chunks that are linked to it are through with those
  ChunkTask motion = nullptr;
};
StepTasks tasks_for(const Scene& scene);

// The function for a task, by room.
ChunkTask pair_forces_for(const Scene& scene);         // pair_forces.cpp
bool has_wide_lanes();                                 // whether it takes AVX-512
ChunkTask wide_pair_forces(int row, Account account);  // pair_forces_wide.cpp; row: of CompiledLaws
ChunkTask shares_for(const Scene& scene);              // body_forces.cpp
ChunkTask plane_forces_for(const Scene& scene);        //
ChunkTask layer_forces_for(const Scene& scene);        //
ChunkTask motion_for(const Scene& scene);              // motion.cpp

}  // namespace moraine::dem::cpu
