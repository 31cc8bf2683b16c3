#include "run/record.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "dem/deform.hpp"
#include "run/press.hpp"

namespace moraine::run {

namespace {

// m; where the velocity has a profile across y, as far as a grain with the whole velocity would be.
double layer_displacement(const dem::Scene& scene, const dem::State& s) {
  const dem::Profile profile = scene.body(dem::BodyId::top_layer).x.profile;
  double largest = 0, displacement = 0;
  for (dem::Index i = 0; i < s.size(); ++i) {
    if (s.part_of[i] != dem::BodyId::top_layer) continue;
    const double share = dem::share_at(profile, s.x[i].y, scene.box.y);
    if (share <= largest) continue;
    largest = share, displacement = (s.x[i].x - s.x_start[i].x) / share;
  }
  return displacement;
}

std::vector<output::Row> rows_of_stage(std::size_t stage, const std::vector<output::Row>& rows) {
  std::vector<output::Row> own;
  for (const output::Row& r : rows)
    if (r.stage == static_cast<double>(stage)) own.push_back(r);
  return own;
}

}  // namespace

output::Row row_of(std::size_t index, const Stage& stage, const dem::State& s, const dem::Loads& loads,
                   const output::StageStart& start) {
  const dem::Observation o = dem::observe(stage.scene, s, loads);
  const dem::Energy& e = o.energy;
  const dem::Ledger &l = s.ledger, &l_0 = start.ledger;
  output::Row row{};
  row.stage = static_cast<double>(index);
  row.step = static_cast<double>(s.step - start.step);
  row.stage_time = stage.scene.time(s.step) - start.clock;
  row.time = start.time + row.stage_time;
  row.shear_strain = shears(stage.kind) ? layer_displacement(stage.scene, s) / stage.height_0 : 0;
  row.shear_stress = o.shear_stress;
  row.normal_stress = o.normal_stress;
  row.shear_friction = o.normal_stress > 0 ? o.shear_stress / o.normal_stress : 0;
  row.height = presses(stage) ? stage.scene.box.z : o.height;
  row.dilation = row.height - stage.height_0;
  row.dilation_diameters = row.dilation / stage.diameter;
  row.porosity = o.porosity;
  row.mean_overlap = o.mean_overlap, row.max_overlap = o.max_overlap;
  row.coordination = o.coordination;
  row.unbalanced_force = o.unbalanced_force;
  row.kinetic = e.kinetic, row.rotational = e.rotational;
  row.elastic_normal = e.elastic_normal, row.elastic_tangential = e.elastic_tangential;
  row.potential = e.potential, row.wall_kinetic = e.wall_kinetic;
  row.water_work = l.water - l_0.water;
  row.slip = l.slip - l_0.slip, row.viscous = l.viscous - l_0.viscous;
  row.top_wall_work = l.planes - l_0.planes, row.layers_work = l.layers - l_0.layers;
  if (stage.scene.is_periodic()) {
    const dem::BoxStress box = dem::box_stress(stage.scene, s);
    row.side_x = stage.scene.box.x, row.side_y = stage.scene.box.y, row.side_z = stage.scene.box.z;
    row.stress_x = box.normal.x, row.stress_y = box.normal.y, row.stress_z = box.normal.z;
  }
  const double now = stage.scene.time(s.step);
  const dem::Drive &wall = stage.scene.body(dem::BodyId::top_wall).z,
                   &layer = stage.scene.body(dem::BodyId::top_layer).x;
  using Kind = dem::Drive::Kind;
  if (wall.kind == Kind::stress) row.asked_normal_stress = wall.stress(now);
  if (layer.kind == Kind::stress) row.asked_shear_stress = layer.stress(now);
  if (layer.kind == Kind::velocity) row.asked_velocity = layer.velocity_at(now);
  if (stage.water.present) {
    row.asked_top_pressure = stage.water.sides.high[2].at(now);
    if (stage.water.sides.low[2].kind == fluid::Side::Kind::pressure)
      row.asked_bottom_pressure = stage.water.sides.low[2].at(now);
  }
  row.residue = stage.scene.ledger ? (e.total() - start.energy) + row.slip + row.viscous - row.top_wall_work -
                                         row.layers_work - row.water_work
                                   : std::numeric_limits<double>::quiet_NaN();
  return row;
}

void add_water(output::Row& row, const Stage& stage, const coupling::PoreWater& water,
               const output::StageStart& start) {
  const coupling::WaterRecord r = water.record(/*upper_half=*/shears(stage.kind));
  const coupling::WaterState s = water.state();
  row.wall_water_pressure = s.wall_pressure;
  const double total = row.normal_stress + s.wall_pressure;
  row.total_friction = total > 0 ? row.shear_stress / total : 0;
  row.water_pressure_mean = r.mean, row.water_pressure_min = r.least, row.water_pressure_max = r.most;
  row.water_drained_top = s.drained_top - start.drained_top;
  row.water_drained_bottom = s.drained_bottom - start.drained_bottom;
  row.water_volume = r.volume, row.water_balance = r.balance;
  row.water_stored = r.stored, row.water_dissipated = s.dissipated - start.water_dissipated;
}

double direction_of_shear(const std::vector<output::Row>& rows) {
  const double first = rows.front().shear_strain;
  double excursion = rows.back().shear_strain - first;
  if (excursion == 0)
    for (const output::Row& r : rows)
      if (std::abs(r.shear_strain - first) > std::abs(excursion)) excursion = r.shear_strain - first;
  return excursion < 0 ? -1 : 1;
}

Strength strength_of(const std::vector<output::Row>& rows) {
  const double along = direction_of_shear(rows);
  struct Point {
    double strain, friction;
  };
  std::vector<Point> curve;
  for (const output::Row& r : rows)
    curve.push_back({along * (r.shear_strain - rows.front().shear_strain), along * r.shear_friction});

  constexpr double none = -std::numeric_limits<double>::infinity();
  Strength s{none, 0, none, 0, rows.back().dilation_diameters};
  const double last = curve.back().strain;
  std::size_t count = 0;
  for (const Point& p : curve) {
    if (p.strain > 0 && p.friction > s.peak) s.peak = p.friction, s.peak_strain = p.strain;
    if (p.strain >= 2.0 / 3.0 * last) s.ultimate += p.friction, ++count;
    double sum = 0;
    int n = 0;
    for (const Point& q : curve)
      if (std::abs(q.strain - p.strain) <= 0.01) sum += q.friction, ++n;
    if (p.strain >= 0.01 || last < 0.02) s.smoothed_peak = std::max(s.smoothed_peak, sum / n);
  }
  if (s.peak == none) s.peak = 0;  // a layer that has not moved yet
  s.ultimate /= static_cast<double>(count);
  return s;
}

std::optional<Strength> final_strength(const std::vector<cases::Stage>& stages,
                                       const std::vector<output::Row>& rows) {
  for (std::size_t k = stages.size(); k-- > 0;)
    if (const auto own = rows_of_stage(k, rows); shears(stages[k].kind) && !own.empty())
      return strength_of(own);
  return {};
}

double energy_put_in(const std::vector<output::Row>& rows) {
  const output::Row& last = rows.back();
  return std::max(0.0, last.top_wall_work) + std::max(0.0, last.layers_work) +
         std::max(0.0, last.water_work) + std::max(0.0, rows.front().potential - last.potential);
}

std::string summary(const std::vector<cases::Stage>& stages, const std::vector<output::Row>& rows) {
  std::string out =
      "stage         end time  height  porosity  contacts/  friction  friction  friction  dilation  ledger   "
      " residue/\n"
      "              s         m       1         grain      peak      (smooth)  ultimate  diameters residue "
      "J energy in\n";
  double all_in = 0, all_residue = 0;
  for (std::size_t k = 0; k < stages.size(); ++k) {
    const std::vector<output::Row> own = rows_of_stage(k, rows);
    if (own.empty()) continue;
    const output::Row& last = own.back();
    char text[256], strength[64] = "-         -         -         -         ";
    if (shears(stages[k].kind)) {
      const Strength s = strength_of(own);
      std::snprintf(strength, sizeof strength, "%-10.3f%-10.3f%-10.3f%-+10.3f", s.peak, s.smoothed_peak,
                    s.ultimate, s.dilation_diameters);
    }
    const double in = energy_put_in(own);
    std::snprintf(text, sizeof text, "%-14s%-10.4g%-8.4f%-10.4f%-11.3f%s%-+10.1e%.1e\n",
                  stages[k].name.c_str(), last.time, last.height, last.porosity, last.coordination, strength,
                  last.residue, in > 0 ? std::abs(last.residue) / in : 0.0);
    out += text;
    all_in += in, all_residue += last.residue;
  }
  char text[128];
  std::snprintf(text, sizeof text, "%-93s%-+10.1e%.1e\n", "all", all_residue,
                all_in > 0 ? std::abs(all_residue) / all_in : 0.0);
  out += text;
  return out +
         "friction: along the shear of the stage; peak: largest value at a strain above 0; smooth: largest "
         "mean over a shear strain of 0.02; ultimate: mean over the last third of the stage's strain\n"
         "dilation: from the height of the bed when the stage began, or the first of several that shear one "
         "after another\n"
         "energy in: work of wall and driven layer, and what the grains fell\n";
}

}  // namespace moraine::run
