// One step from n to n + 1, as a list of tasks. Both engines take it, and a scene's list has only what it
// uses.
//
// A task of a chunk may begin once what it needs has been given: by the same chunk, or by all chunks linked
// to it (shares), or by the whole bed (bodies). On the CPU (cpu/) chunks wait for one another only so far; on
// the GPU (gpu/) each grain walks all its contacts, so that there are no shares, and tasks of chunks are
// those of grains.
#pragma once
#include <vector>

#include "dem/uses.hpp"

namespace moraine::dem {

enum class Task {
  exchange,
  near_pairs,
  pair_forces,
  shares,
  plane_forces,
  layer_forces,
  damping_power,
  push,
  motion,
  sums,
  bodies
};

// What tasks hand on, as bits.
namespace data {
constexpr unsigned grains = 1,  // positions at n, velocities at n - 1/2
    planes = 2,                 // where step n finds them
    pairs = 4,                  // that may touch, with their springs
    loads = 8,                  // forces and torques on grains at n, slip
    shares = 16,                // the part of them that another chunk's pairs make
    body_forces = 32,           // what grains do to bodies, and what viscous contacts take
    pressure = 64,              // of the pore water at n
    impulse = 128,              // of it on grains
    totals = 256,               // sums over the bed, by chunk: body forces, slip, the largest speed
    next_grains = 512,
                   next_bodies = 1024;  // also the ledger at n, and whether lists last for another step
}  // namespace data

struct TaskRow {
  Task task;
  const char* name;
  enum class Of { chunk, bed } of;
  unsigned needs, gives;
  bool (*in_step)(const Scene&);
};

namespace in_step {
inline bool always(const Scene&) { return true; }
inline bool with_water(const Scene& s) { return uses_of(s).water; }
inline bool with_planes(const Scene& s) { return s.has_planes(); }
inline bool with_driven_layers(const Scene& s) { return s.body(BodyId::top_layer).is_there(); }
inline bool with_damping_ledger(const Scene& s) { return uses_of(s).damping_ledger(); }
}  // namespace in_step

inline constexpr TaskRow step_tasks[] = {
    {Task::exchange, "exchange", TaskRow::Of::bed, data::grains | data::planes, data::pressure,
     in_step::with_water},
    {Task::near_pairs, "near pairs", TaskRow::Of::chunk, data::grains, data::pairs, in_step::always},
    {Task::pair_forces, "pair forces", TaskRow::Of::chunk, data::grains | data::pairs,
     data::loads | data::shares, in_step::always},
    {Task::shares, "shares", TaskRow::Of::chunk, data::loads | data::shares, data::loads, in_step::always},
    {Task::plane_forces, "plane forces", TaskRow::Of::chunk, data::grains | data::planes | data::loads,
     data::loads | data::body_forces, in_step::with_planes},
    {Task::layer_forces, "layer forces", TaskRow::Of::chunk, data::loads, data::body_forces,
     in_step::with_driven_layers},
    {Task::damping_power, "damping power", TaskRow::Of::chunk, data::grains | data::loads, data::body_forces,
     in_step::with_damping_ledger},
    {Task::push, "push", TaskRow::Of::chunk, data::grains | data::pressure, data::impulse,
     in_step::with_water},
    {Task::motion, "motion", TaskRow::Of::chunk, data::grains | data::loads, data::next_grains,
     in_step::always},
    {Task::sums, "sums", TaskRow::Of::bed, data::loads | data::next_grains, data::totals, in_step::always},
    {Task::bodies, "bodies", TaskRow::Of::bed, data::planes | data::totals, data::next_bodies,
     in_step::always},
};

// Those of a scene's step, in their order.
inline std::vector<TaskRow> tasks_of(const Scene& scene) {
  std::vector<TaskRow> tasks;
  for (const TaskRow& row : step_tasks)
    if (row.in_step(scene)) tasks.push_back(row);
  return tasks;
}

}  // namespace moraine::dem
