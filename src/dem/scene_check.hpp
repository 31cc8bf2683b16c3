// What is refused before a step is taken (and by motion_of(): bodies that move along too many axes), and how
// a grain that went wrong is reported.
#pragma once
#include <string>

#include "dem/body/motion.hpp"
#include "dem/grain.hpp"
#include "error.hpp"

namespace moraine::dem {

// Throws Error where the scene cannot be run: sides too short, no step, walls that contradict each other, ...
void check_scene(const Scene& scene, const State& state);

double neighbour_margin(const Scene& scene, const State& state);  // m
double widest_margin(const Scene& scene, const State& state);     // m, that an engine may choose instead

// Where a grain is, for errors: "grain 5 at step 100 (t = 0.01 s) of stage fly, position (x, y, z) m,
// velocity (x, y, z) m/s: ".
std::string triple(const Vec3d& a);
std::string at_step(std::int64_t step, double t, const std::string& of);
std::string grain_there(Index id, const std::string& at_step, const Vec3d& x, const Vec3d& v);
Error lost_grain(const Scene& scene, const BodyMotion& bodies, const GrainRow& grain, Index id);

}  // namespace moraine::dem
