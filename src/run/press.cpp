#include "run/press.hpp"

#include <algorithm>
#include <cmath>

#include "dem/scene_check.hpp"
#include "error.hpp"

namespace moraine::run {

namespace {

// Of the way to the wanted stress that the contact network says, a jump takes this share: collisions of
// loose grains and the swings after a jump are averaged over some ten jumps.
constexpr double gain = 0.5;

constexpr double most_at_once = 0.01;  // of a side, in a jump

// To the wanted porosity at an even rate; the last jump goes all the way.
dem::Vec3d to_porosity(const Stage& stage, const dem::State& s, double ahead) {
  const double left = stage.end - stage.scene.time(s.step);
  const double share = left < 2 * ahead ? 1 : ahead / left;
  const double wanted = dem::solid_volume(s) / (1 - stage.porosity);
  const double factor = std::pow(wanted / dem::box_volume(stage.scene), share / 3);
  return {factor, factor, factor};
}

// Each side for itself, no faster than strain_rate.
dem::Vec3d to_pressure(const Stage& stage, const dem::State& s, double ahead) {
  const dem::BoxStress now = dem::box_stress(stage.scene, s);
  const double most = stage.strain_rate * ahead;
  dem::Vec3d factor{1, 1, 1};
  for (int a = 0; a < 3; ++a) {
    const double missing = gain * (stage.pressure - now.normal[a]);
    const double strain = now.stiffness > 0 ? missing / now.stiffness : most;
    factor[a] = 1 - std::clamp(strain, -most, most);
  }
  return factor;
}

void expect_looser(const std::string& stage, double now, double porosity) {
  if (!(porosity < now))
    throw error("stage ", stage, ": porosity = ", porosity, ", where the grains have ", now,
                " already; expected less than that (to press does not loosen)");
}

}  // namespace

bool presses(const Stage& stage) { return stage.kind == cases::Stage::Kind::press; }

double pressing_time(const std::string& stage, const dem::Scene& scene, const dem::State& s, double porosity,
                     double strain_rate) {
  const double solid = dem::solid_volume(s), volume = dem::box_volume(scene);
  expect_looser(stage, 1 - solid / volume, porosity);
  dem::Scene pressed = scene;
  pressed.box = std::cbrt(solid / (1 - porosity) / volume) * scene.box;
  try {
    dem::check_scene(pressed, s);
  } catch (const Error& why) {
    throw error("stage ", stage, ": at porosity = ", porosity, ", ", why.what(), ": more grains would do");
  }
  return std::log(volume * (1 - porosity) / solid) / (3 * strain_rate);
}

double squeezing_time(const std::string& stage, const dem::Scene& scene, const dem::State& s, double height_0,
                      double porosity, double strain_rate) {
  const double solid = dem::solid_volume(s) / scene.area();  // m
  expect_looser(stage, 1 - solid / s.wall_z(), porosity);
  return (s.wall_z() - solid / (1 - porosity)) / (strain_rate * height_0);
}

void expect_small_jumps(const Stage& stage) {
  const double ahead = steps_between_presses * stage.scene.dt;
  if (stage.strain_rate * ahead > most_at_once)
    throw error("stage ", stage.name, ": strain_rate = ", stage.strain_rate, " 1/s shortens each side by ",
                stage.strain_rate * ahead, " of it in one jump, of ", steps_between_presses, " steps of ",
                stage.scene.dt, " s; expected at most ", most_at_once / ahead, " 1/s");
}

dem::Vec3d next_press(const Stage& stage, const dem::State& s) {
  expect_small_jumps(stage);
  const double ahead = steps_between_presses * stage.scene.dt;
  return stage.porosity > 0 ? to_porosity(stage, s, ahead) : to_pressure(stage, s, ahead);
}

}  // namespace moraine::run
