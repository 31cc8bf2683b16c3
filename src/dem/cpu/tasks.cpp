#include "dem/cpu/tasks.hpp"

namespace moraine::dem::cpu {

StepTasks tasks_for(const Scene& scene) {
  StepTasks tasks;
  for (const TaskRow& row : step::of(scene)) switch (row.task) {
      case Task::pair_forces:
        tasks.at_once.push_back(pair_forces_for(scene));
        break;
      case Task::shares:
        tasks.after_shares.push_back(shares_for(scene));
        break;
      case Task::plane_forces:
        tasks.after_shares.push_back(plane_forces_for(scene));
        break;
      case Task::layer_forces:
        tasks.after_shares.push_back(layer_forces_for(scene));
        break;
      case Task::motion:
        tasks.motion = motion_for(scene);
        break;
      case Task::exchange:
      case Task::near_pairs:
      case Task::push:
      case Task::sums:
      case Task::bodies:
        break;  // when they are due is for the schedule to say
    }
  return tasks;
}

}  // namespace moraine::dem::cpu
