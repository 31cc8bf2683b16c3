// A checked description of one stage: what surrounds the grains and what drives them. Constant while the
// stage runs, but for the time step where that follows the bed.
//
// Signs, for the whole code: x is the shear direction, z points up, gravity acts along -z. Stresses are
// positive in compression. An overlap is a negative delta_n. A force "on the wall" by the grains is positive
// upwards. SI units everywhere; J, N, Pa, m, s, kg.
#pragma once
#include <cmath>
#include <cstdint>
#include <numbers>

#include "dem/vec3.hpp"

namespace moraine::dem {

// Parameters of eqs. 6 and 8 of Damsgaard et al. (2013), with optional viscous damping.
struct ContactParameters {
  double k_n = 1.16e9;  // N/m
  double k_t = 1.16e9;  // N/m
  double gamma_n = 0;   // N s/m
  double gamma_t = 0;   // N s/m
  double mu_s = 0.3;    // static friction, >= mu_d
  double mu_d = 0.3;    // dynamic friction
  bool operator==(const ContactParameters&) const = default;
};

// The horizontal wall on top of the bed.
struct TopWall {
  enum class Drive { none, stress, velocity };
  Drive drive = Drive::none;
  double mass = 0;       // kg, for Drive::stress
  double sigma_0 = 0;    // Pa, mean normal stress
  double amplitude = 0;  // Pa, of the sinusoid sigma_0 + amplitude sin(2 pi frequency t + phase)
  double frequency = 0;  // Hz
  double phase = 0;      // rad
  double velocity = 0;   // m/s, for Drive::velocity; positive upwards
  bool operator==(const TopWall&) const = default;
};

// What moves the top layer of grains along x (par. 26). The bottom layer stands still.
struct Shear {
  enum class Drive { none, velocity, stress };
  Drive drive = Drive::none;
  double velocity = 0;  // m/s
  double stress = 0;    // Pa, on the whole cross-section
  bool hold_z = false;  // the layers also keep their height (else they move in z by their forces)
  bool operator==(const Shear&) const = default;
};

struct Scene {
  Vec3d box{0, 0, 0};  // m; side lengths. z matters only where it is periodic.
  bool periodic_x = true, periodic_y = true, periodic_z = false;
  bool floor = true;                   // fixed wall at z = 0
  double gravity = 9.80665;            // m/s2
  double density = 2600;               // kg/m3, of the grains
  double fluid_density = 0;            // kg/m3, of water that fills the pores; 0: dry
  std::int64_t exchange_interval = 0;  // steps between exchanges with pore water (surroundings.hpp); 0: none
  double dt = 0;                       // s
  double time_0 = 0;                   // s, since the stage began, at step_0: where this dt began
  std::int64_t step_0 = 0;
  ContactParameters grain, wall;  // grain to grain, grain to wall
  TopWall top_wall;
  Shear shear;
  double neighbour_margin = 0;  // m; 0: chosen from the grains. Never changes a result.
  bool ledger = true;           // account for every joule (state.hpp)

  double area() const { return box.x * box.y; }  // m2
  MORAINE_HD double submerged_gravity() const {
    return gravity * (1 - fluid_density / density);
  }  // m/s2, less buoyancy

  // s, since the stage began.
  MORAINE_HD double time(std::int64_t step) const { return time_0 + static_cast<double>(step - step_0) * dt; }

  // Normal stress asked of the top wall, Pa; t in s since the stage began.
  MORAINE_HD double normal_stress(double t) const {
    const TopWall& w = top_wall;
    return w.sigma_0 +
           (w.amplitude != 0 ? w.amplitude * ::sin(2 * std::numbers::pi * w.frequency * t + w.phase) : 0);
  }
  bool operator==(const Scene&) const = default;
};

MORAINE_HD double sphere_volume(double r) { return 4.0 / 3.0 * std::numbers::pi * r * r * r; }
MORAINE_HD double sphere_mass(double density, double r) { return density * sphere_volume(r); }

}  // namespace moraine::dem
