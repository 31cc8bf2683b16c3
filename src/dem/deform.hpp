// A periodic box that is deformed: its sides change, and all in it moves with them, in jumps between steps.
// Between two jumps it is a box like any other, so that the engines know nothing of it.
#pragma once
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

// What the contacts of the box bear, and how firmly they hold it.
struct BoxStress {
  Vec3d normal{0, 0, 0};  // Pa, along x, y and z, positive in compression: sum of f x_ij over the volume
  // Pa, what one and the same small strain of all sides adds to each, if all grains follow the mean strain:
  // k_n sum(l^2)/(3 V). A real packing gives way to less than that. 0 where nothing touches.
  double stiffness = 0;
};
BoxStress box_stress(const Scene& scene, const State& state);

double box_volume(const Scene& scene);    // m3, of a box that is periodic in all directions
double solid_volume(const State& state);  // m3, sum of the grains' volumes

// Multiplies sides and places by `factor`, along each axis. Springs follow as they would if the grains had
// moved there; velocities stay, for they are those against the mean motion. The state is synchronised
// (engine.hpp): load() finds what touches now and evaluates its forces. For a scene without planes and
// layers.
void deform(Scene& scene, State& state, const Vec3d& factor);

// J, of the springs of grain contacts.
struct SpringEnergy {
  double normal = 0, tangential = 0;
};
SpringEnergy spring_energy(const Scene& scene, const State& state);
// J, of grains in motion, as observe.hpp has it: v(n-1/2).v(n+1/2) where the state is staggered.
double kinetic_energy(const Scene& scene, const State& state);

}  // namespace moraine::dem
