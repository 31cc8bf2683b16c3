#include "run/precheck.hpp"

#include <algorithm>
#include <cmath>

#include "dem/scene_check.hpp"
#include "dem/state_rows.hpp"
#include "dem/uses.hpp"
#include "error.hpp"
#include "memory.hpp"
#include "output/files.hpp"
#include "run/guard.hpp"
#include "run/needs.hpp"
#include "run/own_grains.hpp"

namespace moraine::run {

namespace {

// A way in which contacts can swing.
struct Mode {
  std::string what;
  const char* damping;      // key
  double k, gamma, w;       // N/m, N s/m, 1/kg
  bool certain;             // that these contacts exist
  bool restitutes = false;  // damping comes from a coefficient of restitution, too
};

// With the stiffness and damping that the law has at the usual overlap of grains of radius r.
dem::ContactParameters as_springs(dem::ContactParameters p, bool wall, double r) {
  const dem::Geometry<double> g = wall ? dem::usual_contact_at_plane(r) : dem::usual_contact(r, r);
  const auto at = dem::patch<dem::GeneralLaw>(p, g).at();
  const double gamma_n = dem::Restitution::gamma_n<dem::GeneralLaw::Normal>(p, g, at);
  const double k_n = dem::stiffness_of(p, g), k_t = dem::tangential_stiffness_of(p, g);
  p.gamma_n = gamma_n, p.k_n = k_n, p.k_t = k_t;
  return p;
}

// Of the lightest grain, whose radius is r; with several materials, as if it touched any of them.
std::vector<Mode> modes_of(const Stage& stage, const dem::State& s, double r) {
  const dem::Scene& scene = stage.scene;
  const double w = 1 / dem::least_mass(scene, s);
  const auto sticks = [](const dem::ContactParameters& p, double value) { return p.mu_s > 0 ? value : 0; };
  std::vector<Mode> modes;
  std::vector<dem::ContactParameters> of_grains, of_walls;  // told so far
  const auto add = [&](const dem::ContactParameters& law, bool wall, double bodies) {
    for (const dem::ContactParameters& before : wall ? of_walls : of_grains)
      if (before == law) return;
    (wall ? of_walls : of_grains).push_back(law);
    const dem::ContactParameters p = as_springs(law, wall, r);
    modes.push_back({wall ? "along the normal of a wall" : "along the normal of two grains",
                     wall ? "wall_gamma_n" : "gamma_n", p.k_n, p.gamma_n, bodies * w, true, law.zeta > 0});
    modes.push_back({wall ? "along a wall" : "along the tangent of two grains",
                     wall ? "wall_gamma_t" : "gamma_t", sticks(p, p.k_t), sticks(p, p.gamma_t),
                     3.5 * bodies * w, true});
    // (R/r)^2 k against the spins of one or two grains, of 2/5 m r^2 each; R = r at a wall, r/2 at a grain.
    const double turning = (wall ? 2.5 : 1.25) * w;
    if (dem::Rolling::used(p))
      modes.push_back(
          {wall ? "rolling on a wall" : "rolling of two grains", "k_roll", p.k_roll, 0, turning, true});
    if (dem::Twisting::used(p))
      modes.push_back(
          {wall ? "twisting on a wall" : "twisting of two grains", "k_twist", p.k_twist, 0, turning, true});
  };
  if (s.size() > 1)
    dem::for_each_pair_of_grains(scene, [&](const dem::ContactParameters& p) { add(p, false, 2); });
  dem::ContactParameters at_walls = as_springs(scene.with(dem::Material::wall), true, r);  // the stiffest
  dem::for_each_pair_with_walls(scene, [&](const dem::ContactParameters& law) {
    if (scene.has_planes()) add(law, true, 1);
    const dem::ContactParameters p = as_springs(law, true, r);
    at_walls.k_n = std::max(at_walls.k_n, p.k_n), at_walls.gamma_n = std::max(at_walls.gamma_n, p.gamma_n);
  });
  const dem::Body& top_wall = scene.body(dem::BodyId::top_wall);
  if (top_wall.z.kind == dem::Drive::Kind::stress) {
    const double layer = std::round(
        std::clamp(scene.area() / (stage.diameter * stage.diameter), 1.0, static_cast<double>(s.size())));
    const double mass = top_wall.mass;
    modes.push_back({text("of the top wall (", mass, " kg) with up to ", layer, " grains on it"),
                     "wall_gamma_n", at_walls.k_n, at_walls.gamma_n, w + layer / mass, false});
  }
  return modes;
}

void check_step(const Stage& stage, const dem::State& s, std::vector<std::string>& warnings) {
  const double dt = stage.scene.dt;
  const auto smallest = static_cast<dem::Index>(std::min_element(s.r.begin(), s.r.end()) - s.r.begin());
  const std::string about = text("stage ", stage.name, ": ");
  const std::string of = text(" (grain ", s.id[smallest], ", the smallest, of radius ", s.r[smallest], " m)");
  const std::vector<Mode> modes = modes_of(stage, s, s.r[smallest]);
  const auto room_of = [&](const Mode& m) { return 1 - 0.25 * m.k * m.w * dt * dt; };
  // Then the run will not pass the guards, and it is the step that must change.
  const bool step_too_long =
      std::any_of(modes.begin(), modes.end(), [&](const Mode& m) { return m.certain && room_of(m) <= 0; });
  for (const Mode& m : modes) {
    const double damping = m.gamma * m.w * dt, room = room_of(m);
    const char* heavier = m.certain ? "" : ", or a heavier wall.mass";
    if (room <= 0) {
      warnings.push_back(text(about, "the step of ", dt, " s is above the limit of ",
                              2 / std::sqrt(m.k * m.w), " s for motion ", m.what, of,
                              " and unstable; expected a smaller model.f or model.dt", heavier));
      continue;
    }
    // Grains with many contacts bear less than one contact; a layer on the wall is the most there can be.
    const double best = m.certain ? 0.3 * room : room;
    if (damping <= best) continue;
    const std::string found =
        text(about, m.damping, m.restitutes ? ", with what restitution asks for," : "", " = ", m.gamma,
             " N s/m with a step of ", dt, " s: damping ", m.what, of, " is ");
    const std::string remedy =
        text("; expected at most ", best / (m.w * dt), " N s/m",
             m.restitutes ? " (a restitution closer to 1)" : "", ", or a smaller model.f", heavier);
    if (damping >= room && m.certain && !step_too_long) throw error(found, "unstable", remedy);
    warnings.push_back(text(found, "at ", damping / room, " of its limit of stability", remedy));
  }
}

// A margin shorter than what moves in a step changes no force, but every step needs a search, and what the
// springs of contacts that open still held is not booked.
void check_margin(const Stage& stage, const dem::State& s, std::vector<std::string>& warnings) {
  const dem::Scene& scene = stage.scene;
  if (scene.neighbour_margin <= 0) return;
  double speed = 0;
  for (const dem::Body& body : scene.bodies)
    for (int a = 0; a < 3; ++a) speed = std::max(speed, std::abs(body.along(a).velocity));
  if (shears(stage.kind))  // at its fastest
    speed = std::max(speed, std::abs(stage.strain_rate) * stage.height_0);
  for (const dem::Vec3d& v : s.v) speed = std::max(speed, std::sqrt(dot(v, v)));
  const double least = 4 * speed * scene.dt;
  if (scene.neighbour_margin <= least)
    warnings.push_back(text("stage ", stage.name, ": model.neighbour_margin = ", scene.neighbour_margin,
                            " m is shorter than what grains move within two steps at ", speed,
                            " m/s: each step needs a new search; expected more than ", least,
                            " m, or 0 for an automatic one"));
}

void check_cells(const Stage& stage, const dem::State& s, std::vector<std::string>& warnings) {
  if (!stage.water.present) return;
  const bool wall = stage.scene.has(dem::BodyId::top_wall);
  const double length[3] = {stage.scene.box.x, stage.scene.box.y, wall ? stage.height_0 : stage.water.height};
  const auto largest = static_cast<dem::Index>(std::max_element(s.r.begin(), s.r.end()) - s.r.begin());
  const double d = 2 * s.r[largest];
  int narrowest = 0;
  const auto width = [&](int a) { return length[a] / stage.water.cells[a]; };
  for (int a = 0; a < 3; ++a) {
    if (width(a) < width(narrowest)) narrowest = a;
    if (width(a) < 2 * stage.diameter)
      warnings.push_back(
          text("stage ", stage.name, ": grid cells of ", width(a), " m along ", "xyz"[a], " are ",
               width(a) / stage.diameter,
               " mean diameters wide and measure pores rather than porosity; expected 2 to 3"));
  }
  if (width(narrowest) < d)
    warnings.push_back(text(
        "stage ", stage.name, ": the largest grain (", s.id[largest], "), of ", d,
        " m, is wider than the grid cells of ", width(narrowest), " m along ", "xyz"[narrowest],
        ": cells that it fills count with fluid.porosity_min = ", stage.water.porosity_range[0],
        "; expected cells of at least ", d, " m, unless the flow around large grains is to be resolved"));
}

// Where there are no walls along x or y.
void check_sides(const cases::Case& c, const Stage& stage, std::vector<std::string>& warnings) {
  if (!stage.water.present) return;
  for (int a = 0; a < 2; ++a) {
    if (a == 0 ? stage.scene.periodic_x : stage.scene.periodic_y) continue;
    if (stage.scene.has(a == 0 ? dem::BodyId::x_low : dem::BodyId::y_low)) continue;
    const auto tight = [&](const fluid::Side& side) { return side.kind == fluid::Side::Kind::closed; };
    const bool low = tight(stage.water.sides.low[a]), high = tight(stage.water.sides.high[a]);
    const std::string key = std::string("fluid.") + "xy"[a];
    warnings.push_back(text("stage ", stage.name, ": the sides ", "xy"[a], " = 0 and ", "xy"[a], " = ",
                            stage.scene.box[a], " m are open (box.periodic = \"",
                            c.periodic_x   ? "x"
                            : c.periodic_y ? "y"
                                           : "none",
                            "\"): a grain that leaves counts no longer, and water takes its place",
                            low || high ? text(", but not where ", low ? key + "_low" : "",
                                               low && high ? " and " : "", high ? key + "_high" : "",
                                               " = \"no_flow\": there the balance of the water lacks it")
                                        : "",
                            "; expected box.periodic = \"xy\", box.walls, or a bed that stays inside"));
  }
}

// Of the grid of any stage, before hours are spent on those before it. Loose grains stand higher than the bed
// they will make (of porosity 0.4).
void check_room(const cases::Case& c, const Stage& stage, const dem::State& s) {
  if (!stage.water.present) return;
  double height = 0;
  for (const double r : s.r) height += dem::sphere_volume(r) / 0.6 / stage.scene.area();
  double levels = stage.water.cells[2];
  if (c.fluid.cells_z == 0 && c.start.empty()) levels *= std::min(1.0, height / stage.height_0);
  const double cells =
      static_cast<double>(stage.water.cells[0]) * stage.water.cells[1] * std::max(1.0, levels);
  expect_memory(
      bytes_needed(s.size(), true, cells),
      text("stage ", stage.name, ": ", s.size(), " grains and some ", cells, " cells of pore water"),
      "; expected a larger fluid.cell (2 to 3 mean grain diameters), or fewer fluid.cells_x, cells_y, "
      "cells_z");
}

constexpr double usual_overlap = 0.01;  // of the smaller radius, at most, of grains that lie

void check_overlaps(const cases::Case& c, const dem::Scene& scene, const dem::State& s,
                    std::vector<std::string>& warnings) {
  const Overlap o = deepest_overlap(scene, s);
  if (o.fraction <= c.guards.max_overlap) {
    if (has_own_grains(c.start) && o.fraction > usual_overlap)
      warnings.push_back(text(c.start.string(), ": grain ", s.id[o.i], " at ", dem::triple(s.x[o.i]), " m ",
                              describe(o, s), ", more than grains that lie: they may fly apart"));
    return;
  }
  const bool at_side_wall = o.j < 0 && scene.body(o.wall).axis < 2;
  throw error(c.start.empty() ? c.directory.string() : c.start.string(), ": grain ", s.id[o.i], " at ",
              dem::triple(s.x[o.i]), " m ", describe(o, s),
              "; expected at most guards.max_overlap = ", c.guards.max_overlap,
              at_side_wall ? ": let the bed settle between the walls, or leave them out (box.walls)"
                           : ": check radii, positions and box of the start");
}

// What a table says of motion counts only where the first stage keeps it.
void check_motion(const cases::Case& c, const Start& start, std::vector<std::string>& warnings) {
  if (!has_own_grains(c.start) || output::is_snapshot(c.start) || c.stages.empty()) return;
  if (!c.stages[0].zero_kinematics) return;
  double fastest = 0;
  for (const dem::Vec3d& v : start.before.state.v) fastest = std::max(fastest, std::sqrt(dot(v, v)));
  if (fastest > 0)
    warnings.push_back(text(c.start.string(), " has velocities, of up to ", fastest, " m/s, and stage ",
                            c.stages[0].name, " begins at rest; zero_kinematics = false keeps them"));
}

// A bed on a slope that nothing holds slides downhill ever faster; layers hold it where it shears.
void check_slope(const cases::Case& c, const Stage& stage, std::vector<std::string>& warnings) {
  if (c.slope == 0 || shears(stage.kind) || !c.periodic_x || !stage.scene.has(dem::BodyId::floor)) return;
  bool holds = false;
  dem::for_each_pair_with_walls(stage.scene, [&](const dem::ContactParameters& p) {
    holds |= p.mu_s > 0 && (p.k_t > 0 || p.G_star > 0);
  });
  if (!holds)
    warnings.push_back(text("stage ", stage.name, ": nothing holds the bed on the slope of ", c.slope,
                            " rad, as the floor has no friction; expected wall.k_t > 0 N/m and wall_mu > 0"));
}

void check_scaling(const cases::Case& c, const Start& start, std::vector<std::string>& warnings) {
  if (c.density_scaling == 0) return;
  const auto [smallest, largest] = std::ranges::minmax_element(start.before.state.r);
  if (c.density_scaling > *largest)
    throw error("model.density_scaling = ", c.density_scaling, " m: wider than the largest radius, ",
                *largest, " m; expected a radius between the smallest, ", *smallest, " m, and that");
  if (c.density_scaling <= *smallest) {
    warnings.push_back(text("model.density_scaling = ", c.density_scaling,
                            " m does nothing: no radius is smaller than that (the smallest is ", *smallest,
                            " m)"));
    return;
  }
  for (const cases::Stage& stage : c.stages)
    if (stage.kind == cases::Stage::Kind::settle && c.gravity > 0)
      warnings.push_back(text("stage ", stage.name,
                              ": by model.density_scaling the smallest grains fall with ",
                              std::pow(*smallest / c.density_scaling, 3),
                              " of gravity and may still fall at its end; press the bed together instead"));
}

// Of presses one after the other.
void check_porosities(const cases::Case& c) {
  double before = 1;
  for (const cases::Stage& stage : c.stages) {
    const bool presses = stage.kind == cases::Stage::Kind::press;
    if (presses && stage.porosity > 0 && stage.porosity >= before)
      throw error("stage ", stage.name, ": porosity = ", stage.porosity,
                  ", where a stage before it presses to ", before,
                  "; expected less than that (to press does not loosen)");
    before = presses && stage.porosity > 0 ? stage.porosity : 1;
  }
}

}  // namespace

std::vector<std::string> precheck(const cases::Case& c, const Start& start, dem::Engine& engine) {
  std::vector<std::string> warnings;
  check_motion(c, start, warnings);
  check_scaling(c, start, warnings);
  check_porosities(c);
  for (std::size_t k = 0; k < c.stages.size(); ++k) {
    output::Checkpoint now = foreseen(c, k, start);
    Stage stage = prepare(c, k, start, now);
    const dem::State& s = now.state;
    const bool bed = k == 0 || !c.start.empty();  // or loose grains that will be one
    if (bed) warnings.insert(warnings.end(), stage.warnings.begin(), stage.warnings.end());
    if (!bed && shears(stage.kind) && !(k > 0 && shears(c.stages[k - 1].kind))) {
      const auto foreseen = foresee_layers(c.stages[k], s, stage.scene.area());
      warnings.insert(warnings.end(), foreseen.begin(), foreseen.end());
    }
    check_step(stage, s, warnings);
    check_slope(c, stage, warnings);
    check_margin(stage, s, warnings);
    check_cells(stage, s, warnings);
    check_sides(c, stage, warnings);
    check_room(c, stage, s);
    // Refuses what is impossible; a later stage of loose grains is judged when it comes, with its bed.
    std::unique_ptr<coupling::PoreWater> water;
    if (bed || !coupling::water_built()) water = fill(stage, s, now.water, stage.goes_on);
    if (water && !water->outside().empty())
      warnings.push_back(text("stage ", stage.name, ": outside the grid of the water lie at the start ",
                              water->outside(),
                              "; they count nowhere; expected all grains inside (box.x, "
                              "box.y, fluid.height)"));
    if (k > 0) continue;
    engine.load(stage.scene, s, water.get());
    now.state = {};  // gone before the engine's comes
    check_overlaps(c, stage.scene, engine.state(), warnings);
  }
  return warnings;
}

}  // namespace moraine::run
