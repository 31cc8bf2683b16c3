#include "dem/body/motion.hpp"

#include "error.hpp"

namespace moraine::dem {

const char* name_of(BodyId id) {
  switch (id) {
    case BodyId::none:
      return "no body";
    case BodyId::bottom_layer:
      return "the bottom layer";
    case BodyId::top_layer:
      return "the top layer";
    case BodyId::floor:
      return "the floor";
    case BodyId::top_wall:
      return "the top wall";
    case BodyId::x_low:
      return "the side wall x_low";
    case BodyId::x_high:
      return "the side wall x_high";
    case BodyId::y_low:
      return "the side wall y_low";
    case BodyId::y_high:
      return "the side wall y_high";
  }
  return "?";
}

double place_of(const Scene& scene, const State& state, BodyId id) {
  const Body& b = scene.body(id);
  return b.is_held(b.axis) ? b.place : state.at(id).x[b.axis];
}

namespace {

// A plane's velocity that is given counts from the first step on, a servo's is the state's.
Servo servo_of(const Scene& scene, const State& s, BodyId id, int axis, int plane) {
  const Body& b = scene.body(id);
  Servo servo;
  servo.body = id, servo.axis = axis, servo.plane = plane, servo.drive = b.along(axis);
  servo.facing = plane >= 0 ? b.facing : 1;
  const bool under_way = servo.by_stress() || (s.staggered && servo.drive.changes());
  servo.v = under_way ? s.at(id).v[axis] : servo.drive.velocity_at(scene.time(s.step));
  servo.mass = b.mass;
  if (plane < 0)
    for (Index i = 0; i < s.size(); ++i)
      if (s.part_of[i] == id) {
        const double share = servo.share(scene, s.x[i]);
        servo.mass += share * share * scene.inertial_mass(s.r[i], s.material_of(i));
      }
  return servo;
}

}  // namespace

BodyMotion motion_of(const Scene& scene, const State& s) {
  BodyMotion m;
  const auto add_servos = [&](BodyId id, int plane) {
    for (int axis = 0; axis < 3; ++axis) {
      const Drive::Kind kind = scene.body(id).along(axis).kind;
      if (kind != Drive::Kind::velocity && kind != Drive::Kind::stress) continue;
      if (m.servos == most_servos)
        throw error("bodies move along more than ", most_servos, " axes in all: ", name_of(id),
                    " is one too many");
      m.servo[m.servos++] = servo_of(scene, s, id, axis, plane);
    }
  };
  for (const BodyId id : planes) {
    const Body& b = scene.body(id);
    if (!b.is_there()) continue;
    m.plane[m.planes] = {id, b.material, b.axis, b.facing, place_of(scene, s, id), {0, 0, 0}};
    add_servos(id, m.planes++);
  }
  for (const BodyId id : {BodyId::bottom_layer, BodyId::top_layer})
    if (scene.has(id)) add_servos(id, -1);

  m.step = s.step;
  m.ledger = s.ledger;
  Reaction reaction;
  for (int k = 0; k < m.servos; ++k) reaction.force[k] = s.at(m.servo[k].body).force[m.servo[k].axis];
  m.take(scene, reaction, s.water);
  m.tell_planes();
  return m;
}

void store(const BodyMotion& m, State& s) {
  for (int k = 0; k < m.planes; ++k) {
    const Plane& p = m.plane[k];
    s.at(p.id) = {};
    s.at(p.id).x[p.axis] = p.place;
  }
  for (int k = 0; k < m.servos; ++k) {
    const Servo& b = m.servo[k];
    s.at(b.body).v[b.axis] = b.v, s.at(b.body).force[b.axis] = b.force;
  }
  s.water = m.water;
  s.ledger = m.ledger;
  s.step = m.step;
}

}  // namespace moraine::dem
