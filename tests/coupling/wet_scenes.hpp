// A packing in water, with and without walls, that several tests share.
#pragma once
#include "../physics/scenes.hpp"
#include "coupling/pore_water.hpp"

namespace moraine::coupling {

using dem::Scene;
using dem::State;
using dem::Vec3d;

struct WetBed {
  Scene scene;
  State state;
};

// Some 800 elastic grains of mixed size, pressed by a wall at 10 kPa without gravity and come to rest; x and y are
// periodic. softness divides the contacts' stiffness.
inline const WetBed& pressed_bed() {
  static const WetBed bed = [] {
    dem::Packing p;
    p.count = 800, p.columns_x = p.columns_y = 8;
    p.radius_mean = 0.01, p.radius_std = 0.001, p.cell = 1.05, p.seed = 5;
    const dem::Lattice lattice = dem::make_lattice(p);
    WetBed out;
    Scene& s = out.scene;
    s.box = {lattice.box_x * 0.9, lattice.box_y * 0.9, 1};
    s.box = {lattice.box_x, lattice.box_y, 1};
    s.gravity = 9.8;
    s.grain = s.wall = {1e6, 1e6, 50, 20, 0.2, 0.2};
    s.dt = 0.1 * std::sqrt(dem::mass(s, 0.008) / s.grain.k_n);
    State state = lattice.state;
    dem::sort_spatially(s, state);
    const auto engine = dem::make_engine(dem::Backend::cpu, 1);
    state = dem::run(*engine, s, state, 30000);
    dem::synchronise(s, state);
    s.gravity = 0;
    s.top_wall.drive = dem::TopWall::Drive::stress, s.top_wall.mass = 5, s.top_wall.sigma_0 = 1e4;
    double top = 0;
    for (dem::Index i = 0; i < state.size(); ++i) top = std::max(top, state.x[i].z + state.r[i]);
    state.wall_z = top, state.step = 0;
    state = dem::run(*engine, s, state, 40000);
    dem::synchronise(s, state);
    for (auto* v : {&state.v, &state.omega}) std::fill(v->begin(), v->end(), Vec3d{0, 0, 0});
    state.wall_v = 0, state.step = 0, state.ledger = {};
    dem::sort_spatially(s, state);
    out.state = state;
    return out;
  }();
  return bed;
}

// Of cells some 2.5 diameters wide over a bed.
inline Water water_over(const WetBed& bed, double height = 0) {
  Water w;
  w.present = true;
  const double h = 0.05, z = height > 0 ? height : bed.state.wall_z;
  w.cells = {std::max(1, static_cast<int>(bed.scene.box.x / h)), std::max(1, static_cast<int>(bed.scene.box.y / h)),
             std::max(1, static_cast<int>(z / h))};
  w.height = height;
  w.k_c = 1e-12;
  w.sides.high[2].kind = fluid::Side::Kind::pressure;
  return w;
}

}  // namespace moraine::coupling
