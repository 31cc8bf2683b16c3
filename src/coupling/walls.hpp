// What the water minds of a scene's walls and of its driven layer. How a scene describes them is known here
// alone in src/coupling.
#pragma once
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::coupling {

inline bool has_floor(const dem::Scene& scene) { return scene.floor; }
inline bool has_wall(const dem::Scene& scene) { return scene.top_wall.drive != dem::TopWall::Drive::none; }

// kg, of a top wall that answers to forces; 0: of one that does not.
inline double mass_of_free_wall(const dem::Scene& scene) {
  return scene.top_wall.drive == dem::TopWall::Drive::stress ? scene.top_wall.mass : 0;
}

inline bool in_top_layer(const dem::State& grains, dem::Index i) { return grains.role[i] == dem::Role::top; }

}  // namespace moraine::coupling
