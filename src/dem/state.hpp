// The grains and all that must be known to go on from here with the same bits.
//
// Grains stand in "memory order" (spatially sorted, see memory_order.hpp); `id` tells whose row it is. Within
// a stage the state is staggered (leapfrog): positions, springs and forces belong to step n, velocities and
// spins to n - 1/2. Between stages it is not: velocities and spins belong to n.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "dem/body/body.hpp"
#include "dem/law/laws.hpp"
#include "dem/ledger.hpp"
#include "dem/vec3.hpp"

namespace moraine::dem {

using Index = std::int32_t;

struct Contact {
  Index i, j;  // i < j, memory order
  Spring<double> spring;
};

struct WallContact {
  Index i;
  BodyId wall;
  Spring<double> spring;
};

// What pore water does at one step, beside its forces on grains; multiplied as those are
// (fluid_coupling.hpp).
struct WaterReaction {
  double wall = 0;          // N, on the top wall, upwards
  double layer = 0;         // N, x force on the grains of the top layer
  double work = 0;          // J, done on grains and wall since the last exchange
  double wall_between = 0;  // N, on the top wall at the steps up to the next exchange
};

// A body at one step. What does not change or is not driven along an axis is zero there.
struct BodyState {
  Vec3d x;      // m, of a plane along its normal, where it moves
  Vec3d v;      // m/s
  Vec3d force;  // N, of the grains on it; where a layer's velocity has a profile, by their shares of it
};

struct State {
  std::vector<Index> id;                   // 0 .. N-1, the row in every output file
  std::vector<double> r;                   // m
  std::vector<Vec3d> x;                    // m; not wrapped into the box while a stage runs
  std::vector<Vec3d> v;                    // m/s
  std::vector<Vec3d> omega;                // rad/s
  std::vector<Vec3d> rotation;             // rad, integral of omega (par. 45)
  std::vector<Vec3d> force;                // N, by contacts with grains and walls at step n; without gravity
  std::vector<Vec3d> torque;               // N m
  std::vector<Vec3d> water_force;          // N, by pore water at the last exchange; empty where there is none
  std::vector<Vec3d> x_start;              // m, where the displacement is counted from
  std::vector<BodyId> part_of;             // what the grain is part of: none, or a layer
  std::vector<Material> material;          // empty: all grains are of the first
  std::vector<Contact> contacts;           // overlapping pairs, sorted by (i, j)
  std::vector<WallContact> wall_contacts;  // sorted by (wall, i)

  std::array<BodyState, body_ids> bodies{};  // by BodyId
  WaterReaction water;                       // at the present step
  Ledger ledger;

  std::int64_t step = 0;  // steps since the stage began; t = Scene::time(step)
  bool staggered = false;

  Index size() const { return static_cast<Index>(r.size()); }
  Material material_of(Index i) const { return material.empty() ? Material::grain : material[i]; }
  const BodyState& at(BodyId id) const { return bodies[static_cast<std::size_t>(id)]; }
  BodyState& at(BodyId id) { return bodies[static_cast<std::size_t>(id)]; }
  double wall_z() const { return at(BodyId::top_wall).x.z; }  // m, height of the top wall
  double& wall_z() { return at(BodyId::top_wall).x.z; }
};

}  // namespace moraine::dem
