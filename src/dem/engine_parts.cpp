#include "dem/engine_parts.hpp"

#include <algorithm>

#include "dem/order.hpp"

namespace moraine::dem {

void check_scene(const Scene& s, const State& state) {
  if (state.size() == 0) throw error("there are no grains");
  if (!(s.dt > 0)) throw error("time step = ", s.dt, " s: expected a positive number");
  if (s.periodic_z && (s.floor || s.top_wall.drive != TopWall::Drive::none))
    throw error(
        "sides periodic along z leave no room for a floor or a top wall: take z out of box.periodic, or the "
        "walls away");
  if (s.top_wall.drive == TopWall::Drive::stress && !(s.top_wall.mass > 0))
    throw error("top wall mass = ", s.top_wall.mass, " kg: expected a positive number");
  const double r_max = *std::max_element(state.r.begin(), state.r.end());
  const Vec3d side = Sides::of(s).side;
  const double least = 4 * r_max + 2 * neighbour_margin(s, state);
  for (int a = 0; a < 3; ++a)
    if (side[a] > 0 && side[a] < least)
      throw error("box.", "xyz"[a], " = ", side[a],
                  " m is too narrow for a periodic side: two grains would touch on both sides; "
                  "expected at least ",
                  least, " m (two largest diameters and the neighbour margin)");
  if (s.shear.drive == Shear::Drive::stress &&
      std::count(state.role.begin(), state.role.end(), Role::top) == 0)
    throw error("a stress is to drive the top layer, but there are no grains in it");
}

double neighbour_margin(const Scene& scene, const State& state) {
  if (scene.neighbour_margin > 0) return scene.neighbour_margin;
  double sum = 0;
  for (const double r : state.r) sum += r;
  return 0.05 * sum / state.size();
}

std::vector<GrainRow> grain_rows(const Scene& scene, const State& s) {
  std::vector<GrainRow> rows(s.size());
  for (Index i = 0; i < s.size(); ++i) {
    GrainRow& g = rows[i];
    const Mobility m = mobility(scene, s.r[i], s.role[i]);
    g = {s.x[i], s.r[i], s.v[i], s.r[i], s.omega[i], m.inverse_mass_z, s.rotation[i], m.inverse_inertia};
    if (s.role[i] == Role::free) continue;
    const double u = s.role[i] == Role::bottom                     ? 0
                     : scene.shear.drive == Shear::Drive::velocity ? scene.shear.velocity
                                                                   : s.layer_u;
    g.v = {u, 0, scene.shear.hold_z ? 0 : s.v[i].z};
    g.omega = {0, 0, 0};
  }
  return rows;
}

Drive drive_of(const Scene& scene, const State& s) {
  Drive d;
  d.wall_z = s.wall_z;
  d.wall_v = scene.top_wall.drive == TopWall::Drive::velocity ? scene.top_wall.velocity : s.wall_v;
  d.layer_u = scene.shear.drive == Shear::Drive::velocity ? scene.shear.velocity : s.layer_u;
  for (Index i = 0; i < s.size(); ++i)
    if (s.role[i] == Role::top) d.layer_mass += sphere_mass(scene.density, s.r[i]);
  d.step = s.step;
  d.ledger = s.ledger;
  d.take(scene, {s.wall_force, s.shear_force, 0}, s.water);
  d.wall_v_ahead = s.staggered ? d.wall_v_now : d.wall_v;
  return d;
}

std::string triple(const Vec3d& a) {
  std::ostringstream text;
  text.precision(9);
  text << "(" << a.x << ", " << a.y << ", " << a.z << ")";
  return text.str();
}

std::string at_step(std::int64_t step, double t, const std::string& of) {
  std::ostringstream text;
  text.precision(9);
  text << " at step " << step << " (t = " << t << " s) of " << of;
  return text.str();
}

std::string grain_there(Index id, const std::string& when, const Vec3d& x, const Vec3d& v) {
  return "grain " + std::to_string(id) + when + ", position " + triple(x) + " m, velocity " + triple(v) +
         " m/s: ";
}

Error lost_grain(const Scene& scene, const Drive& drive, const GrainRow& g, Index id) {
  const std::string place = grain_there(
      id, at_step(drive.step, scene.time(drive.step), "the stage (and those it carries on)"), g.x, g.v);
  const char* remedy =
      "; the step may be too long for the stiffness, or grains overlapped deeply: try a smaller model.f";
  if (!(dot(g.x, g.x) + dot(g.v, g.v) + dot(g.omega, g.omega) < 1e300))
    return error(place, "not a finite number", remedy);
  if (scene.floor && g.x.z < -g.r) return error(place, "fell through the floor", remedy);
  return error(place, "passed through the top wall (at ", drive.wall_z, " m)", remedy);
}

Vec3d kick(const Scene& scene, const State& s, Index i) {
  if (s.water_force.empty() || !exchanges(scene, s.step)) return s.force[i];
  return axpy(static_cast<double>(scene.exchange_interval), s.water_force[i], s.force[i]);
}

void half_step_back(const Scene& scene, GrainRow& g, const LoadRow& load) {
  const Mobility m = mobility(scene, g);
  g.v = axpy(-0.5 * scene.dt, m.acceleration(load.f), g.v);
  g.omega = axpy(-0.5 * scene.dt, m.spin_acceleration(load.torque), g.omega);
}

void append_grain(State& s, const GrainRow& g, const LoadRow& load, Role role) {
  s.r.push_back(g.r);
  s.x.push_back(g.x);
  s.v.push_back(g.v);
  s.omega.push_back(g.omega);
  s.rotation.push_back(g.rotation);
  s.force.push_back(load.f);
  s.torque.push_back(load.torque);
  s.role.push_back(role);
}

// What a contact remembers under this law: without friction there is no spring, and without softening it does
// not matter whether it slips, whatever an earlier stage has left.
static Spring<double> remembered(const ContactParameters& p, const Spring<double>& s) {
  return {p.k_t > 0 && p.mu_s > 0 ? s.delta_t : Vec3d{}, p.mu_d < p.mu_s ? s.slipping : 0};
}

void append_contact(State& s, const Scene& scene, const Sides& sides, const GrainRow& a, const GrainRow& b,
                    Index i, Index j, const Spring<double>& spring) {
  if (!(between_grains(nearest_image(sides, a.x - b.x), a.r + b.r, a.r - b.r).delta_n < 0)) return;
  const auto [delta_t, slipping] = remembered(scene.grain, spring);
  s.contacts.push_back({i, j, delta_t, slipping});
}

void append_wall_contact(State& s, const Scene& scene, const Drive& drive, const GrainRow& g, Index i,
                         WallName wall, const Spring<double>& spring) {
  const bool top = wall == WallName::top;
  if (!(at_wall(g.x.z, g.r, top ? drive.wall_z : 0.0, top ? -1.0 : 1.0).delta_n < 0)) return;
  const auto [delta_t, slipping] = remembered(scene.wall, spring);
  s.wall_contacts.push_back({i, wall, delta_t, slipping});
}

void finish_state(State& s, const Drive& d) {
  sort_contacts(s);
  s.wall_z = d.wall_z, s.wall_v = d.wall_v, s.layer_u = d.layer_u;
  s.wall_force = d.at.wall_force, s.shear_force = d.at.shear_force;
  s.water = d.water;
  s.ledger = d.ledger;
  s.step = d.step;
  s.staggered = true;
}

void synchronise(const Scene& scene, State& s) {
  if (!s.staggered) return;
  for (Index i = 0; i < s.size(); ++i) {
    const Mobility m = mobility(scene, s.r[i], s.role[i]);
    s.v[i] = axpy(0.5 * scene.dt, m.acceleration(kick(scene, s, i)), s.v[i]);
    s.omega[i] = axpy(0.5 * scene.dt, m.spin_acceleration(s.torque[i]), s.omega[i]);
  }
  Drive d = drive_of(scene, s);
  d.half_step(scene, 1);
  s.wall_v = d.wall_v, s.layer_u = d.layer_u;
  s.staggered = false;
}

void change_step(Scene& scene, State& s, double dt) {
  const bool staggered = s.staggered;
  synchronise(scene, s);
  scene.time_0 = scene.time(s.step), scene.step_0 = s.step;
  scene.dt = dt;
  if (!staggered) return;
  for (Index i = 0; i < s.size(); ++i) {
    const Mobility m = mobility(scene, s.r[i], s.role[i]);
    s.v[i] = axpy(-0.5 * dt, m.acceleration(kick(scene, s, i)), s.v[i]);
    s.omega[i] = axpy(-0.5 * dt, m.spin_acceleration(s.torque[i]), s.omega[i]);
  }
  Drive d = drive_of(scene, s);
  d.half_step(scene, -1);
  s.wall_v = d.wall_v, s.layer_u = d.layer_u;
  s.staggered = true;
}

}  // namespace moraine::dem
