// How bodies move, and the account of the energy they give. Each axis along which a
// body moves or is driven has a servo: given a velocity, or the acceleration that a stress, the grains and
// the water give its mass. One small struct of numbers; every thread advances a copy of its own and all stay
// equal.
#pragma once
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

constexpr int most_servos = 4, most_planes = 6;

// What grains do to bodies at one step: sums over grains, each in a fixed order (sums.hpp).
struct Reaction {
  double force[most_servos] = {};  // N, on each servo's body along its axis; a layer's grains by their shares
};

// A plane where a step finds it.
struct Plane {
  BodyId id = BodyId::none;
  Material material = Material::wall;
  std::int32_t axis = 2;
  double facing = 1;
  double place = 0;  // m, along the axis
  Vec3d v{};         // m/s, at n - 1/2

  MORAINE_HD double gap(const Vec3d& x, double r) const { return gap_to_plane(x[axis], r, place, facing); }
  MORAINE_HD Geometry<double> geometry(const Vec3d& x, double r) const {
    return at_plane(x, r, axis, place, facing);
  }
};

// One body along one axis.
struct Servo {
  BodyId body = BodyId::none;
  std::int32_t axis = 0;
  std::int32_t plane = -1;  // its place in BodyMotion::plane; -1: a layer
  Drive drive;
  double facing = 1;                     // sign of a stress along the axis
  double mass = 0;                       // kg
  double v = 0;                          // m/s, at n - 1/2
  double dx = 0;                         // m, of the last step
  double force = 0, force_before = 0;    // N, of the grains, now and one step earlier
  double water = 0, water_before = 0;    // N; zero where the bed is dry
  double stress = 0, stress_before = 0;  // Pa, asked for
  double thrust = 0, thrust_before = 0;  // N, that a layer's mass needs where its velocity changes

  MORAINE_HD bool is_plane() const { return plane >= 0; }
  MORAINE_HD bool by_stress() const { return drive.kind == Drive::Kind::stress; }
  // Whether grains of the layer have to be told its velocity at each step.
  MORAINE_HD bool tells_grains() const { return by_stress() || drive.changes(); }
  // A given velocity in the middle of the step that begins, m/s; t: s, of the step.
  MORAINE_HD double next_velocity(double t, double dt) const { return drive.velocity_at(t + 0.5 * dt); }
  // Of this velocity, by which a grain of the layer moves; its place never changes across x.
  MORAINE_HD double share(const Scene& s, const Vec3d& x) const {
    return share_at(drive.profile, x.y, s.box.y);
  }

  MORAINE_HD double acceleration(double area) const {  // m/s2
    if (!by_stress()) return 0;
    const double asked = facing * (stress * area);
    return (is_plane() ? force + water + asked : asked + force + water) / mass;
  }
  // J, that a force along the axis does in the step that is over. Grains of a layer have moved by v dt each.
  MORAINE_HD double work(double f, double dt) const { return is_plane() ? f * dx : f * v * dt; }
};

struct BodyMotion {
  Plane plane[most_planes];
  Servo servo[most_servos];
  std::int32_t planes = 0, servos = 0;
  WaterReaction water;  // at the present step
  Ledger ledger;
  std::int64_t step = 0;

  // Takes the forces of the present step and closes the account of the step that led to it. Work is counted
  // with the mean of the forces before and after, as leapfrog does it.
  MORAINE_HD void close(const Scene& s, const Reaction& reaction, const WaterReaction& by_water) {
    take(s, reaction, by_water);
    for (int k = 0; k < servos; ++k) {
      const Servo& b = servo[k];
      const double by_drive =
          b.by_stress() ? b.facing * b.work(0.5 * (b.stress_before + b.stress) * s.area(), s.dt)
                        : b.work(0.5 * (b.thrust_before + b.thrust), s.dt) -
                              b.work(0.5 * ((b.force_before + b.force) + (b.water_before + b.water)), s.dt);
      (b.is_plane() ? ledger.planes : ledger.layers) += by_drive;
    }
    ledger.water += by_water.work;
  }
  MORAINE_HD void take(const Scene& s, const Reaction& reaction, const WaterReaction& by_water) {
    water = by_water;
    for (int k = 0; k < servos; ++k) {
      Servo& b = servo[k];
      b.force = reaction.force[k], b.water = of(by_water, b);
      ask(s, b);
    }
  }
  // What the drive asks for at the present step.
  MORAINE_HD void ask(const Scene& s, Servo& b) const {
    const double t = s.time(step);
    b.stress = b.by_stress() ? b.drive.stress(t) : 0;
    const bool heaves = !b.is_plane() && !b.by_stress() && b.drive.changes();
    b.thrust = heaves ? b.mass * ((b.next_velocity(t, s.dt) - b.v) / s.dt) : 0;
  }
  // Drives of other bodies from here on; of the same kinds.
  MORAINE_HD void redrive(const Scene& s) {
    for (int k = 0; k < servos; ++k) {
      servo[k].drive = s.body(servo[k].body).along(servo[k].axis);
      ask(s, servo[k]);
    }
  }

  // From step n to n + 1 (velocities from n - 1/2 to n + 1/2).
  MORAINE_HD void advance(const Scene& s) {
    for (int k = 0; k < servos; ++k) {
      Servo& b = servo[k];
      b.force_before = b.force, b.water_before = b.water;
      b.stress_before = b.stress, b.thrust_before = b.thrust;
      b.v = b.by_stress() ? fma(b.acceleration(s.area()), s.dt, b.v) : b.next_velocity(s.time(step), s.dt);
      b.dx = b.v * s.dt;
      if (b.is_plane() && plane[b.plane].axis == b.axis) plane[b.plane].place += b.dx;
    }
    tell_planes();
    ++step;
  }
  // To the step from half a step earlier (sign 1), or back (-1).
  MORAINE_HD void half_step(const Scene& s, double sign) {
    const double t = s.time(step);
    for (int k = 0; k < servos; ++k) {
      Servo& b = servo[k];
      if (b.by_stress())
        b.v = fma(b.acceleration(s.area()), sign * 0.5 * s.dt, b.v);
      else if (b.drive.changes())
        b.v = sign > 0 ? 0.5 * (b.v + b.next_velocity(t, s.dt)) : b.next_velocity(t, -s.dt);
    }
    tell_planes();
  }
  // A bound on the speed of any plane, m/s.
  MORAINE_HD double fastest_plane() const {
    double fastest = 0;
    for (int k = 0; k < servos; ++k)
      if (servo[k].is_plane()) fastest = max(::fabs(servo[k].v), fastest);
    return fastest;
  }
  MORAINE_HD void tell_planes() {
    for (int k = 0; k < servos; ++k)
      if (servo[k].is_plane()) plane[servo[k].plane].v[servo[k].axis] = servo[k].v;
  }
  // Pore water acts on the top wall along z and on the top layer along x.
  MORAINE_HD static double of(const WaterReaction& w, const Servo& b) {
    if (b.body == BodyId::top_wall && b.axis == 2) return w.wall;
    return b.body == BodyId::top_layer && b.axis == 0 ? w.layer : 0;
  }
  const Plane* find(BodyId id) const {
    for (int k = 0; k < planes; ++k)
      if (plane[k].id == id) return &plane[k];
    return nullptr;
  }
};

// Where the state's bodies stand in the scene.
BodyMotion motion_of(const Scene& scene, const State& state);

// Writes it back into the state: bodies, ledger, water, step.
void store(const BodyMotion& motion, State& state);

// Where a plane stands, m along its axis.
double place_of(const Scene& scene, const State& state, BodyId plane);

}  // namespace moraine::dem
