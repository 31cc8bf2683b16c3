// Bodies bound the bed and drive it: planes (floor, top wall, side walls) and layers of grains that move as
// one (Damsgaard et al. 2013, par. 26). Along each axis a body is held, has a velocity given to it, or is
// pushed by a stress; a layer may leave its grains free along z. Where bodies are and how they move is in
// State::bodies; what moves them on is in motion.hpp.
#pragma once
#include <array>
#include <cstdint>
#include <numbers>

#include "dem/vec3.hpp"

namespace moraine::dem {

// Which body a grain is part of, or touches. The numbers stand in checkpoints, those of layers in snapshots,
// too.
enum class BodyId : std::uint8_t {
  none,
  bottom_layer,
  top_layer,
  floor,
  top_wall,
  x_low,
  x_high,
  y_low,
  y_high
};
constexpr int body_ids = 9;
constexpr BodyId planes[] = {BodyId::floor,  BodyId::top_wall, BodyId::x_low,
                             BodyId::x_high, BodyId::y_low,    BodyId::y_high};

const char* name_of(BodyId id);  // "the top wall"

// What moves a body along one axis.
struct Drive {
  enum class Kind {
    held,
    velocity,
    stress,
    free  // each grain of a layer by its own forces
  };
  Kind kind = Kind::held;
  double velocity = 0;  // m/s
  double mean =
      0;  // Pa, over the box's horizontal section: of a plane pressing on the bed, of a layer along the axis
  double amplitude = 0;  // Pa, of the sinusoid mean + amplitude sin(2 pi frequency t + phase)
  double frequency = 0;  // Hz
  double phase = 0;      // rad

  MORAINE_HD double stress(double t) const {  // Pa; t in s since the stage began
    return mean + (amplitude != 0 ? amplitude * ::sin(2 * std::numbers::pi * frequency * t + phase) : 0);
  }
  bool operator==(const Drive&) const = default;

  static Drive at(double velocity) { return {.kind = Kind::velocity, .velocity = velocity}; }
  static Drive by(double stress) { return {.kind = Kind::stress, .mean = stress}; }
};

// Grains are of up to four materials, all walls of one more. `grain` is the first of grains, the only one of
// most scenes. The numbers stand in checkpoints and snapshots.
enum class Material : std::uint8_t { grain, grain_2, grain_3, grain_4, wall };
constexpr int grain_materials = 4, materials = grain_materials + 1;

// Ordered pairs, of a grain and what it touches, numbered for tables of what they have between them.
constexpr int material_pairs = grain_materials * materials;
MORAINE_HD constexpr int pair_number(Material i, Material j) {
  return static_cast<int>(i) * materials + static_cast<int>(j);
}

struct Body {
  enum class Shape { absent, plane, layer };
  Shape shape = Shape::absent;
  std::int32_t axis = 2;  // of a plane's normal
  double facing = 1;      // of a plane: 1 where the grains are on its side of larger coordinates, else -1
  double place =
      0;  // m, along the axis, of a plane that does not move along it (else State says where it is)
  double mass =
      0;  // kg, of a plane that a stress drives; of a layer: what the stress moves besides its grains
  Material material = Material::wall;
  Drive x{}, y{}, z{};

  bool is_there() const { return shape != Shape::absent; }
  MORAINE_HD const Drive& along(int a) const { return a == 0 ? x : a == 1 ? y : z; }
  MORAINE_HD Drive& along(int a) { return a == 0 ? x : a == 1 ? y : z; }
  MORAINE_HD bool is_held(int a) const { return along(a).kind == Drive::Kind::held; }
  bool operator==(const Body&) const = default;
};

// Of the body with this name, where it is there; absent: of none.
constexpr Body::Shape shape_of(BodyId id) {
  if (id == BodyId::none) return Body::Shape::absent;
  return id == BodyId::bottom_layer || id == BodyId::top_layer ? Body::Shape::layer : Body::Shape::plane;
}

// Held unless told otherwise.
constexpr Body plane(int axis, double facing, double place = 0) {
  return {.shape = Body::Shape::plane, .axis = axis, .facing = facing, .place = place};
}
constexpr Body floor_at(double z) { return plane(2, 1, z); }
constexpr Body top_wall() { return plane(2, -1); }
// A layer of grains. hold_z: it keeps its height (else its grains move in z by their forces).
constexpr Body layer(const Drive& along_x, bool hold_z) {
  return {.shape = Body::Shape::layer,
          .material = Material::grain,
          .x = along_x,
          .z = {.kind = hold_z ? Drive::Kind::held : Drive::Kind::free}};
}

}  // namespace moraine::dem
