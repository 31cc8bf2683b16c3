// What both engines share beside the physics: reading a State in, writing it out, checking it.
#pragma once
#include <string>
#include <vector>

#include "dem/contact.hpp"
#include "dem/drive.hpp"
#include "dem/engine.hpp"
#include "dem/leapfrog.hpp"
#include "error.hpp"

namespace moraine::dem {

// Throws Error where the scene cannot be run: sides too short, no step, walls that contradict each other, ...
void check_scene(const Scene& scene, const State& state);

double neighbour_margin(const Scene& scene, const State& state);  // m

// Rows of all grains, held ones with the velocity they are held at.
std::vector<GrainRow> grain_rows(const Scene& scene, const State& state);

Drive drive_of(const Scene& scene, const State& state);

// A grain that is held in all directions is not tested against the walls, nor against its like (Neighbours).
MORAINE_HD bool meets_walls(const Scene& scene, Role role) {
  return role == Role::free || !scene.shear.hold_z;
}

// A wall's action on a grain.
struct WallAction {
  Vec3d f, torque;
  double slip;
  Vec3d f_viscous, torque_viscous;
};
template <Features F>
MORAINE_HD WallAction wall_action(const ContactParameters& law, double dt, const Drive& drive,
                                  const GrainRow& grain, const NowRow& now, WallName wall,
                                  Spring<double>& spring) {
  const bool top = wall == WallName::top;
  const Geometry<double> g = at_wall(grain.x.z, grain.r, top ? drive.wall_z : 0.0, top ? -1.0 : 1.0);
  const Vec3d still{0, 0, 0}, wall_v{0, 0, top ? drive.wall_v : 0.0},
      wall_now{0, 0, top ? drive.wall_v_ahead : 0.0};
  const Action<double> a = contact_law<F>(law, dt, g, {grain.v - wall_v, grain.omega, still},
                                          {now.v - wall_now, now.omega, still}, spring);
  return {a.f, g.l_i * a.f_x_n, a.slip, a.f_viscous, g.l_i * a.f_x_n_viscous};
}

// W, what the forces of viscous contacts do to a grain at step n, when its velocity is half a step further.
MORAINE_HD double damping_power(const Scene& scene, const GrainRow& g, const LoadRow& load,
                                const LoadRow& damping, double dt) {
  const Mobility m = mobility(scene, g);
  return dot(damping.f, axpy(0.5 * dt, m.acceleration(load.f), g.v)) +
         dot(damping.torque, axpy(0.5 * dt, m.spin_acceleration(load.torque), g.omega));
}

// A grain that is no longer finite, or outside what bounds it.
MORAINE_HD bool is_lost(const Scene& scene, const Drive& drive, const GrainRow& g) {
  const double sum = dot(g.x, g.x) + dot(g.v, g.v) + dot(g.omega, g.omega);
  if (!(sum < 1e300)) return true;
  if (scene.floor && g.x.z < -g.r) return true;
  return scene.top_wall.drive != TopWall::Drive::none && g.x.z > drive.wall_z + g.r;
}

// Where a grain is, for errors: "grain 5 at step 100 (t = 0.01 s) of stage fly, position (x, y, z) m,
// velocity (x, y, z) m/s: ".
std::string triple(const Vec3d& a);
std::string at_step(std::int64_t step, double t, const std::string& of);
std::string grain_there(Index id, const std::string& at_step, const Vec3d& x, const Vec3d& v);
Error lost_grain(const Scene& scene, const Drive& drive, const GrainRow& g, Index id);

// Whether grains and pore water meet at this step.
MORAINE_HD bool exchanges(const Scene& scene, std::int64_t step) {
  return scene.exchange_interval > 0 && step % scene.exchange_interval == 0;
}
// N, the whole force that the leapfrog applies to a grain at the state's step, without gravity.
Vec3d kick(const Scene& scene, const State& s, Index i);

void half_step_back(const Scene& scene, GrainRow& grain, const LoadRow& load);

void append_grain(State& s, const GrainRow& grain, const LoadRow& load, Role role);
// Only if they touch.
void append_contact(State& s, const Scene& scene, const Sides& sides, const GrainRow& a, const GrainRow& b,
                    Index i, Index j, const Spring<double>& spring);
void append_wall_contact(State& s, const Scene& scene, const Drive& drive, const GrainRow& grain, Index i,
                         WallName wall, const Spring<double>& spring);
// Sorts the contacts, copies the drive, marks the state staggered.
void finish_state(State& s, const Drive& drive);

}  // namespace moraine::dem
