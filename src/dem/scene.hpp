// A checked description of one stage: what surrounds the grains and what drives them. Constant while the
// stage runs, but for the time step where that follows the bed.
//
// Signs, for the whole code: x is the shear direction, z points up, gravity acts along -z or, on a slope,
// downhill towards +x as well. Stresses are
// positive in compression. An overlap is a negative delta_n. A force "on the wall" by the grains is positive
// upwards. SI units everywhere; J, N, Pa, m, s, kg.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "dem/body/body.hpp"
#include "dem/law/laws.hpp"
#include "dem/vec3.hpp"

namespace moraine::dem {

struct Scene {
  Vec3d box{0, 0, 0};  // m; side lengths. z matters only where it is periodic.
  bool periodic_x = true, periodic_y = true, periodic_z = false;
  double gravity = 9.80665;                                             // m/s2
  Vec3d down{0, 0, -1};                                                 // its direction, a unit vector
  std::int32_t materials = 1;                                           // of grains, in use
  std::array<double, grain_materials> density{2600, 2600, 2600, 2600};  // kg/m3, of each of them
  double least_inertia = 0;  // m; density scaling: smaller grains have the inertia of this radius; 0: none
  double fluid_density = 0;  // kg/m3, of water that fills the pores; 0: dry
  std::int64_t exchange_interval =
      0;              // steps between exchanges with pore water (fluid_coupling.hpp); 0: none
  double dt = 0;      // s
  double time_0 = 0;  // s, since the stage began, at step_0: where this dt began
  std::int64_t step_0 = 0;
  // A row for each ordered pair of materials, of the grain with the lower index and of what it touches: by
  // pair_number(). The rows of (a, b) and (b, a) are one, seen from either side.
  std::array<ContactParameters, material_pairs> contact;
  std::array<Body, body_ids> bodies = with_floor();  // by BodyId
  double neighbour_margin = 0;                       // m; 0: chosen from the grains. Never changes a result.
  bool ledger = true;                                // account for every joule (state.hpp)

  MORAINE_HD const ContactParameters& between(Material i, Material j) const {
    return contact[pair_number(i, j)];
  }
  MORAINE_HD ContactParameters& between(Material i, Material j) { return contact[pair_number(i, j)]; }
  // Of a grain of the first material.
  MORAINE_HD const ContactParameters& with(Material m) const { return between(Material::grain, m); }
  MORAINE_HD ContactParameters& with(Material m) { return between(Material::grain, m); }
  MORAINE_HD double density_of(Material m) const { return density[static_cast<int>(m)]; }  // of grains
  MORAINE_HD const Body& body(BodyId id) const { return bodies[static_cast<int>(id)]; }
  MORAINE_HD Body& body(BodyId id) { return bodies[static_cast<int>(id)]; }
  bool has(BodyId id) const { return body(id).is_there(); }
  bool is_periodic() const { return periodic_x && periodic_y && periodic_z; }  // in all directions
  bool has_planes() const {
    for (const BodyId id : planes)
      if (has(id)) return true;
    return false;
  }

  // Whether forces move a grain that is part of this body in no direction.
  MORAINE_HD bool is_rigid(BodyId part_of) const {
    return part_of != BodyId::none && body(part_of).is_held(2);
  }
  // Whether a layer's grains move past each other, as its velocity varies across y. They are no grains then
  // but the roughness of what slides over the bed, and do not touch: what is imposed would press them deep
  // into each other.
  MORAINE_HD bool slides_in_itself(BodyId part_of) const {
    return part_of != BodyId::none && body(part_of).x.profile != Profile::uniform;
  }
  // Whether grains that are part of these are left out as a pair.
  MORAINE_HD bool never_touch(BodyId a, BodyId b) const {
    return (is_rigid(a) && is_rigid(b)) || (a == b && slides_in_itself(a));
  }

  // kg; more than the weight tells, by density scaling. The second of a grain of this volume, m3.
  MORAINE_HD double inertial_mass(double r, Material m) const;
  double inertial_mass_of_volume(double volume, Material m) const;

  MORAINE_HD double area() const { return box.x * box.y; }  // m2
  MORAINE_HD double submerged_gravity(Material m) const {
    return gravity * (1 - fluid_density / density_of(m));
  }  // m/s2, less buoyancy

  // m/s2 along `down`, of a grain of this radius, whose weight density scaling leaves as it is.
  MORAINE_HD double fall(double r, Material m) const {
    const double part = r < least_inertia ? r / least_inertia : 1;
    return submerged_gravity(m) * (part * part * part);
  }

  // s, since the stage began.
  MORAINE_HD double time(std::int64_t step) const { return time_0 + static_cast<double>(step - step_0) * dt; }

  bool operator==(const Scene&) const = default;

 private:
  static constexpr std::array<Body, body_ids> with_floor() {
    std::array<Body, body_ids> b{};
    b.fill(Body{});  // GCC 12 leaves some of the defaults out
    b[static_cast<int>(BodyId::floor)] = floor_at(0);
    return b;
  }
};

MORAINE_HD double sphere_volume(double r) { return 4.0 / 3.0 * std::numbers::pi * r * r * r; }
MORAINE_HD double sphere_mass(double density, double r) { return density * sphere_volume(r); }

MORAINE_HD double Scene::inertial_mass(double r, Material m) const {
  return sphere_mass(density_of(m), r < least_inertia ? least_inertia : r);
}
inline double Scene::inertial_mass_of_volume(double volume, Material m) const {
  const double least = sphere_volume(least_inertia);
  return density_of(m) * (volume < least ? least : volume);
}

}  // namespace moraine::dem
