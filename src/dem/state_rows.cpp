#include "dem/state_rows.hpp"

#include <algorithm>
#include <limits>

#include "dem/memory_order.hpp"
#include "dem/uses.hpp"

namespace moraine::dem {

std::vector<GrainRow> grain_rows(const Scene& scene, const State& s) {
  std::vector<GrainRow> rows(s.size());
  for (Index i = 0; i < s.size(); ++i) {
    GrainRow& g = rows[i];
    const BodyId layer = s.part_of[i];
    const Mobility m = mobility(scene, s.r[i], s.material_of(i), layer);
    g = {s.x[i], s.r[i], s.v[i], s.r[i], s.omega[i], m.inverse_mass_z, s.rotation[i], m.inverse_inertia};
    if (layer == BodyId::none) continue;
    const Drive& along_x = scene.body(layer).x;
    const bool under_way = along_x.kind == Drive::Kind::stress || (s.staggered && along_x.changes());
    const double u = under_way ? s.at(layer).v.x : along_x.velocity_at(scene.time(s.step));
    const double share = share_at(along_x.profile, s.x[i].y, scene.box.y);
    g.v = {share * u, 0, scene.is_rigid(layer) ? 0 : s.v[i].z};
    g.omega = {0, 0, 0};
  }
  return rows;
}

double least_mass(const Scene& scene, const State& s) {
  double least = std::numeric_limits<double>::infinity();
  for (Index i = 0; i < s.size(); ++i) least = std::min(least, scene.inertial_mass(s.r[i], s.material_of(i)));
  return least;
}

Vec3d kick(const Scene& scene, const State& s, Index i) {
  if (s.water_force.empty()) return s.force[i];
  return with_water(scene, s.step, {s.force[i], 0, {}, 0}, s.water_force[i]).f;
}

void start_half_a_step_back(const Scene& scene, const Reaction& reaction, const WaterReaction& water,
                            BodyMotion& bodies) {
  bodies.take(scene, reaction, water);
  bodies.half_step(scene, -1);
  bodies.take(scene, reaction, water);  // now that velocities are those of n - 1/2
  bodies.ledger = {};
}

void half_step_back(const Scene& scene, GrainRow& g, Material material, const LoadRow& whole) {
  const Mobility m = mobility(scene, g, material);
  g.v = axpy(-0.5 * scene.dt, m.acceleration(whole.f), g.v);
  g.omega = axpy(-0.5 * scene.dt, m.spin_acceleration(whole.torque), g.omega);
}

void remember_velocities(const Scene& scene, State& s) {
  const Sides sides = Sides::of(scene);
  const BodyMotion bodies = motion_of(scene, s);
  const std::vector<GrainRow> row = grain_rows(scene, s);  // layers move as they are driven
  with_laws(scene, [&]<class Row, Account>() {
    const auto remember = [&]<class L>(L*, const Geometry<double>& g, const Motion<double>& m,
                                       Spring<double>& spring) {
      if constexpr (L::damps) spring.v_before = contact_velocity<L>(scene.dt, g, m);
    };
    for (Contact& c : s.contacts) {
      const Vec3d x_ij = nearest_image(sides, s.x[c.i] - s.x[c.j]);
      const Geometry<double> g = between_grains(x_ij, s.r[c.i] + s.r[c.j], s.r[c.i] - s.r[c.j]);
      remember(static_cast<typename Row::BetweenGrains*>(nullptr), g,
               {row[c.i].v - row[c.j].v, row[c.i].omega, row[c.j].omega}, c.spring);
    }
    for (WallContact& c : s.wall_contacts)
      if (const Plane* plane = bodies.find(c.wall))
        remember(static_cast<typename Row::AtPlanes*>(nullptr), plane->geometry(s.x[c.i], s.r[c.i]),
                 {row[c.i].v - plane->v, row[c.i].omega, {0, 0, 0}}, c.spring);
  });
}

void reserve(State& s, Index grains, std::int64_t with_water_force) {
  const auto n = static_cast<std::size_t>(grains);
  s.r.reserve(n), s.part_of.reserve(n);
  for (auto* list : {&s.x, &s.v, &s.omega, &s.rotation, &s.force, &s.torque}) list->reserve(n);
  s.water_force.reserve(static_cast<std::size_t>(with_water_force));
}

bool touch(const Sides& sides, const GrainRow& a, const GrainRow& b) {
  return between_grains(nearest_image(sides, a.x - b.x), a.r + b.r, a.r - b.r).delta_n < 0;
}

void append_grain(State& s, const GrainRow& g, const LoadRow& load, BodyId part_of) {
  s.r.push_back(g.r);
  s.x.push_back(g.x);
  s.v.push_back(g.v);
  s.omega.push_back(g.omega);
  s.rotation.push_back(g.rotation);
  s.force.push_back(load.f);
  s.torque.push_back(load.torque);
  s.part_of.push_back(part_of);
}

Spring<double> remembered(const Scene& scene, const ContactParameters& p, Spring<double> s) {
  MoreParts::for_each_memory([&]<class Part>() {
    const bool kept = Part::keeps(p) && (scene.ledger || !std::is_same_v<Part, ViscousWork>);
    if (!kept) static_cast<typename Part::template Memory<double>&>(s) = {};
  });
  return s;
}

void append_contact(State& s, const Scene& scene, const ContactParameters& p, const Sides& sides,
                    const GrainRow& a, const GrainRow& b, Index i, Index j, const Spring<double>& spring) {
  if (!touch(sides, a, b)) return;
  s.contacts.push_back({i, j, remembered(scene, p, spring)});
}

void append_wall_contact(State& s, const Scene& scene, const Plane& plane, const GrainRow& g, Index i,
                         const Spring<double>& spring) {
  if (!(plane.gap(g.x, g.r) < 0)) return;
  const ContactParameters& p = scene.between(s.material_of(i), plane.material);
  s.wall_contacts.push_back({i, plane.id, remembered(scene, p, spring)});
}

void finish_state(State& s, const BodyMotion& bodies) {
  sort_contacts(s);
  store(bodies, s);
  s.staggered = true;
}

namespace {

// Velocities and spins of grains by half a step dt, forwards or back, with the forces as they stand.
void half_step(const Scene& scene, State& s, double dt) {
  for (Index i = 0; i < s.size(); ++i) {
    const Mobility m = mobility(scene, s.r[i], s.material_of(i), s.part_of[i]);
    s.v[i] = axpy(0.5 * dt, m.acceleration(kick(scene, s, i)), s.v[i]);
    s.omega[i] = axpy(0.5 * dt, m.spin_acceleration(s.torque[i]), s.omega[i]);
  }
}

void half_step_of_bodies(const Scene& scene, State& s, double sign) {
  BodyMotion bodies = motion_of(scene, s);
  bodies.half_step(scene, sign);
  store(bodies, s);
}

}  // namespace

void synchronise(const Scene& scene, State& s) {
  if (!s.staggered) return;
  half_step(scene, s, scene.dt);
  half_step_of_bodies(scene, s, 1);
  s.staggered = false;
}

void change_step(Scene& scene, State& s, double dt) {
  const bool staggered = s.staggered;
  const std::array<BodyState, body_ids> before = s.bodies;
  synchronise(scene, s);
  scene.time_0 = scene.time(s.step), scene.step_0 = s.step;
  scene.dt = dt;
  if (!staggered) return;
  half_step(scene, s, -dt);
  half_step_of_bodies(scene, s, -1);
  // A velocity that is given is that of the step that is over, from which it may be about to jump: how it
  // would have come here by the piece that now begins would leave the jump out of the account.
  for (const BodyId id : {BodyId::bottom_layer, BodyId::top_layer})
    for (int axis = 0; axis < 3; ++axis) {
      const Drive& drive = scene.body(id).along(axis);
      if (drive.kind == Drive::Kind::velocity && drive.changes())
        s.at(id).v[axis] = before[static_cast<std::size_t>(id)].v[axis];
    }
  s.staggered = true;
}

}  // namespace moraine::dem
