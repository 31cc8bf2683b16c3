// What pushes the bed from outside: the top wall and the layer of driven grains, and the account of the
// energy they give and the contacts take. One small struct of numbers; every thread advances a copy of its
// own and all stay equal.
#pragma once
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

// Sums over grains at one step, each in a fixed order.
struct Reaction {
  double wall_force = 0;     // N, on the top wall, upwards
  double shear_force = 0;    // N, x force on the top layer
  double wall_damping = 0;   // N, the viscous part of wall_force
  double layer_damping = 0;  // N, of shear_force
  double damping_power =
      0;  // W, of viscous forces on grains, at the velocities of the step (the layer's: n - 1/2)

  MORAINE_HD void add(const Reaction& r) {
    wall_force += r.wall_force, shear_force += r.shear_force;
    wall_damping += r.wall_damping, layer_damping += r.layer_damping;
    damping_power += r.damping_power;
  }
};

struct Drive {
  double wall_z = 0, wall_v = 0;       // m, m/s; v at n - 1/2
  double wall_dz = 0, wall_v_now = 0;  // m, of the last step; m/s, at n
  double wall_v_ahead = 0;             // m/s, at n as foreseen before its forces are known (viscous contacts)
  double layer_u = 0, layer_mass = 0;
  double layer_u_now = 0, layer_u_ahead = 0;  // m/s, as the wall's
  Reaction at, before;                        // at the present step and one earlier
  WaterReaction water, water_before;          // likewise; zero where the bed is dry
  double sigma = 0, sigma_before = 0;         // Pa, asked of the wall
  Ledger ledger;
  std::int64_t step = 0;

  // Takes the forces of the present step and closes the account of the step that led to it. Work is counted
  // with the mean of the forces before and after, as leapfrog does it.
  MORAINE_HD void close(const Scene& s, const Reaction& reaction, const WaterReaction& by_water) {
    take(s, reaction, by_water);
    const double area = s.box.x * s.box.y;
    if (s.top_wall.drive == TopWall::Drive::stress)
      ledger.top_wall -= 0.5 * (sigma_before + sigma) * area * wall_dz;
    if (s.top_wall.drive == TopWall::Drive::velocity)
      ledger.top_wall -=
          0.5 * ((before.wall_force + at.wall_force) + (water_before.wall + water.wall)) * wall_dz;
    if (s.shear.drive == Shear::Drive::velocity)
      ledger.layers -=
          0.5 * ((before.shear_force + at.shear_force) + (water_before.layer + water.layer)) * layer_u * s.dt;
    if (s.shear.drive == Shear::Drive::stress) ledger.layers += s.shear.stress * area * layer_u * s.dt;
    const double power = viscous_power();
    ledger.viscous += 0.5 * (ledger.viscous_power + power) * s.dt;
    ledger.viscous_power = power;
    ledger.water += by_water.work;
  }
  // W, that viscous contacts take.
  MORAINE_HD double viscous_power() const {
    return -at.damping_power - at.wall_damping * wall_v_now - at.layer_damping * (layer_u_now - layer_u);
  }
  MORAINE_HD void take(const Scene& s, const Reaction& reaction, const WaterReaction& by_water) {
    at = reaction;
    water = by_water;
    sigma = s.normal_stress(s.time(step));
    wall_v_now = fma(wall_acceleration(s), 0.5 * s.dt, wall_v);
    layer_u_now = fma(layer_acceleration(s), 0.5 * s.dt, layer_u);
  }

  // Wall and layer from step n to n + 1 (velocities from n - 1/2 to n + 1/2).
  MORAINE_HD void advance(const Scene& s) {
    before = at;
    water_before = water;
    sigma_before = sigma;
    const double acceleration = wall_acceleration(s);
    wall_v = fma(acceleration, s.dt, wall_v);
    wall_v_ahead = fma(acceleration, 0.5 * s.dt, wall_v);
    wall_dz = wall_v * s.dt;
    wall_z += wall_dz;
    const double layer = layer_acceleration(s);
    layer_u = fma(layer, s.dt, layer_u);
    layer_u_ahead = fma(layer, 0.5 * s.dt, layer_u);
    ++step;
  }
  MORAINE_HD void half_step(const Scene& s, double sign) {
    wall_v = fma(wall_acceleration(s), sign * 0.5 * s.dt, wall_v);
    layer_u = fma(layer_acceleration(s), sign * 0.5 * s.dt, layer_u);
  }

  MORAINE_HD double wall_acceleration(const Scene& s) const {
    if (s.top_wall.drive != TopWall::Drive::stress) return 0;
    return (at.wall_force + water.wall - sigma * (s.box.x * s.box.y)) / s.top_wall.mass;
  }
  MORAINE_HD double layer_acceleration(const Scene& s) const {
    if (s.shear.drive != Shear::Drive::stress) return 0;
    return (s.shear.stress * (s.box.x * s.box.y) + at.shear_force + water.layer) / layer_mass;
  }
};

}  // namespace moraine::dem
