// What one reads off a state: macroscopic stresses, geometry, contacts, and the energy balance. Host only,
// one fixed order of summation, so the same state always gives the same bits.
//
// Balance (J): kinetic + elastic + potential + slip + viscous - top_wall - layers = constant within a stage;
// `residue` is the drift of the left side since the stage began. Kinetic energy at step n is 1/2 m
// v(n-1/2).v(n+1/2), which leapfrog conserves exactly in a linear spring, so that the residue comes from
// opening, closing and turning contacts only.
#pragma once
#include <vector>

#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

struct Energy {
  double kinetic = 0, rotational = 0, elastic_normal = 0, elastic_tangential = 0, potential = 0,
         wall_kinetic = 0;
  double total() const {
    return kinetic + rotational + elastic_normal + elastic_tangential + potential + wall_kinetic;
  }
};

// Grain contacts with their forces, sorted by (i, j).
struct ContactForce {
  Index i, j;      // memory order
  Vec3d point;     // m
  Vec3d f_n, f_t;  // N, on i
  double overlap;  // m, positive
};
struct WallForce {
  Index i;
  BodyId wall;
  double f_n;      // N
  Vec3d f;         // N, on the grain
  double delta_n;  // m
};

// What contacts bear, at one step or as the mean over several: where grains meet pore water every m > 1
// steps, its push of m steps comes at one, grains swing about their place from one exchange to the next, and
// the forces at the exchange alone are off by what the swing takes up. Over all m steps they balance.
struct Loads {
  std::vector<ContactForce> contacts;  // that touched at any of the steps; `point` where they last did
  std::vector<WallForce> walls;        // likewise
  std::vector<Vec3d> force;            // N, on each grain, by contacts; memory order
  double wall_force = 0;               // N, of the grains on the top wall, upwards
  double shear_force = 0;              // N, sum of x forces of the grains on the top layer
};
Loads loads_of(const Scene& scene, const State& staggered);
void add(Loads& sum, const Loads& next);    // of the steps so far
Loads mean(Loads sum, std::int64_t steps);  // one step keeps its bits

// Forces, overlaps and the number of contacts are those of `loads`, all else that of the state.
struct Observation {
  double shear_stress = 0;   // Pa, -(x force on the top layer)/area
  double normal_stress = 0;  // Pa, force on the top wall/area (on the floor where there is no top wall)
  double height = 0;         // m, top wall, or the highest point of any grain
  double porosity = 0;       // of the box below `height`
  double mean_overlap = 0, max_overlap = 0;  // m, of grain contacts
  double coordination = 0;                   // contacts per grain, wall contacts not counted
  double unbalanced_force =
      0;  // mean net force on free grains (gravity included) / mean normal contact force
  Energy energy;
};
Observation observe(const Scene& scene, const State& staggered, const Loads& loads);
Observation observe(const Scene& scene, const State& staggered);  // loads of the step alone

// At step n, in the order of state.contacts.
std::vector<ContactForce> contact_forces(const Scene& scene, const State& staggered);

// Notes which grain contacts slip, after steps without softening, which do not tell: those whose tangential
// force is at Coulomb's limit.
void mark_slipping(const Scene& scene, State& staggered);

// Sum of |f_n| on each grain over its surface, Pa (the pressure of Fig. 5); memory order, walls included.
std::vector<double> grain_pressure(const State& state, const Loads& loads);

// Velocities at step n (mean of n - 1/2 and n + 1/2).
std::vector<Vec3d> velocity(const Scene& scene, const State& staggered);

}  // namespace moraine::dem
