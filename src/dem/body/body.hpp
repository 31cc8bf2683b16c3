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

// How the velocity of a layer is spread across y: shares of it between 0 and 1. `cosine` is
// (1 - cos(2 pi y/L))/2, `half` moves grains at y < L/2 only.
enum class Profile { uniform, linear, cosine, half };

// The share at y; length: m, of the box along y. Without the library's cosine, so that every backend has the
// same bits.
MORAINE_HD double share_at(Profile profile, double y, double length) {
  if (profile == Profile::uniform) return 1;
  const double u = y / length - ::floor(y / length);
  if (profile == Profile::linear) return u;
  if (profile == Profile::half) return u < 0.5 ? 1 : 0;
  const double a = std::numbers::pi * (u < 0.5 ? u : 1 - u), a2 = a * a;  // sin(a)^2
  double sum = 0;
  for (int k = 25; k > 1; k -= 2) sum = fma(-a2 / (k * (k - 1)), sum, -a2 / (k * (k - 1)));
  const double sine = fma(a, sum, a);
  return sine * sine;
}

// What moves a body along one axis: with a velocity or a stress, either of them a value that may grow at an
// even rate, and a sinusoid. What else there is against time (history.hpp) comes piece by piece, by
// Engine::redrive().
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
  double amplitude = 0;    // of a sinusoid, amplitude sin(2 pi frequency t + phase), in the unit of the value
  double frequency = 0;    // Hz
  double phase = 0;        // rad
  double rate = 0;         // of the value, its unit/s
  double since = 0;        // s, when the value was velocity or mean
  bool piecewise = false;  // other pieces are to come
  Profile profile = Profile::uniform;  // of a layer's velocity

  // t in s since the stage began.
  MORAINE_HD double stress(double t) const { return at_time(mean, t); }           // Pa
  MORAINE_HD double velocity_at(double t) const { return at_time(velocity, t); }  // m/s
  // Whether a velocity does not stay the same.
  MORAINE_HD bool changes() const { return piecewise || rate != 0 || amplitude != 0; }
  bool operator==(const Drive&) const = default;

  static Drive at(double velocity) { return {.kind = Kind::velocity, .velocity = velocity}; }
  static Drive by(double stress) { return {.kind = Kind::stress, .mean = stress}; }

 private:
  MORAINE_HD double at_time(double value, double t) const {
    if (rate != 0) value = fma(rate, t - since, value);
    return value + (amplitude != 0 ? amplitude * sine(2 * std::numbers::pi * frequency * t + phase) : 0);
  }
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
