#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <limits>
#include <string>

#include "case/keys.hpp"
#include "dem/grading.hpp"
#include "dem/spectrum.hpp"
#include "error.hpp"
#include "run/estimate.hpp"
#include "run/needs.hpp"
#include "run/precheck.hpp"
#include "run/press.hpp"
#include "run/progress.hpp"
#include "run/run.hpp"
#include "run/schedule.hpp"
#include "run/stages.hpp"

namespace moraine::run {

namespace {

// Stiffness of the skeleton against uniaxial compression, Pa: contacts as linear springs, all of one length,
// that follow the mean strain (M = K + 4/3 G; a real packing gives way to a half of that or less).
double modulus(const dem::ContactParameters& p, const dem::State& s, double solid_fraction, double diameter) {
  const double z = s.contacts.empty() ? 5 : 2.0 * static_cast<double>(s.contacts.size()) / s.size();
  const double per_length = z * solid_fraction / (std::numbers::pi * diameter);
  return per_length * (p.k_n / 3 + 4.0 / 3 * (2 * p.k_n + 3 * p.k_t) / 10);
}

void print_water(std::FILE* out, const cases::Case& c, const Stage& stage, const dem::State& s,
                 const coupling::PoreWater& water, double height, double strain_rate, double pressure) {
  const coupling::Water& w = stage.water;
  double volume = 0;
  for (const double r : s.r) volume += dem::sphere_volume(r);
  const double phi =
      std::clamp(1 - volume / (stage.scene.area() * height), w.porosity_range[0], w.porosity_range[1]);
  const double sauter = sauter_diameter(s), k_c = w.k_c > 0 ? w.k_c : sauter * sauter / 180,
               k = k_c * phi * phi * phi / ((1 - phi) * (1 - phi));
  const dem::ContactParameters springs = dem::as_linear(c.contact, 0.5 * stage.diameter, pressure);
  const double m = modulus(springs, s, 1 - phi, stage.diameter), storage = phi * w.compressibility;
  const double d = k / (w.viscosity * storage), c_v = k / (w.viscosity * (1 / m + storage));
  const coupling::Stability stability = water.stability();
  const bool wall = stage.scene.has(dem::BodyId::top_wall);
  const double h = (wall ? height : w.height) / w.cells[2],
               interval = stage.scene.dt * static_cast<double>(water.interval());
  std::fprintf(out, "    %s\n", water.describe().c_str());
  const double largest = 2 * *std::max_element(s.r.begin(), s.r.end());
  std::fprintf(out, "    cells       %.3g d wide, %.3g d high; the largest grain is %.3g d\n",
               stage.scene.box.x / w.cells[0] / stage.diameter, h / stage.diameter, largest / stage.diameter);
  std::fprintf(out,
               "    exchange    every %.4g s; stable up to %.4g s (contacts %.3g rad/s, water %.3g rad/s)\n",
               interval, stability.longest_dt, stability.w_sk, stability.w_f);
  if (w.k_c == 0)
    std::fprintf(
        out,
        "    k_c         %.3g m2 = d^2/180 with the Sauter mean diameter d = %.4g m; in each cell that of "
        "its "
        "grains\n",
        k_c, sauter);
  std::fprintf(
      out,
      "    water       k = %.3g m2 at porosity %.3g; D = k/(mu phi beta) = %.3g m2/s; diffusion number "
      "%.3g\n",
      k, phi, d, d * interval / (h * h));
  std::fprintf(
      out, "    skeleton    M about %.3g Pa; c_v = %.3g m2/s; R = K_f/(phi M) = %.3g; Skempton B = %.3g\n", m,
      c_v, 1 / (storage * m), 1 / (1 + storage * m));
  if (strain_rate != 0) {
    const double ratio = std::abs(strain_rate) * height * height / c_v;
    const double drop = 0.1 * std::abs(strain_rate) * height * height * w.viscosity / (2 * k);
    std::fprintf(
        out, "    dilation    strain rate x H^2/c_v = %.3g (%s); H^2/c_v = %.3g s\n", ratio,
        ratio > 1 ? "faster than the water flows: undrained" : "slower than the water flows: drained",
        height * height / c_v);
    std::fprintf(out,
                 "                where the bed dilates by 0.1 of its shear, water falls by about %.3g Pa\n",
                 drop);
  }
}

// Told apart by the middle between the two, where they do not overlap: few grains have few coarse ones, and
// may miss the fraction that was asked for. volume: m3, of all grains.
void print_mixture(std::FILE* out, const cases::Grains& g, const dem::State& s, double volume) {
  const double middle = std::sqrt(g.radius_mean * g.fine_radius_mean);
  if (g.fine_radius_mean + 3 * g.fine_radius_std > middle || middle > g.radius_mean - 3 * g.radius_std)
    return;
  dem::Index coarse = 0;
  double fine = 0;
  for (const double r : s.r) r < middle ? fine += dem::sphere_volume(r) : ++coarse;
  std::fprintf(
      out, "  mixture       %d grains are wider than %.4g m, %.4g of the mass is finer (asked for: %.4g)\n",
      coarse, 2 * middle, fine / volume, g.fine_fraction);
}

// Pa, mean of the grains' own weight.
double weight_above(const dem::Scene& scene, const dem::State& s) {
  double weight = 0;
  for (dem::Index i = 0; i < s.size(); ++i)
    weight += dem::sphere_mass(scene.density_of(s.material_of(i)), s.r[i]) *
              scene.submerged_gravity(s.material_of(i));
  return 0.5 * weight / scene.area();
}

bool is_hertz(const cases::Case& c) { return c.law == cases::Case::Law::hertz; }

constexpr double long_run = 7 * 86400, short_step = 1e-9, a_day = 86400;  // s

// The step goes as r^1.5 k^-0.5, by the smallest grain.
void print_what_would_do(std::FILE* out, const cases::Case& c, const dem::GradingSummary& sizes,
                         double total) {
  std::fprintf(
      out,
      "  shorter       the smallest grain, %.3g m wide, and k_n = %.3g N/m%s set the step: a tenth of the "
      "time "
      "with "
      "4.6 times larger ones",
      sizes.smallest,
      dem::stiffness_of(c.contact, dem::usual_contact(0.5 * sizes.smallest, 0.5 * sizes.smallest)),
      is_hertz(c) ? " (at an overlap of a hundredth of its radius)" : "");
  const std::string where = !c.start.empty()                       ? "in the start"
                            : c.grains.distribution == "sieves"    ? "grains.sieves"
                            : c.grains.distribution == "lognormal" ? "grains.radius_min, or radius_mean"
                                                                   : "grains.radius_min";
  std::fprintf(out, " (%s), or with 100 times softer contacts (model.softening)\n", where.c_str());
  if (total <= a_day) return;
  const double shorten = total / a_day, size = sizes.smallest * std::pow(shorten, 2.0 / 3);
  if (size < sizes.d50)
    std::fprintf(out,
                 "                a day in all with none below %.3g m (D50 is %.3g m); for slow shear with "
                 "model.density_scaling = %.2g",
                 size, sizes.d50, 0.5 * size);
  else
    std::fprintf(out, "                more than a day even with all at D50, %.3g m", sizes.d50);
  std::fprintf(out, "; or with model.softening = %.2g\n", c.softening * shorten * shorten);
}

}  // namespace

void check_case(const Options& options, std::FILE* out) {
  const cases::Case c = cases::load(options.directory, options.overrides);
  const Start start = start_of(c);
  const auto engine = dem::make_engine(options.backend, options.threads);
  const std::vector<std::string> warnings = precheck(c, start, *engine);
  const dem::State& state = start.before.state;
  const double n = state.size(), diameter = mean_diameter(state);
  double volume = 0;
  for (const double r : state.r) volume += dem::sphere_volume(r);
  const double area = start.box_x * start.box_y;
  const double settled = volume / 0.6 / area;  // m, at a porosity of 0.4

  std::fprintf(out, "%s\n", c.title.empty() ? c.directory.string().c_str() : c.title.c_str());
  if (c.periodic_z)
    std::fprintf(out, "  grains        %.0f, mean diameter %.4g m, box %.4g x %.4g x %.4g m, porosity %.3g\n",
                 n, diameter, start.box_x, start.box_y, start.box_z, 1 - volume / (area * start.box_z));
  else
    std::fprintf(
        out,
        "  grains        %.0f, mean diameter %.4g m, box %.4g x %.4g m, bed about %.3g m (porosity 0.4)\n", n,
        diameter, start.box_x, start.box_y, settled);
  const dem::GradingSummary sizes = dem::summary_of(state.r);
  if (sizes.largest > 1.5 * sizes.smallest)
    std::fprintf(
        out,
        "  sizes         %.4g to %.4g m (1:%.3g), by mass D10 %.4g, D50 %.4g, D60 %.4g, D90 %.4g m; Sauter "
        "mean "
        "%.4g m\n",
        sizes.smallest, sizes.largest, sizes.largest / sizes.smallest, sizes.d10, sizes.d50, sizes.d60,
        sizes.d90, sizes.sauter);
  // What density scaling makes of the density that answers to forces.
  double inertial_density = c.grains.density;
  if (c.density_scaling > 0.5 * sizes.smallest) {
    dem::Scene scaled;
    scaled.density.fill(c.grains.density), scaled.least_inertia = c.density_scaling;
    double mass = 0;
    for (const double r : state.r) mass += scaled.inertial_mass(r, dem::Material::grain);
    inertial_density = mass / volume;
    std::fprintf(
        out,
        "  scaling       radii below %.4g m have its inertia: the bed's is %.3g times its own, and the step "
        "%.3g times as long\n",
        c.density_scaling, inertial_density / c.grains.density,
        std::pow(2 * c.density_scaling / sizes.smallest, 1.5));
  }
  if (c.start.empty() && c.grains.distribution == "bimodal") print_mixture(out, c.grains, state, volume);
  if (!start.roles.empty())
    std::fprintf(out, "  roles         %td grains of bottom_layer, %td of top_layer\n",
                 std::ranges::count(start.roles, dem::BodyId::bottom_layer),
                 std::ranges::count(start.roles, dem::BodyId::top_layer));
  if (!start.note.empty()) std::fprintf(out, "  start         %s\n", start.note.c_str());
  std::fprintf(out, "  memory        about %.0f MB\n", bytes_needed(n, c.has_water()) / 1e6);

  if (c.preset != "none" || c.softening != 1) {
    const bool hertz = is_hertz(c);
    std::string f;
    for (const cases::Stage& stage : c.stages) f += cases::to_toml(stage.f) + " ";
    std::fprintf(out, "  preset        %s: f of the stages %s; stiffness divided by %g: %s = %.4g %s\n",
                 c.preset.c_str(), f.c_str(), c.softening, hertz ? "young" : "k_n",
                 hertz ? c.elastic.young / c.softening : c.contact.k_n, hertz ? "Pa" : "N/m");
  }

  std::fprintf(out, "  backend       %s\n", engine->describe().c_str());
  Estimate estimate(c, start, *engine);
  double total = 0;
  bool complete = true, any = false;                          // of the stages' times is known
  double shortest = std::numeric_limits<double>::infinity();  // s, step
  for (std::size_t k = 0; k < c.stages.size(); ++k) {
    const cases::Stage& wanted = c.stages[k];
    output::Checkpoint now = foreseen(c, k, start);
    Stage stage = prepare(c, k, start, now);
    const dem::State& s = now.state;
    const dem::Scene& scene = stage.scene;
    // Before the bed has settled its height is not known: from the volume of the grains.
    const double height = c.start.empty() ? settled : stage.height_0;
    double strain_rate =
        wanted.strain_rate != 0 ? wanted.strain_rate : layer_velocity(wanted, scene) / height;
    const double duration = wanted.duration > 0   ? wanted.duration
                            : wanted.porosity > 0 ? stage.duration
                                                  : wanted.strain / std::abs(strain_rate);
    const double steps = std::max(1.0, std::round(duration / scene.dt));
    Estimate::Time time{steps, std::numeric_limits<double>::quiet_NaN()};
    std::string unknown;
    try {
      const bool squeezed = k == 0 && c.start.empty() && wanted.kind == cases::Stage::Kind::uniaxial;
      if (presses(stage) || squeezed)
        throw error("grains that are pressed are loose first and dense in the end");
      time = estimate.stage(k, duration, scene.dt);
      total += time.seconds;
    } catch (const Error& why) {  // of a bed that was made up, which the run may never meet
      unknown = why.what();
      complete = false;
    }
    const double critical = step_by_eq_9(scene, s, 2.0);  // 2/omega_0, par. 23
    std::fprintf(out, "  stage %zu: %s\n", k + 1, wanted.name.c_str());
    std::fprintf(out, "    step        %.4g s, %.3g of the two-body limit 2/omega_0; %.0f steps for %.4g s\n",
                 scene.dt, scene.dt / critical, steps, duration);
    const double network = dem::critical_step(dem::spectrum(scene, s));
    if (std::isfinite(network))
      std::fprintf(
          out, "    network     %.4g s critical with the contacts of the start; the step is %.3g of it%s\n",
          network, scene.dt / network,
          scene.dt > network ? "  (above 1: the bed will blow up; take a smaller step or dt = \"auto\")"
                             : "");
    if (c.automatic_dt)
      std::fprintf(out, "    dt = auto   %.3g of the critical step, as the contacts come and go\n", c.safety);
    const double pressure = std::max(wanted.normal_stress, wanted.pressure);
    if (pressure > 0) {
      const double r = 0.5 * diameter, k_n = dem::as_linear(c.contact, r, pressure).k_n;
      std::fprintf(out, "    stiffness   k_n/(sigma_0 d) = %.3g%s\n", k_n / (pressure * diameter),
                   k_n / (pressure * diameter) < 1e4 ? "  (below 1e4: softer than rigid grains)" : "");
      if (strain_rate != 0) {
        const double inertia = std::abs(strain_rate) * r * std::sqrt(inertial_density / pressure);
        std::fprintf(out, "    inertia     I = %.3g (eq. 1)%s\n", inertia,
                     inertia > 1e-3 ? "  (above 1e-3: not pseudo-static)" : "");
      }
    }
    if (const auto water = fill(stage, s, now.water, stage.goes_on))
      print_water(out, c, stage, s, *water,
                  wanted.kind == cases::Stage::Kind::settle ? settled : stage.height_0, strain_rate,
                  pressure > 0 ? pressure : weight_above(scene, s));
    if (unknown.empty())
      std::fprintf(out, "    time        about %s at %.3g ms a step\n", readable_time(time.seconds).c_str(),
                   time.ms());
    else
      std::fprintf(out, "    time        not known: %s\n", unknown.c_str());
    shortest = std::min(shortest, scene.dt), any = any || unknown.empty();
  }
  if (any)
    std::fprintf(out, "  all           about %s, timed on beds like those to come%s\n",
                 readable_time(total).c_str(), complete ? "" : "; without stages whose time is not known");
  else
    std::fprintf(out, "  all           not known\n");
  if (estimate.of_one_size())
    std::fprintf(
        out,
        "                timed with as many grains of one size, as sizes of 1:%.3g make no bed in a moment: "
        "expect more\n",
        sizes.largest / sizes.smallest);
  if (c.dt == 0 && (total > long_run || shortest < short_step)) print_what_would_do(out, c, sizes, total);
  for (const std::string& w : warnings) std::fprintf(out, "  warning: %s\n", w.c_str());
}

}  // namespace moraine::run
