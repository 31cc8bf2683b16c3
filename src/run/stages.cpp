#include "run/stages.hpp"

#include <algorithm>
#include <cmath>

#include "case/csv.hpp"
#include "case/materials.hpp"
#include "dem/engine.hpp"
#include "dem/memory_order.hpp"
#include "dem/observe.hpp"
#include "dem/packing.hpp"
#include "dem/state_rows.hpp"
#include "dem/uses.hpp"
#include "error.hpp"
#include "output/sealed.hpp"
#include "run/material_of_grains.hpp"
#include "run/needs.hpp"
#include "run/own_grains.hpp"
#include "run/press.hpp"
#include "run/schedule.hpp"

namespace moraine::run {

namespace {

using Kind = cases::Stage::Kind;
using dem::BodyId;

// kg; 0.001 rho N pi (cell/2)^3 gives the 6.4 kg of Table 1.
double default_wall_mass(const cases::Case& c, double grains, double cell) {
  return 0.001 * c.grains.density * grains * std::numbers::pi * std::pow(cell / 2, 3);
}

bool pressures_cover(const coupling::Water& w, double end) {
  return w.sides.high[2].history.covers(end) && w.sides.low[2].history.covers(end);
}

dem::Body top_wall_of(const cases::Case& c, const cases::Stage& stage, const Start& start, double height) {
  using Wanted = cases::Stage::TopWall;
  const bool automatic = stage.top_wall == Wanted::automatic;
  const bool given = stage.top_wall == Wanted::fixed || (automatic && stage.kind == Kind::uniaxial);
  const bool none = stage.kind == Kind::settle || stage.kind == Kind::press;
  const bool stress = stage.top_wall == Wanted::stress || (automatic && !none);
  if (!given && !stress) return {};
  dem::Body wall = dem::top_wall();
  wall.mass = c.wall_mass > 0 ? c.wall_mass : start.wall_mass;
  if (given)
    wall.z = dem::Drive::at(stage.kind == Kind::uniaxial ? -stage.strain_rate * height : 0);
  else
    wall.z = {.kind = dem::Drive::Kind::stress,
              .mean = stage.normal_stress,
              .amplitude = stage.normal_stress_amplitude,
              .frequency = stage.normal_stress_frequency,
              .phase = stage.normal_stress_phase};
  return wall;
}

// All but the time step. height: m, H_0.
dem::Scene scene_of(const cases::Case& c, const cases::Stage& stage, const Start& start,
                    const dem::Vec3d& box, double height) {
  dem::Scene scene;
  scene.box = box;
  scene.periodic_x = c.periodic_x, scene.periodic_y = c.periodic_y, scene.periodic_z = c.periodic_z;
  scene.gravity = c.gravity, scene.density.fill(c.grains.density);
  if (c.slope != 0) scene.down = {std::sin(c.slope), 0, -std::cos(c.slope)};
  scene.least_inertia = c.density_scaling;
  dem::ContactParameters &grain = scene.with(dem::Material::grain), &wall = scene.with(dem::Material::wall);
  grain = c.contact, wall = c.wall;
  grain.gamma_n = stage.gamma_n, grain.gamma_t = stage.gamma_t;
  grain.mu_s = stage.mu_s, grain.mu_d = stage.mu_d;
  wall.gamma_n = stage.wall_gamma_n, wall.gamma_t = stage.wall_gamma_t;
  grain.zeta = dem::damping_ratio(stage.restitution);
  wall.zeta = dem::damping_ratio(stage.wall_restitution);
  for (dem::ContactParameters& p : scene.contact)
    p.density_i = p.density_j = c.grains.density, p.least_inertia = scene.least_inertia;
  wall.mu_s = wall.mu_d = stage.wall_mu;
  cases::set_materials(c, stage, scene);
  scene.neighbour_margin = c.neighbour_margin, scene.ledger = c.ledger;
  scene.fluid_density = stage.fluid ? c.fluid.density : 0;
  if (!c.floor) scene.body(BodyId::floor) = {};
  if (c.walls_x)
    scene.body(BodyId::x_low) = dem::plane(0, 1, 0),
    scene.body(BodyId::x_high) = dem::plane(0, -1, scene.box.x);
  if (c.walls_y)
    scene.body(BodyId::y_low) = dem::plane(1, 1, 0),
    scene.body(BodyId::y_high) = dem::plane(1, -1, scene.box.y);
  scene.body(BodyId::top_wall) = top_wall_of(c, stage, start, height);
  if (!shears(stage.kind)) return scene;
  using Drive = dem::Drive;
  const double velocity = stage.velocity != 0 ? stage.velocity : stage.strain_rate * height;
  const Drive along_x = stage.kind == Kind::shear ? Drive{.kind = Drive::Kind::velocity,
                                                          .velocity = velocity,
                                                          .amplitude = stage.velocity_amplitude,
                                                          .frequency = stage.velocity_frequency,
                                                          .phase = stage.velocity_phase,
                                                          .profile = stage.profile}
                                                  : Drive{.kind = Drive::Kind::stress,
                                                          .mean = stage.shear_stress,
                                                          .amplitude = stage.shear_stress_amplitude,
                                                          .frequency = stage.shear_stress_frequency,
                                                          .phase = stage.shear_stress_phase};
  scene.body(BodyId::bottom_layer) = dem::layer({}, stage.hold_layer_height);
  scene.body(BodyId::top_layer) = dem::layer(along_x, stage.hold_layer_height);
  scene.body(BodyId::top_layer).mass = stage.layer_mass;
  return scene;
}

output::Checkpoint read_start(const std::filesystem::path& path) {
  try {
    return output::read_checkpoint(path);
  } catch (const output::Damaged& e) {
    throw error(
        e.what(),
        "; expected the checkpoint of a finished case, a snapshot, a table NAME.csv or a LAMMPS data file "
        "NAME.data. A checkpoint that is damaged comes anew where its case is run again; --resume does that "
        "from the one before");
  }
}

}  // namespace

std::vector<std::filesystem::path> input_files(const cases::Case& c) {
  std::vector<std::filesystem::path> files;
  if (has_own_grains(c.start)) files.push_back(c.start);
  if (c.start.empty() && c.grains.distribution == "sieves") files.push_back(c.grains.sieves);
  files.insert(files.end(), c.tables.begin(), c.tables.end());
  return files;
}

std::string input(const std::filesystem::path& file) {
  return file.filename().string() + " " + output::digest_of_file(file);
}

bool shears(Kind k) { return k == Kind::shear || k == Kind::shear_stress; }

double layer_velocity(const cases::Stage& stage, const dem::Scene& scene) {
  const dem::Drive& drive = scene.body(BodyId::top_layer).x;
  if (drive.kind != dem::Drive::Kind::velocity) return 0;
  if (!drive.changes()) return drive.velocity;
  return std::copysign(std::abs(stage.velocity) + std::abs(drive.amplitude), stage.velocity);
}

void take_layers_away(dem::Scene& scene) {
  scene.body(BodyId::bottom_layer) = scene.body(BodyId::top_layer) = {};
}

double sauter_diameter(const dem::State& s) {
  double volume = 0, area = 0;
  for (const double r : s.r) volume += r * r * r, area += r * r;
  return 2 * volume / area;
}

// dt = f sqrt(min m / max k), eq. 9; the walls count among the k. Of Hertz and Mindlin those at the usual
// overlap.
double step_by_eq_9(const dem::Scene& scene, const dem::State& s, double f) {
  const double r = *std::min_element(s.r.begin(), s.r.end());
  double k = 0;
  const auto take = [&](const dem::ContactParameters& p, const dem::Geometry<double>& g) {
    k = std::max({k, dem::stiffness_of(p, g), dem::tangential_stiffness_of(p, g)});
    if (dem::Rolling::used(p)) k = std::max(k, p.k_roll);
    if (dem::Twisting::used(p)) k = std::max(k, p.k_twist);
  };
  dem::for_each_pair_of_grains(scene,
                               [&](const dem::ContactParameters& p) { take(p, dem::usual_contact(r, r)); });
  dem::for_each_pair_with_walls(
      scene, [&](const dem::ContactParameters& p) { take(p, dem::usual_contact_at_plane(r)); });
  return f * std::sqrt(dem::least_mass(scene, s) / k);
}

static double step_of(const cases::Case& c, const cases::Stage& stage, const dem::Scene& scene,
                      const dem::State& s) {
  return c.dt > 0 ? c.dt : step_by_eq_9(scene, s, stage.f);
}

// A table of sieves. Errors name file and line.
static std::vector<dem::Sieve> sieves_in(const std::filesystem::path& file) {
  const cases::CsvTable table(file);
  table.expect_only({"size", "finer"});
  const std::vector<double> size = table.column("size", "m"), finer = table.column("finer", "1");
  std::vector<dem::Sieve> sieves;
  for (std::size_t k = 0; k < size.size(); ++k) sieves.push_back({size[k], finer[k]});
  if (sieves.size() < 2)
    throw error(file.string(), ": has ", sieves.size(),
                " sieve; expected two or more, from 0 to 100 % finer");
  dem::ranges_of(sieves, [&](std::size_t k) { return table.at(k); });
  return sieves;
}

// Springs of a snapshot, which were found from its forces with contact.k_t (or contact.young).
static void springs_of_pairs(const cases::Case& c, dem::State& s) {
  if (s.material.empty()) return;
  dem::Scene scene;
  scene.with(dem::Material::grain) = c.contact;
  cases::set_materials(c, c.stages.at(0), scene);
  const auto firmness = [](const dem::ContactParameters& p) { return p.k_t + p.G_star; };  // one of both
  for (dem::Contact& contact : s.contacts) {
    const double of_pair = firmness(scene.between(s.material_of(contact.i), s.material_of(contact.j)));
    contact.spring.delta_t = (of_pair > 0 ? firmness(c.contact) / of_pair : 0) * contact.spring.delta_t;
  }
}

static Start grains_of(const cases::Case& c) {
  if (has_own_grains(c.start)) {
    OwnGrains own = read_own_grains(c);
    take_materials(c, own.state, [&](dem::Index i) { return own.at(i); });
    if (output::is_snapshot(c.start)) springs_of_pairs(c, own.state);
    Start s{{}, own.box_x, own.box_y, own.box_z, 0};
    s.before.state = std::move(own.state), s.roles = std::move(own.roles), s.note = std::move(own.note);
    double volume = 0;
    for (const double r : s.before.state.r) volume += r * r * r;
    const double n = s.before.state.size();
    s.wall_mass = default_wall_mass(c, n, c.grains.cell * 2 * std::cbrt(volume / n));
    return s;
  }
  if (!c.start.empty()) {
    Start s{read_start(c.start), c.box_x, c.box_y, c.box_z, 0};
    if (!s.before.finished)
      throw error(c.start.string(), ": the case it belongs to has not finished; run it to its end first");
    if (s.before.state.r.empty()) throw error(c.start.string(), ": has no grains");
    const auto has_rule = [](const cases::GrainMaterial& m) { return !m.sizes.empty() || !m.layer.empty(); };
    if (!s.before.materials.empty() && std::ranges::any_of(c.materials, has_rule))
      s.note = text("grains keep the materials that the start names (", s.before.materials,
                    "): material.sizes and material.layer do not count");
    s.before.rows.clear(), s.before.snapshots.clear();
    s.before.stage = 0, s.before.start.time = 0, s.before.finished = false;
    take_materials(c, s.before.state, s.before.scene, s.before.materials,
                   [&](dem::Index i) { return text(c.start.string(), ": grain ", s.before.state.id[i]); });
    const dem::Scene& scene = s.before.scene;
    expect_same_sides(c, scene.box, {scene.periodic_x, scene.periodic_y, scene.periodic_z});
    if (s.box_x <= 0) s.box_x = scene.box.x;
    if (s.box_y <= 0) s.box_y = scene.box.y;
    if (s.box_z <= 0) s.box_z = scene.box.z;
    const dem::State& state = s.before.state;
    const double r_max = *std::max_element(state.r.begin(), state.r.end());
    const double mass = scene.body(BodyId::top_wall).mass;
    s.wall_mass = mass > 0 ? mass : default_wall_mass(c, state.size(), c.grains.cell * 2 * r_max);
    return s;
  }
  expect_room(c);
  const cases::Grains& g = c.grains;
  dem::Packing p;
  p.count = g.count;
  using Distribution = dem::Packing::Distribution;
  p.distribution = g.distribution == "uniform"     ? Distribution::uniform
                   : g.distribution == "lognormal" ? Distribution::lognormal
                   : g.distribution == "bimodal"   ? Distribution::bimodal
                                                   : Distribution::ranges;
  if (g.distribution == "fractal") p.ranges = {{g.radius_min, g.radius_max, g.fractal_dimension, 1}};
  if (g.distribution == "sieves") p.ranges = dem::ranges_of(sieves_in(g.sieves));
  if (g.placement == "random") p.placement = dem::Packing::Placement::random;
  p.solid_fraction = g.solid_fraction;
  p.periodic_x = c.periodic_x, p.periodic_y = c.periodic_y, p.periodic_z = c.periodic_z;
  p.radius_mean = g.radius_mean, p.radius_std = g.radius_std;
  p.fine_radius_mean = g.fine_radius_mean, p.fine_radius_std = g.fine_radius_std;
  p.fine_fraction = g.fine_fraction;
  p.radius_min = g.radius_min, p.radius_max = g.radius_max;
  p.seed = g.seed, p.columns_x = g.columns_x, p.columns_y = g.columns_y, p.cell = g.cell;
  p.box_x = c.box_x, p.box_y = c.box_y, p.box_z = c.box_z;
  dem::LooseGrains loose = dem::make_loose_grains(p);
  Start s{{},
          loose.box_x,
          loose.box_y,
          loose.box_z > 0 ? loose.box_z : c.box_z,
          default_wall_mass(c, loose.state.size(), loose.cell)};
  s.before.state = std::move(loose.state);
  take_materials(c, s.before.state, [&](dem::Index i) { return text("grain ", s.before.state.id[i]); });
  return s;
}

Start start_of(const cases::Case& c) {
  Start start = grains_of(c);
  for (const std::filesystem::path& file : input_files(c))
    start.inputs += (start.inputs.empty() ? "" : ", ") + input(file);
  return start;
}

namespace {

fluid::Side side_of(const cases::FluidSide& side) {
  using Kind = cases::FluidSide::Kind;
  if (side.kind == Kind::pressure) return {fluid::Side::Kind::pressure, side.pressure};
  if (side.kind == Kind::flux) return {fluid::Side::Kind::flux, side.flux};
  return {};
}

coupling::Water water_of(const cases::Case& c, const cases::Stage& stage, const dem::Scene& scene,
                         double height, double diameter) {
  coupling::Water w;
  w.present = stage.fluid;
  if (!w.present) return w;
  const cases::Fluid& f = c.fluid;
  w.viscosity = f.viscosity, w.compressibility = f.compressibility;
  w.k_c = f.permeability_factor;
  w.porosity_range = {f.porosity_min, f.porosity_max};
  w.height = f.height > 0 ? f.height : height + f.cell * diameter;
  const bool wall = scene.has(BodyId::top_wall);
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
    w.sides.high[2] = {Kind::pressure,
                       stage.top_pressure,
                       stage.top_pressure_amplitude,
                       stage.top_pressure_frequency,
                       stage.top_pressure_phase,
                       stage.top_pressure_history};
  if (stage.fluid_bottom == cases::Stage::FluidBottom::pressure)
    w.sides.low[2] = {Kind::pressure,
                      stage.bottom_pressure,
                      stage.bottom_pressure_amplitude,
                      stage.bottom_pressure_frequency,
                      stage.bottom_pressure_phase,
                      stage.bottom_pressure_history};
  if (stage.fluid_bottom == cases::Stage::FluidBottom::flux) w.sides.low[2] = {Kind::flux, stage.bottom_flux};
  w.sides.low[0] = side_of(f.x_low), w.sides.high[0] = side_of(f.x_high);
  w.sides.low[1] = side_of(f.y_low), w.sides.high[1] = side_of(f.y_high);
  w.closure = coupling::Closure(int(f.closure));
  w.interval = f.exchange_interval;
  w.solver = coupling::Solver(int(f.solver)), w.tolerance = f.tolerance;
  return w;
}

double duration_of(const cases::Stage& stage, const output::Checkpoint& now);

// Whether the stage asks for just what drives the grains already, and that lasts for it.
bool goes_on(const cases::Case& c, const cases::Stage& stage, const Start& start, const dem::Vec3d& box,
             const output::Checkpoint& now) {
  if (!now.state.staggered || stage.zero_kinematics || stage.clear_history) return false;
  if (c.automatic_dt && !(now.critical_step > 0)) return false;  // dt did not follow the bed so far
  const dem::Scene& before = now.scene;
  dem::Scene scene = scene_of(c, stage, start, box, now.height_0);
  scene.dt = c.automatic_dt ? before.dt : step_of(c, stage, scene, now.state);
  scene.time_0 = before.time_0, scene.step_0 = before.step_0;
  scene.exchange_interval = before.exchange_interval;
  scene.neighbour_margin = before.neighbour_margin;
  if (histories_of(stage) != now.histories) return false;
  set_pieces(scene, now.histories, now.state.step);
  coupling::Water water = water_of(c, stage, scene, now.height_0, now.diameter);
  water.solver = now.water_settings.solver, water.tolerance = now.water_settings.tolerance;
  if (scene != before || water != now.water_settings) return false;
  const double end = now.start.end + duration_of(stage, now);
  return cover(now.histories, end) && pressures_cover(water, end);
}

double nominal_rate(const cases::Stage& stage, const output::Checkpoint& now) {  // 1/s, u/H_0 or axial
  return shears(stage.kind) ? layer_velocity(stage, now.scene) / now.height_0 : stage.strain_rate;
}

double duration_of(const cases::Stage& stage, const output::Checkpoint& now) {  // s
  if (stage.porosity > 0 && stage.kind == Kind::uniaxial)
    return squeezing_time(stage.name, now.scene, now.state, now.height_0, stage.porosity, stage.strain_rate);
  if (stage.porosity > 0)
    return pressing_time(stage.name, now.scene, now.state, stage.porosity, stage.strain_rate);
  return stage.duration > 0 ? stage.duration : stage.strain / std::abs(nominal_rate(stage, now));
}

// Of a stage that shears on with the layers of the one before.
std::vector<std::string> asks_for_other_layers(const cases::Case& c, std::size_t index) {
  const cases::Stage& stage = c.stages[index];
  const auto other = [&](double cases::Stage::*layer) {
    return stage.*layer >= 0 && (index == 0 || stage.*layer != c.stages[index - 1].*layer);
  };
  if (!shears(stage.kind) || (!other(&cases::Stage::bottom_layer) && !other(&cases::Stage::top_layer)))
    return {};
  return {"stage " + stage.name +
          ": bottom_layer and top_layer do not count: the layers are those of the shear before it"};
}

// What the stage does not want to know of the one before.
void forget(const cases::Stage& stage, dem::State& s) {
  if (stage.zero_kinematics) {
    for (auto* v : {&s.v, &s.omega, &s.rotation}) std::fill(v->begin(), v->end(), dem::Vec3d{0, 0, 0});
    for (dem::BodyState& body : s.bodies) body.v = {0, 0, 0};
  }
  if (stage.clear_history) {
    for (dem::Contact& contact : s.contacts) contact.spring = {};
    for (dem::WallContact& w : s.wall_contacts) w.spring = {};
  }
}

// Which grains are part of layers, and what displacement, strain and dilation are counted from; returns
// warnings.
std::vector<std::string> set_reference(const cases::Case& c, std::size_t index, const Start& start,
                                       double box_z, output::Checkpoint& now) {
  const cases::Stage& stage = c.stages[index];
  dem::State& s = now.state;
  std::vector<std::string> warnings;
  if (shears(stage.kind) && now.scene.has(BodyId::top_layer)) return asks_for_other_layers(c, index);
  if (shears(stage.kind)) {
    warnings = start.roles.empty() ? choose_layers(stage, s) : take_layers(stage, start.roles, s);
  } else {
    std::fill(s.part_of.begin(), s.part_of.end(), BodyId::none);
    s.at(BodyId::bottom_layer) = s.at(BodyId::top_layer) = {};
  }
  s.x_start = s.x;
  now.height_0 = stage.kind == Kind::press ? box_z : s.wall_z() > 0 ? s.wall_z() : bed_top(s);
  return warnings;
}

}  // namespace

std::unique_ptr<coupling::PoreWater> fill(Stage& stage, const dem::State& grains,
                                          const coupling::WaterState& before, bool under_way) {
  if (!stage.water.present) return nullptr;
  auto water = coupling::make_pore_water(stage.water, stage.scene, grains, before, under_way);
  stage.scene.exchange_interval = water->interval();
  if (last_step(stage) - stage.first_step < stage.scene.exchange_interval)
    throw error("stage ", stage.name, ": lasts ", stage.duration, " s, less than the ",
                static_cast<double>(water->interval()) * stage.scene.dt,
                " s between two exchanges of grains and water (", water->interval(),
                " steps); expected a longer stage, or a shorter fluid.exchange_interval");
  return water;
}

Stage describe(const cases::Case& c, std::size_t index, const output::Checkpoint& now) {
  const cases::Stage& stage = c.stages.at(index);
  Stage out;
  out.name = stage.name, out.kind = stage.kind;
  out.scene = now.scene, out.water = now.water_settings, out.height_0 = now.height_0;
  out.histories = now.histories;
  out.goes_on = true;
  out.first_step = now.start.step, out.first_time = now.start.clock, out.end = now.start.end;
  out.diameter = now.diameter;
  out.strain_rate = nominal_rate(stage, now);
  out.duration = out.end - out.first_time;
  out.porosity = stage.porosity, out.pressure = stage.pressure;
  out.series_interval = c.output.series_interval, out.snapshot_interval = c.output.snapshot_interval;
  return out;
}

Stage prepare(const cases::Case& c, std::size_t index, const Start& start, output::Checkpoint& now) {
  const cases::Stage& stage = c.stages.at(index);
  dem::State& s = now.state;
  // A press has changed it.
  const dem::Vec3d box = index == 0 ? dem::Vec3d{start.box_x, start.box_y, start.box_z} : now.scene.box;
  if (goes_on(c, stage, start, box, now)) {
    now.scene.neighbour_margin = c.neighbour_margin;
    now.start.step = s.step, now.start.clock = now.scene.time(s.step);
    now.start.end += duration_of(stage, now);
    now.water_settings.solver = coupling::Solver(int(c.fluid.solver));
    now.water_settings.tolerance = c.fluid.tolerance;
    Stage out = describe(c, index, now);
    out.warnings = asks_for_other_layers(c, index);
    return out;
  }
  if (s.staggered) dem::mark_slipping(now.scene, s);
  dem::synchronise(now.scene, s);
  forget(stage, s);
  if (!top_wall_of(c, stage, start, 0).is_there())
    s.at(BodyId::top_wall) = {};
  else if (s.wall_z() <= 0)
    s.wall_z() = bed_top(s);  // lowered onto the highest grain
  const std::vector<std::string> warnings = set_reference(c, index, start, box.z, now);
  s.step = 0, s.staggered = false, s.ledger = {};
  s.water_force.clear(), s.water = {};
  dem::Scene scene = scene_of(c, stage, start, box, now.height_0);
  dem::sort_spatially(scene, s);
  now.diameter = mean_diameter(s);
  scene.dt = c.automatic_dt ? c.safety * critical_step(scene, s) : step_of(c, stage, scene, s);
  now.histories = histories_of(stage);
  set_pieces(scene, now.histories, s.step);
  now.scene = scene;
  now.water_settings = water_of(c, stage, scene, now.height_0, now.diameter);
  now.critical_step = 0, now.critical_at = 0;
  now.start = {};
  now.start.end = duration_of(stage, now);
  if (!cover(now.histories, now.start.end) || !pressures_cover(now.water_settings, now.start.end))
    throw error("stage ", stage.name, ": lasts ", now.start.end,
                " s, longer than one of its loads; expected values up to there, or a shorter stage");
  Stage out = describe(c, index, now);
  out.goes_on = false, out.warnings = warnings;
  if (c.automatic_dt) fit_step(out, s, scene.dt), now.scene = out.scene;
  if (presses(out)) expect_small_jumps(out);
  return out;
}

output::Checkpoint foreseen(const cases::Case& c, std::size_t index, const Start& start) {
  output::Checkpoint now = start.before;
  if (index == 0) return now;
  now.scene.box = {start.box_x, start.box_y, start.box_z};
  if (shears(c.stages.at(index).kind) && shears(c.stages[index - 1].kind)) {
    now = foreseen(c, index - 1, start);
    prepare(c, index - 1, start, now);  // for the layers that it will keep
  } else {
    take_layers_away(now.scene);
  }
  return now;
}

}  // namespace moraine::run
