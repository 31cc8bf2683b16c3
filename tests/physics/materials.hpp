// Beds of several materials.
#pragma once
#include "physics/scenes.hpp"

namespace moraine::dem {

// Grains in turn of so many materials, unlike in density, stiffness, friction and damping; those of walls
// stay as they are against the first.
inline Bed of_materials(Bed bed, int count) {
  constexpr double part[grain_materials] = {1, 1.4, 0.7, 1.2};
  Scene& s = bed.scene;
  const ContactParameters grain = s.with(Material::grain), wall = s.with(Material::wall);
  s.materials = count;
  for (int a = 0; a < count; ++a) {
    s.density[static_cast<std::size_t>(a)] *= part[a];
    for (int b = 0; b < materials; ++b) {
      if (b >= count && b != static_cast<int>(Material::wall)) continue;
      ContactParameters& p = s.contact[static_cast<std::size_t>(pair_number(Material(a), Material(b)))];
      const bool at_wall = b == static_cast<int>(Material::wall);
      p = at_wall ? wall : grain;
      const double c = at_wall ? 1 : part[b], k = 2 * part[a] * c / (part[a] + c),
                   mu = std::sqrt(part[a] * c);
      p.k_n *= k, p.k_t *= k, p.mu_s *= mu, p.mu_d *= mu, p.gamma_n *= mu, p.gamma_t *= mu;
    }
  }
  bed.state.material.clear();
  for (const Index id : bed.state.id) bed.state.material.push_back(Material(id % count));
  return bed;
}

// Of which one pair alone softens and is damped, and one has no friction.
inline Bed of_unlike_laws(Bed bed, int count) {
  bed = of_materials(std::move(bed), count);
  Scene& s = bed.scene;
  const auto each = [&](Material a, Material b, auto&& change) {
    change(s.between(a, b));
    if (a != b) change(s.between(b, a));
  };
  each(Material::grain, Material::grain_2,
       [](ContactParameters& p) { p.mu_d *= 0.7, p.gamma_n = p.gamma_t = 3; });
  each(Material::grain_2, Material::grain_2, [](ContactParameters& p) { p.mu_s = p.mu_d = 0; });
  for (Contact& c : bed.state.contacts)
    if (s.between(bed.state.material_of(c.i), bed.state.material_of(c.j)).mu_s == 0) c.spring = {};
  return bed;
}

}  // namespace moraine::dem
