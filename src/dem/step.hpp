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
  push,
  motion,
  sums,
  bodies
};

// What tasks hand on, as bits.
namespace step {
enum Data : unsigned {
  grains = 1,         // positions at n, velocities at n - 1/2
  bodies = 2,         // where step n finds them
  pairs = 4,          // that may touch, with their springs
  loads = 8,          // forces and torques on grains at n, energy dissipated
  shares = 16,        // the part of them that another chunk's pairs make
  body_forces = 32,   // what grains do to bodies
  pressure = 64,      // of the pore water at n
  impulse = 128,      // of it on grains
  next_grains = 256,  // at n + 1
  totals = 512,       // sums over the bed, by chunk: body forces, energy dissipated, the largest speed
  next_bodies = 1024  // also the ledger at n, and whether lists last for another step
};
}  // namespace step

struct TaskRow {
  Task task;
  const char* name;
  enum class Of { chunk, bed } of;
  unsigned needs, gives;  // step::Data
  bool (*in_step)(const Scene&);
};

namespace step {

constexpr auto chunk = TaskRow::Of::chunk, bed = TaskRow::Of::bed;
inline bool always(const Scene&) { return true; }
inline bool with_water(const Scene& s) { return uses_of(s).water; }
inline bool with_planes(const Scene& s) { return s.has_planes(); }
inline bool with_layers(const Scene& s) { return s.has(BodyId::top_layer); }

// clang-format off
inline constexpr TaskRow tasks[] = {
    // task             name             of     needs                     gives                what scenes
    {Task::exchange,      "exchange",      bed,   grains | bodies,          pressure,            with_water},
    {Task::near_pairs,    "near pairs",    chunk, grains,                   pairs,               always},
    {Task::pair_forces,   "pair forces",   chunk, grains | pairs,           loads | shares,      always},
    {Task::shares,        "shares",        chunk, loads | shares,           loads,               always},
    {Task::plane_forces,  "plane forces",  chunk, grains | bodies | loads,  loads | body_forces, with_planes},
    {Task::layer_forces,  "layer forces",  chunk, loads,                    body_forces,         with_layers},
    {Task::push,          "push",          chunk, grains | pressure,        impulse,             with_water},
    {Task::motion,        "motion",        chunk, grains | loads,           next_grains,         always},
    {Task::sums,          "sums",          bed,   loads | next_grains,      totals,              always},
    {Task::bodies,        "bodies",        bed,   bodies | totals,          next_bodies,         always},
};
// clang-format on

// Those of a scene's step, in their order.
inline std::vector<TaskRow> of(const Scene& scene) {
  std::vector<TaskRow> list;
  for (const TaskRow& row : tasks)
    if (row.in_step(scene)) list.push_back(row);
  return list;
}

}  // namespace step

}  // namespace moraine::dem
