#include "run/stages.hpp"

#include <algorithm>
#include <cmath>

#include "dem/engine.hpp"
#include "dem/order.hpp"
#include "dem/packing.hpp"
#include "error.hpp"
#include "output/files.hpp"
#include "run/schedule.hpp"

namespace moraine::run {

namespace {

using Kind = cases::Stage::Kind;

bool shears(Kind k) { return k == Kind::shear || k == Kind::shear_stress; }

double bed_top(const dem::State& s) {
  double top = 0;
  for (dem::Index i = 0; i < s.size(); ++i) top = std::max(top, s.x[i].z + s.r[i]);
  return top;
}

// kg; 0.001 rho N pi (cell/2)^3 gives the 6.4 kg of Table 1.
double default_wall_mass(const cases::Case& c, double grains, double cell) {
  return 0.001 * c.grains.density * grains * std::numbers::pi * std::pow(cell / 2, 3);
}

// par. 26: the lowest and the highest layer, by grain centres. They keep their part through several shear
// stages.
void choose_layers(const cases::Stage& stage, dem::State& s) {
  if (std::any_of(s.role.begin(), s.role.end(), [](dem::Role r) { return r != dem::Role::free; })) return;
  const double largest = 2 * *std::max_element(s.r.begin(), s.r.end());
  const double bottom = stage.bottom_layer < 0 ? largest : stage.bottom_layer;
  const double top = bed_top(s) - (stage.top_layer < 0 ? largest : stage.top_layer);
  for (dem::Index i = 0; i < s.size(); ++i)
    s.role[i] = s.x[i].z < bottom ? dem::Role::bottom : s.x[i].z > top ? dem::Role::top : dem::Role::free;
  if (std::count(s.role.begin(), s.role.end(), dem::Role::top) == 0)
    throw error("stage ", stage.name, ": no grain lies in the top layer; expected a thicker top_layer");
  s.x_start = s.x;  // displacement counts from here
}

void set_top_wall(const cases::Case& c, const cases::Stage& stage, const Start& start, dem::Scene& scene,
                  dem::State& s) {
  using Wanted = cases::Stage::TopWall;
  using dem::TopWall;
  Wanted wanted = stage.top_wall;
  TopWall& wall = scene.top_wall;
  if (wanted == Wanted::automatic && stage.kind == Kind::uniaxial) {
    wall.drive = TopWall::Drive::velocity;
  } else {
    if (wanted == Wanted::automatic) wanted = stage.kind == Kind::settle ? Wanted::none : Wanted::stress;
    wall.drive = wanted == Wanted::none     ? TopWall::Drive::none
                 : wanted == Wanted::stress ? TopWall::Drive::stress
                                            : TopWall::Drive::velocity;
  }
  if (wall.drive == TopWall::Drive::none) {
    s.wall_z = 0;
    return;
  }
  if (s.wall_z <= 0) s.wall_z = bed_top(s);  // lowered onto the highest grain
  if (stage.kind == Kind::uniaxial) wall.velocity = -stage.strain_rate * s.wall_z;
  wall.mass = c.wall_mass > 0 ? c.wall_mass : start.wall_mass;
  wall.sigma_0 = stage.normal_stress, wall.amplitude = stage.normal_stress_amplitude;
  wall.frequency = stage.normal_stress_frequency, wall.phase = stage.normal_stress_phase;
}

}  // namespace

double mean_diameter(const dem::State& s) {
  double sum = 0;
  for (const double r : s.r) sum += 2 * r;
  return sum / s.size();
}

double sauter_diameter(const dem::State& s) {
  double volume = 0, area = 0;
  for (const double r : s.r) volume += r * r * r, area += r * r;
  return 2 * volume / area;
}

// dt = f sqrt(min m / max k), eq. 9; the walls count among the k.
double step_by_eq_9(const dem::Scene& scene, const dem::State& s, double f) {
  const double m = dem::sphere_mass(scene.density, *std::min_element(s.r.begin(), s.r.end()));
  return f * std::sqrt(m / std::max({scene.grain.k_n, scene.grain.k_t, scene.wall.k_n, scene.wall.k_t}));
}

Start start_of(const cases::Case& c) {
  if (!c.start.empty()) {
    output::Checkpoint before = output::read_checkpoint(c.start);
    dem::synchronise(before.scene, before.state);
    if (!before.finished)
      throw error(c.start.string(), ": the case it belongs to has not finished; run it to its end first");
    Start s{std::move(before.state), before.scene.box.x,         before.scene.box.y,
            before.scene.box.z,      before.scene.top_wall.mass, std::move(before.water)};
    if (c.box_x > 0) s.box_x = c.box_x;
    if (c.box_y > 0) s.box_y = c.box_y;
    if (c.box_z > 0) s.box_z = c.box_z;
    const double r_max = *std::max_element(s.state.r.begin(), s.state.r.end());
    if (s.wall_mass <= 0) s.wall_mass = default_wall_mass(c, s.state.size(), c.grains.cell * 2 * r_max);
    return s;
  }
  const cases::Grains& g = c.grains;
  dem::Packing p;
  p.count = g.count;
  p.distribution = g.distribution == "uniform" ? dem::Packing::Distribution::uniform
                                               : dem::Packing::Distribution::lognormal;
  p.radius_mean = g.radius_mean, p.radius_std = g.radius_std;
  p.radius_min = g.radius_min, p.radius_max = g.radius_max;
  p.seed = g.seed, p.columns_x = g.columns_x, p.columns_y = g.columns_y, p.cell = g.cell;
  p.box_x = c.box_x, p.box_y = c.box_y;
  dem::Lattice lattice = dem::make_lattice(p);
  const double wall_mass = default_wall_mass(c, lattice.state.size(), lattice.cell);
  return {std::move(lattice.state), lattice.box_x, lattice.box_y, c.box_z, wall_mass, {}};
}

namespace {

fluid::Side side_of(const cases::FluidSide& side) {
  using Kind = cases::FluidSide::Kind;
  if (side.kind == Kind::pressure) return {fluid::Side::Kind::pressure, side.pressure};
  if (side.kind == Kind::flux) return {fluid::Side::Kind::flux, side.flux};
  return {};
}

coupling::Water water_of(const cases::Case& c, const cases::Stage& stage, const dem::Scene& scene,
                         double height, double diameter, double sauter) {
  coupling::Water w;
  w.present = stage.fluid;
  if (!w.present) return w;
  const cases::Fluid& f = c.fluid;
  w.viscosity = f.viscosity, w.compressibility = f.compressibility;
  w.k_c = f.permeability_factor > 0 ? f.permeability_factor : sauter * sauter / 180;
  w.porosity_range = {f.porosity_min, f.porosity_max};
  w.height = f.height > 0 ? f.height : height + f.cell * diameter;
  const bool wall = scene.top_wall.drive != dem::TopWall::Drive::none;
  const double length[3] = {scene.box.x, scene.box.y, wall ? height : w.height};
  const std::int64_t wanted[3] = {f.cells_x, f.cells_y, f.cells_z};
  for (int a = 0; a < 3; ++a) {
    const double cells = wanted[a] > 0 ? static_cast<double>(wanted[a])
                                       : std::max(1.0, std::floor(length[a] / (f.cell * diameter)));
    if (!(cells <= 1e6))
      throw error("pore water: ", cells, " cells along ", "xyz"[a],
                  "; expected at most a million (fluid.cell, fluid.cells_", "xyz"[a], ")");
    w.cells[a] = static_cast<int>(cells);
  }
  using Kind = fluid::Side::Kind;
  w.top = coupling::TopSide(int(stage.fluid_top));
  if (w.top == coupling::TopSide::drained)
    w.sides.high[2] = {Kind::pressure, stage.top_pressure, stage.top_pressure_amplitude,
                       stage.top_pressure_frequency, stage.top_pressure_phase};
  if (stage.fluid_bottom == cases::Stage::FluidBottom::pressure)
    w.sides.low[2] = {Kind::pressure, stage.bottom_pressure};
  if (stage.fluid_bottom == cases::Stage::FluidBottom::flux) w.sides.low[2] = {Kind::flux, stage.bottom_flux};
  w.sides.low[0] = side_of(f.x_low), w.sides.high[0] = side_of(f.x_high);
  w.sides.low[1] = side_of(f.y_low), w.sides.high[1] = side_of(f.y_high);
  w.closure = coupling::Closure(int(f.closure));
  // After a restart the interval of the stage: from other contacts another one would be chosen.
  w.interval = scene.exchange_interval > 0 ? scene.exchange_interval : f.exchange_interval;
  w.solver = coupling::Solver(int(f.solver)), w.tolerance = f.tolerance;
  return w;
}

}  // namespace

std::unique_ptr<coupling::PoreWater> fill(Stage& stage, const dem::State& grains,
                                          const coupling::WaterState& before, bool restart) {
  if (!stage.water.present) return nullptr;
  auto water = coupling::make_pore_water(stage.water, stage.scene, grains, before, restart);
  stage.scene.exchange_interval = water->interval();
  if (last_step(stage) < stage.scene.exchange_interval)
    throw error("stage ", stage.name, ": lasts ", stage.duration, " s, less than the ",
                static_cast<double>(water->interval()) * stage.scene.dt,
                " s between two exchanges of grains and water (", water->interval(),
                " steps); expected a longer stage, or a shorter fluid.exchange_interval");
  return water;
}

Stage describe(const cases::Case& c, std::size_t index, const dem::Scene& scene, double height_0,
               const dem::State& state) {
  const cases::Stage& stage = c.stages.at(index);
  Stage out;
  out.name = stage.name, out.kind = stage.kind, out.scene = scene, out.height_0 = height_0;
  out.diameter = mean_diameter(state);
  out.water = water_of(c, stage, scene, height_0, out.diameter, sauter_diameter(state));
  out.strain_rate = shears(stage.kind) ? scene.shear.velocity / height_0 : stage.strain_rate;
  out.duration = stage.duration > 0 ? stage.duration : stage.strain / std::abs(out.strain_rate);
  out.series_interval = c.output.series_interval, out.snapshot_interval = c.output.snapshot_interval;
  return out;
}

Stage prepare(const cases::Case& c, std::size_t index, const Start& start, dem::State& s) {
  const cases::Stage& stage = c.stages.at(index);
  dem::Scene scene;
  scene.box = {start.box_x, start.box_y, start.box_z};
  scene.periodic_x = c.periodic_x, scene.periodic_y = c.periodic_y, scene.periodic_z = c.periodic_z;
  scene.floor = c.floor, scene.gravity = c.gravity, scene.density = c.grains.density;
  scene.grain = {c.k_n, c.k_t, stage.gamma_n, stage.gamma_t, stage.mu_s, stage.mu_d};
  scene.wall = {c.k_n, c.wall_k_t, stage.wall_gamma_n, stage.wall_gamma_t, stage.wall_mu, stage.wall_mu};
  scene.neighbour_margin = c.neighbour_margin, scene.ledger = c.ledger;
  scene.fluid_density = stage.fluid ? c.fluid.density : 0;

  if (stage.zero_kinematics) {
    for (auto* v : {&s.v, &s.omega, &s.rotation}) std::fill(v->begin(), v->end(), dem::Vec3d{0, 0, 0});
    s.wall_v = s.layer_u = 0;
  }
  if (stage.clear_history) {
    for (dem::Contact& contact : s.contacts) contact.delta_t = {0, 0, 0}, contact.slipping = 0;
    for (dem::WallContact& w : s.wall_contacts) w.delta_t = {0, 0, 0}, w.slipping = 0;
  }
  set_top_wall(c, stage, start, scene, s);
  const double height_0 = s.wall_z > 0 ? s.wall_z : bed_top(s);
  if (shears(stage.kind)) {
    choose_layers(stage, s);
    scene.shear.drive = stage.kind == Kind::shear ? dem::Shear::Drive::velocity : dem::Shear::Drive::stress;
    scene.shear.velocity = stage.velocity != 0 ? stage.velocity : stage.strain_rate * height_0;
    scene.shear.stress = stage.shear_stress;
    scene.shear.hold_z = stage.hold_layer_height;
  } else {
    std::fill(s.role.begin(), s.role.end(), dem::Role::free);
    s.x_start = s.x;
    s.layer_u = 0;
  }
  s.step = 0, s.staggered = false, s.ledger = {};
  s.water_force.clear(), s.water = {};
  dem::sort_spatially(scene, s);
  scene.dt = c.automatic_dt ? c.safety * critical_step(scene, s)
             : c.dt > 0     ? c.dt
                            : step_by_eq_9(scene, s, stage.f);
  Stage out = describe(c, index, scene, height_0, s);
  if (c.automatic_dt) fit_step(out, s, scene.dt);
  return out;
}

}  // namespace moraine::run
