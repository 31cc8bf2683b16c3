// What the water minds of a scene's walls and of its driven layer. How a scene describes them is known here
// alone in src/coupling.
#pragma once
#include "coupling/ball.hpp"
#include "dem/body/motion.hpp"

namespace moraine::coupling {

inline bool has_floor(const dem::Scene& scene) { return scene.has(dem::BodyId::floor); }
inline bool has_wall(const dem::Scene& scene) { return scene.has(dem::BodyId::top_wall); }

// The sides of the grid at which planes stand.
inline Holds held_sides(const dem::Scene& scene) {
  Holds holds{};
  for (const dem::BodyId id : dem::planes) {
    const dem::Body& b = scene.body(id);
    if (b.is_there()) (b.facing > 0 ? holds.low : holds.high)[b.axis] = true;
  }
  return holds;
}

// kg, of a top wall that answers to forces; 0: of one that does not.
inline double mass_of_free_wall(const dem::Scene& scene) {
  const dem::Body& wall = scene.body(dem::BodyId::top_wall);
  return wall.z.kind == dem::Drive::Kind::stress ? wall.mass : 0;
}

// m, where a top wall stands.
inline double wall_z(const dem::BodyMotion& bodies) { return bodies.find(dem::BodyId::top_wall)->place; }

// Of the top layer's velocity that the grain has; 0 where it is no part of it.
inline double share_of_top_layer(const dem::Scene& scene, const dem::State& grains, dem::Index i) {
  if (grains.part_of[i] != dem::BodyId::top_layer) return 0;
  return dem::share_at(scene.body(dem::BodyId::top_layer).x.profile, grains.x[i].y, scene.box.y);
}

}  // namespace moraine::coupling
