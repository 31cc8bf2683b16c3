// The list of a step's tasks: each finds what it needs, and a scene's list has only what it uses.
#include "dem/step.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

std::vector<Task> tasks_of(const Scene& scene) {
  std::vector<Task> tasks;
  for (const TaskRow& row : step::of(scene)) tasks.push_back(row.task);
  return tasks;
}
bool has(const Scene& scene, Task task) { return std::ranges::count(tasks_of(scene), task) == 1; }

std::vector<Scene> scenes() {
  std::vector<Scene> list{empty_space(1e5), settled_bed().scene, sheared_bed().scene, sheared_bed().scene};
  list.back().exchange_interval = 3;
  list.back().with(Material::wall).gamma_n = 10;
  return list;
}

TEST(Step, EachTaskFindsWhatItNeeds) {
  for (const Scene& scene : scenes()) {
    unsigned there = step::grains | step::bodies;
    for (const TaskRow& row : step::of(scene)) {
      EXPECT_EQ(row.needs & ~there, 0u) << row.name << " needs what nothing before it gives";
      there |= row.gives;
    }
    EXPECT_TRUE(there & step::next_grains);
    EXPECT_TRUE(there & step::next_bodies);
  }
}

TEST(Step, WhatAnEmptySpaceDoesNotUseIsNotInItsList) {
  EXPECT_EQ(tasks_of(empty_space(1e5)), (std::vector{Task::near_pairs, Task::pair_forces, Task::shares,
                                                     Task::motion, Task::sums, Task::bodies}));
}

TEST(Step, EachFeatureBringsItsTask) {
  const Scene bed = settled_bed().scene;
  EXPECT_TRUE(has(bed, Task::plane_forces));
  EXPECT_FALSE(has(bed, Task::layer_forces));
  EXPECT_TRUE(has(sheared_bed().scene, Task::layer_forces));
  Scene wet = bed;
  wet.exchange_interval = 1;
  EXPECT_TRUE(has(wet, Task::exchange) && has(wet, Task::push));
}

}  // namespace
}  // namespace moraine::dem
