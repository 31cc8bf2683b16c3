#include "dem/scene_check.hpp"

#include <algorithm>
#include <sstream>

#include "dem/body/plane_contact.hpp"

namespace moraine::dem {

namespace {

void check_bodies(const Scene& s, const State& state) {
  for (const BodyId id : planes) {
    const Body& b = s.body(id);
    if (!b.is_there()) continue;
    const bool periodic = b.axis == 0 ? s.periodic_x : b.axis == 1 ? s.periodic_y : s.periodic_z;
    if (periodic && b.axis == 2)
      throw error(
          "sides periodic along z leave no room for a floor or a top wall: take z out of box.periodic, or "
          "the "
          "walls away");
    if (periodic)
      throw error("sides periodic along ", "xyz"[b.axis], " leave no room for ", name_of(id), ": take ",
                  "xyz"[b.axis], " out of box.periodic, or the wall away");
    if (s.exchange_interval > 0 && !b.is_held(b.axis) && id != BodyId::top_wall)
      throw error(name_of(id), ": moves, where pore water needs it to stand still");
    for (int a = 0; a < 3; ++a) {
      const Drive::Kind kind = b.along(a).kind;
      if (kind == Drive::Kind::free) throw error(name_of(id), ": a plane cannot be free along ", "xyz"[a]);
      if (kind == Drive::Kind::stress && (id != BodyId::top_wall || a != 2))
        throw error(name_of(id), ": a stress can press on the top wall, and along z only");
      if (kind == Drive::Kind::stress && !(b.mass > 0))
        throw error("top wall mass = ", b.mass, " kg: expected a positive number");
    }
  }
  for (const BodyId id : state.part_of)
    if (id != BodyId::none && s.body(id).shape != Body::Shape::layer)
      throw error("grains are part of ", name_of(id), ", which the scene has not");
  const Body &bottom = s.body(BodyId::bottom_layer), &top = s.body(BodyId::top_layer);
  for (const Body* b : {&bottom, &top})
    if (b->is_there() &&
        (!b->is_held(1) || b->z.kind == Drive::Kind::velocity || b->z.kind == Drive::Kind::stress))
      throw error("a layer is driven along x only");
  if (bottom.x.kind == Drive::Kind::stress) throw error("a stress drives the top layer only");
  if (top.x.kind == Drive::Kind::stress &&
      std::count(state.part_of.begin(), state.part_of.end(), BodyId::top_layer) == 0)
    throw error("a stress is to drive the top layer, but there are no grains in it");
}

}  // namespace

void check_scene(const Scene& s, const State& state) {
  if (state.size() == 0) throw error("there are no grains");
  if (!(s.dt > 0)) throw error("time step = ", s.dt, " s: expected a positive number");
  check_bodies(s, state);
  for (const Material m : state.material)
    if (static_cast<int>(m) >= s.materials)
      throw error("grains are of material ", static_cast<int>(m) + 1, ", and the scene has ", s.materials);
  const double r_max = *std::max_element(state.r.begin(), state.r.end());
  const Vec3d side = Sides::of(s).side;
  const double least = 4 * r_max + 2 * neighbour_margin(s, state);
  for (int a = 0; a < 3; ++a)
    if (side[a] > 0 && side[a] < least)
      throw error("box.", "xyz"[a], " = ", side[a],
                  " m is too narrow for a periodic side: two grains would touch on both sides; "
                  "expected at least ",
                  least, " m (two largest diameters and the neighbour margin)");
}

double neighbour_margin(const Scene& scene, const State& state) {
  if (scene.neighbour_margin > 0) return scene.neighbour_margin;
  double sum = 0;
  for (const double r : state.r) sum += r;
  return 0.05 * sum / state.size();
}

double widest_margin(const Scene& scene, const State& state) {
  if (scene.neighbour_margin > 0) return scene.neighbour_margin;
  double widest = 20 * neighbour_margin(scene, state);  // a mean radius
  const double r_max = *std::max_element(state.r.begin(), state.r.end());
  for (int a = 0; a < 3; ++a)
    if (const double side = Sides::of(scene).side[a]; side > 0)
      widest = std::min(widest, side / 2 - 2 * r_max);
  return widest;
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

Error lost_grain(const Scene& scene, const BodyMotion& bodies, const GrainRow& g, Index id) {
  const std::string place = grain_there(
      id, at_step(bodies.step, scene.time(bodies.step), "the stage (and those it carries on)"), g.x, g.v);
  const char* remedy =
      "; the step may be too long for the stiffness, or grains overlapped deeply: try a smaller model.f";
  if (!(dot(g.x, g.x) + dot(g.v, g.v) + dot(g.omega, g.omega) < 1e300))
    return error(place, "not a finite number", remedy);
  for (int k = 0; k < bodies.planes; ++k) {
    const Plane& p = bodies.plane[k];
    if (p.gap(g.x, g.r) < -2 * g.r && p.id == BodyId::floor)
      return error(place, "fell through the floor", remedy);
    if (p.gap(g.x, g.r) < -2 * g.r)
      return error(place, "passed through ", name_of(p.id), " (at ", p.place, " m)", remedy);
  }
  return error(place, "lost", remedy);
}

}  // namespace moraine::dem
