// Memory layout of what the contact loop reads and writes for each grain, in SIMD rows: two cache lines that
// it reads and one that it adds to. They are kept apart so that threads never write into what others read.
#pragma once
#include "dem/periodic_sides.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

struct alignas(64) GrainRow {
  Vec3d x;
  double r;
  Vec3d v;
  double r_again;  // so that one line gives r_i - r_j and r_i + r_j beside x_ij and v_ij
  Vec3d omega;
  double inverse_mass;     // 1/kg; see Mobility (leapfrog.hpp)
  Vec3d rotation;          // rad, integral of omega
  double inverse_inertia;  // 1/(kg m2); 0 for a held grain
};

// Sums over a grain's contacts.
struct alignas(64) LoadRow {
  Vec3d f;
  double slip;  // J, of the contacts in which the grain is i
  Vec3d torque;
  double viscous;  // J, likewise
};

// What pore water does to a grain, N.
struct alignas(32) WaterRow {
  Vec3d f;
  double unused;
};

}  // namespace moraine::dem
