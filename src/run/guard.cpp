#include "run/guard.hpp"

#include <algorithm>
#include <cmath>

#include "dem/body/motion.hpp"
#include "dem/grain.hpp"
#include "dem/scene_check.hpp"
#include "error.hpp"

namespace moraine::run {

namespace {

bool finite(const dem::Vec3d& a) { return std::isfinite(a.x + a.y + a.z); }

std::string when(const Stage& stage, const dem::State& s) {
  return dem::at_step(s.step - stage.first_step, stage.time(s.step), "stage " + stage.name);
}

std::string grain_there(const Stage& stage, const dem::State& s, dem::Index i) {
  return dem::grain_there(s.id[i], when(stage, s), s.x[i], s.v[i]);
}

void check_numbers(const Stage& stage, const dem::State& s) {
  for (dem::Index i = 0; i < s.size(); ++i)
    if (!finite(s.x[i]) || !finite(s.v[i]) || !finite(s.omega[i]) || !finite(s.force[i]) ||
        !finite(s.torque[i]) || !finite(s.rotation[i]))
      throw error(grain_there(stage, s, i), "force or motion is not a finite number; try a smaller model.f");
  for (const dem::BodyState& body : s.bodies)
    if (!finite(body.x) || !finite(body.v) || !finite(body.force))
      throw error("a wall or the driven layer", when(stage, s), ": height of the top wall ", s.wall_z(),
                  " m, velocity ", s.at(dem::BodyId::top_wall).v.z, " m/s, layer velocity ",
                  s.at(dem::BodyId::top_layer).v.x,
                  " m/s: not all finite numbers; try a smaller model.f or a heavier wall.mass");
  if (stage.scene.has(dem::BodyId::top_wall) && stage.scene.has(dem::BodyId::floor) && s.wall_z() <= 0)
    throw error("top wall", when(stage, s), ": it fell through the floor, to ", s.wall_z(),
                " m; no grains held it: check the start, wall.mass and normal_stress");
}

double stored(const output::Row& r) {
  return r.kinetic + r.rotational + r.elastic_normal + r.elastic_tangential + r.wall_kinetic;
}

// The measure of what is created or lost. Kinetic energies are v(n-1/2).v(n+1/2), which is negative for what
// starts from rest; there is no motion then to measure by. Cohesion stores less than nothing.
double stored_at_least(const output::Row& r) {
  return std::max(0.0, r.kinetic) + std::max(0.0, r.rotational) + std::max(0.0, r.elastic_normal) +
         r.elastic_tangential + std::max(0.0, r.wall_kinetic);
}

dem::Index most_energetic(const dem::Scene& scene, const dem::State& s) {
  dem::Index most = 0;
  double most_energy = -1;
  for (dem::Index i = 0; i < s.size(); ++i) {
    const double m = scene.inertial_mass(s.r[i], s.material_of(i));
    const double e = 0.5 * m * (dot(s.v[i], s.v[i]) + 0.4 * s.r[i] * s.r[i] * dot(s.omega[i], s.omega[i]));
    if (e > most_energy) most = i, most_energy = e;
  }
  return most;
}

}  // namespace

Overlap deepest_overlap(const dem::Scene& scene, const dem::State& s) {
  Overlap deepest;
  const auto take = [&](const Overlap& o) {
    if (o.fraction > deepest.fraction) deepest = o;
  };
  const dem::Sides sides = dem::Sides::of(scene);
  for (const dem::Contact& c : s.contacts) {
    const dem::Vec3d x_ij = dem::nearest_image(sides, s.x[c.i] - s.x[c.j]);
    const double depth = s.r[c.i] + s.r[c.j] - std::sqrt(dot(x_ij, x_ij));
    take({depth / std::min(s.r[c.i], s.r[c.j]), depth, c.i, c.j, {}});
  }
  for (const dem::WallContact& w : s.wall_contacts) {
    const dem::Body& plane = scene.body(w.wall);
    if (!plane.is_there()) continue;
    const double depth =
        -dem::gap_to_plane(s.x[w.i][plane.axis], s.r[w.i], dem::place_of(scene, s, w.wall), plane.facing);
    take({depth / s.r[w.i], depth, w.i, -1, w.wall});
  }
  return deepest;
}

std::string describe(const Overlap& o, const dem::State& s) {
  std::ostringstream text;
  text << "overlaps ";
  if (o.j >= 0)
    text << "grain " << s.id[o.j] << " at " << dem::triple(s.x[o.j]) << " m";
  else
    text << dem::name_of(o.wall);
  text << " by " << o.depth << " m, " << o.fraction << " of the smaller radius";
  return text.str();
}

Guard::Guard(const cases::Guards& limits, const Stage& stage, const std::vector<output::Row>& rows,
             const output::StageStart& start)
    : limits_(limits), stage_(stage), start_(start) {
  const auto own = std::find_if(rows.begin(), rows.end(),
                                [&](const output::Row& r) { return r.stage == rows.back().stage; });
  first_ = *own;
  for (auto r = own; r != rows.end(); ++r) most_put_in_ = std::max(most_put_in_, energy_put_in({first_, *r}));
}

void Guard::check(const dem::State& s, const dem::Loads* loads) {
  check_numbers(stage_, s);
  if (const Overlap o = deepest_overlap(stage_.scene, s); o.fraction > limits_.max_overlap)
    throw error(
        grain_there(stage_, s, o.i), describe(o, s),
        "; expected at most guards.max_overlap = ", limits_.max_overlap,
        stage_.porosity > 0
            ? text(": ", stage_.name, " has pressed the grains to a porosity of ",
                   dem::observe(stage_.scene, s).porosity, "; they may not bear that of ", stage_.porosity,
                   " (equal spheres come to 0.36 without friction); expected a larger porosity, less "
                   "friction, or a smaller strain_rate")
            : ": the load or the impact is too much for the contacts' stiffness (contact.k_n; young with "
              "Hertz's law), or the "
              "step is too long (try a smaller "
              "model.f)");
  loads ? check_energy(s, *loads) : check_energy(s, dem::loads_of(stage_.scene, s));
}

bool Guard::finds_healthy(const dem::State& s) const {
  try {
    Guard(*this).check(s);
  } catch (const Error&) {
    return false;
  }
  return true;
}

void Guard::check_energy(const dem::State& s, const dem::Loads& loads) {
  const output::Row now = row_of(static_cast<std::size_t>(first_.stage), stage_, s, loads, start_);
  most_put_in_ = std::max(most_put_in_, energy_put_in({first_, now}));
  // Rounding of the potential energy may exceed what a bed at rest has stored.
  const double had = stored_at_least(first_) + most_put_in_ + 1e-10 * std::abs(first_.potential);
  const double gained =
      stored(now) + now.potential - start_.energy - now.top_wall_work - now.layers_work - now.water_work;
  const bool ledger = stage_.scene.ledger;
  // Damping that pushes is creation of energy too, though the ledger balances.
  const double negative = ledger ? std::max(0.0, -now.viscous) + std::max(0.0, -now.slip) : 0;
  const double created = (ledger ? now.residue : gained) + negative;
  const bool too_much = !(created <= limits_.max_residue * had);
  const bool too_little = ledger && !(-created <= limits_.max_residue * had);
  if (!too_much && !too_little) return;
  std::ostringstream how_much;
  how_much.precision(9);
  how_much << std::abs(created) << " J were " << (too_much ? "created" : "lost");
  if (had > 0)
    how_much << ", " << std::abs(created) / had << " of the " << had << " J stored and put in";
  else
    how_much << " where none was stored or put in";
  if (!std::isfinite(created)) how_much.str("the energy grew beyond all numbers");
  throw error(grain_there(stage_, s, most_energetic(stage_.scene, s)), "moves with the most energy after ",
              how_much.str(), "; expected at most guards.max_residue = ", limits_.max_residue,
              ": the step is too long for the stiffness or the damping (try a smaller model.f)");
}

}  // namespace moraine::run
