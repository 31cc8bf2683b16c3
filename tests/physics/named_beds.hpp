// Small beds that between them use every part of the law, of walls and of layers.
#pragma once
#include <vector>

#include "physics/scenes.hpp"

namespace moraine::dem {

struct NamedBed {
  const char* name;
  Bed bed;
};
inline void damp_grains(Scene& s, double gamma) {
  s.with(Material::grain).gamma_n = s.with(Material::grain).gamma_t = gamma;
}
// From a bed without side walls, one with them, and one of sizes 1:20.
inline std::vector<NamedBed> named_beds(const Bed& open, const Bed& walled, const Bed& graded) {
  std::vector<NamedBed> a{{"sheared bed, damped walls", sheared_bed(open)},
                          {"softening", sheared_bed(open)},
                          {"layer driven by stress", sheared_bed(open)},
                          {"held height", sheared_bed(open)},
                          {"swinging load, walls with k_t = 0, no ledger", sheared_bed(open)},
                          {"damped grains", sheared_bed(open)},
                          {"no friction", sheared_bed(open)},
                          {"cloud", cloud(700, 0.2, 5)},
                          {"small box", cloud(22, 0.065, 5)},
                          {"a side wall moves in", squeezed_bed(walled)},
                          {"sheared along side walls", sheared_between_walls(walled)},
                          {"sizes 1:20, damped, softening", sheared_graded_bed(graded)},
                          {"sizes 1:20, held height", sheared_graded_bed(graded)},
                          {"Hertz and Mindlin", sheared_bed(open)},
                          {"Hertz and Mindlin, restitution, rolling", sheared_bed(open)},
                          {"rolling", sheared_bed(open)},
                          {"restitution, cohesion, no ledger", sheared_bed(open)},
                          {"every law, along side walls", sheared_between_walls(walled)},
                          {"every law, sizes 1:20", sheared_graded_bed(graded)},
                          {"a velocity that changes, with a profile, on a slope", sheared_bed(open)},
                          {"stresses that change", sheared_bed(open)}};
  for (ContactParameters& p : a[1].bed.scene.contact) p.mu_d = 0.3;
  drive_top_layer(a[2].bed.scene, Drive::by(400));
  damp_grains(a[2].bed.scene, 5);
  drive_top_layer(a[3].bed.scene, Drive::at(0.2), true);
  Drive& load = a[4].bed.scene.body(BodyId::top_wall).z;
  load.amplitude = 200, load.frequency = 30;
  a[4].bed.scene.with(Material::wall).k_t = 0, a[4].bed.scene.ledger = false;
  damp_grains(a[5].bed.scene, 5);
  for (ContactParameters& p : a[6].bed.scene.contact) p.mu_s = p.mu_d = 0;
  damp_grains(a[11].bed.scene, 0.2);
  for (ContactParameters& p : a[11].bed.scene.contact) p.mu_d = 0.3;
  drive_top_layer(a[12].bed.scene, Drive::at(0.2), true);
  use_hertz(a[13].bed.scene);
  use_hertz(a[14].bed.scene, 0.7), resist_rolling(a[14].bed.scene);
  resist_rolling(a[15].bed.scene);
  a[16].bed.scene.ledger = false, cohere(a[16].bed.scene, 0.1);
  for (ContactParameters& p : a[16].bed.scene.contact) p.zeta = 0.1;
  use_every_law(a[17].bed.scene), use_every_law(a[18].bed.scene);
  Scene& uneven = a[19].bed.scene;
  uneven.down = {std::sin(0.1), 0, -std::cos(0.1)};
  drive_top_layer(uneven, changing_velocity());
  damp_grains(uneven, 5);
  a[20].bed.scene.body(BodyId::top_wall).z.rate = 2e4;
  drive_top_layer(a[20].bed.scene, changing_stress());
  return a;
}

}  // namespace moraine::dem
