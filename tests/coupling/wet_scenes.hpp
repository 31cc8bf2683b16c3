// Packings in water that several tests share.
#pragma once
#include <gtest/gtest.h>

#include "../physics/scenes.hpp"
#include "coupling/pore_water.hpp"
#include "error.hpp"

namespace moraine::coupling {

using dem::Scene;
using dem::State;
using dem::Vec3d;

struct WetBed {
  Scene scene;
  State state;
};

inline void stop(State& s) {
  for (auto* v : {&s.v, &s.omega, &s.rotation}) std::fill(v->begin(), v->end(), Vec3d{0, 0, 0});
  s.at(dem::BodyId::top_wall).v.z = 0, s.step = 0, s.ledger = {};
}

inline double bed_top(const State& s) {
  double top = 0;
  for (dem::Index i = 0; i < s.size(); ++i) top = std::max(top, s.x[i].z + s.r[i]);
  return top;
}

// Where motion that is taken out time and again leads.
inline State at_rest(const Scene& scene, State s) {
  const auto engine = dem::make_engine(dem::Backend::cpu, 1);
  for (int burst = 0; burst < 40; ++burst) {
    stop(s);
    s = dem::run(*engine, scene, s, 3000);
    dem::synchronise(scene, s);
  }
  stop(s);
  return s;
}

// The same until no more comes of it: the wall stands still to 1e-8 m.
inline State quite_at_rest(const Scene& scene, State s) {
  for (double before = 1; std::abs(s.wall_z() - before) > 1e-8;) before = s.wall_z(), s = at_rest(scene, s);
  return s;
}

// Which grains touch one another or walls at three points at least: others can roll about the line through
// two, with nothing to hold them.
inline std::vector<bool> held(const State& s) {
  std::vector<bool> held(s.size(), true);
  for (bool more = true; more;) {
    std::vector<int> points(s.size());
    for (const dem::Contact& c : s.contacts)
      if (held[c.i] && held[c.j]) ++points[c.i], ++points[c.j];
    for (const dem::WallContact& c : s.wall_contacts) ++points[c.i];
    more = false;
    for (dem::Index i = 0; i < s.size(); ++i)
      if (held[i] && points[i] < 3) held[i] = false, more = true;
  }
  return held;
}

// Only these grains, with the contacts between them.
inline State only(const std::vector<bool>& kept, const State& s) {
  std::vector<dem::Index> now(s.size());
  std::vector<double> r;
  std::vector<Vec3d> x;
  for (dem::Index i = 0; i < s.size(); ++i)
    if (now[i] = static_cast<dem::Index>(r.size()); kept[i]) r.push_back(s.r[i]), x.push_back(s.x[i]);
  State out = dem::grains_at_rest(r, x);
  out.bodies = s.bodies;
  for (const auto& [i, j, spring] : s.contacts)
    if (kept[i] && kept[j]) out.contacts.push_back({now[i], now[j], spring});
  for (const auto& [i, wall, spring] : s.wall_contacts)
    if (kept[i]) out.wall_contacts.push_back({now[i], wall, spring});
  return out;
}

// The skeleton alone. Water drives loose grains through their cages, and they pump it from cell to cell: one
// of them does as much as a tenth of what 900 grains settle by.
inline WetBed without_loose_grains(WetBed bed) {
  while (true) {
    const std::vector<bool> kept = held(bed.state);
    if (std::count(kept.begin(), kept.end(), false) == 0) return bed;
    bed.state = quite_at_rest(bed.scene, only(kept, bed.state));  // some leaned on those that are gone
  }
}

// Two boulders of that radius put among the grains in place of those that are in their way.
inline State with_boulders(const State& s, double radius, double width) {
  const double height = bed_top(s);
  std::vector<double> r{radius, radius};
  std::vector<Vec3d> x{{0.3 * width, 0.3 * width, 0.3 * height}, {0.8 * width, 0.8 * width, 0.6 * height}};
  for (dem::Index i = 0; i < s.size(); ++i) {
    const auto free_of = [&](const Vec3d& boulder) {
      Vec3d d = s.x[i] - boulder;
      d.x -= width * std::round(d.x / width), d.y -= width * std::round(d.y / width);
      return dem::length(d) > radius + s.r[i];
    };
    if (free_of(x[0]) && free_of(x[1])) r.push_back(s.r[i]), x.push_back(s.x[i]);
  }
  return dem::grains_at_rest(r, x);
}

// Grains of 2 cm settled under gravity, x and y periodic; then, with a stress, pressed by a wall without
// gravity. At rest. walled: between four smooth walls in place of periodic sides.
inline WetBed make_bed(int count, int columns, double normal_stress, double boulders = 0,
                       bool walled = false) {
  dem::Packing p;
  p.count = count, p.columns_x = p.columns_y = columns;
  p.radius_mean = 0.01, p.radius_std = 0.0008, p.cell = 1.05, p.seed = 5;
  const dem::LooseGrains lattice = dem::make_loose_grains(p);
  WetBed bed;
  Scene& s = bed.scene;
  s.box = {lattice.box_x, lattice.box_y, 1};
  s.contact.fill(dem::LinearContact{1e6, 1e6, 50, 20, 0.3, 0.3});
  if (walled) {
    dem::put_side_walls(s);
    s.with(dem::Material::wall) = dem::LinearContact{1e6, 0, 50, 0, 0, 0};
  }
  s.dt = 0.1 * std::sqrt(dem::mass(s, 0.008) / s.with(dem::Material::grain).k_n);
  State state = boulders > 0 ? with_boulders(lattice.state, boulders, lattice.box_x) : lattice.state;
  dem::sort_spatially(s, state);
  const auto engine = dem::make_engine(dem::Backend::cpu, 1);
  state = dem::run(*engine, s, state, 40000);
  dem::synchronise(s, state);
  stop(state);
  if (normal_stress > 0) {
    s.gravity = 0;
    s.body(dem::BodyId::top_wall) = dem::wall_pressed_by(normal_stress, 5);
    s.with(dem::Material::grain).mu_s = s.with(dem::Material::grain).mu_d =
        0.1;  // packs more closely, and hardly slides later
    state.wall_z() = bed_top(state);
    state = dem::run(*engine, s, state, 60000);
    dem::synchronise(s, state);
    // Locked, so that it is elastic and comes to rest: sliding contacts creep for long.
    for (dem::ContactParameters& p : s.contact)
      if (p.mu_s > 0) p.mu_s = p.mu_d = 100;
    state = at_rest(s, state);
  }
  dem::sort_spatially(s, state);
  bed.state = state;
  return bed;
}

// Some 800 grains pressed at 10 kPa, 0.22 m wide and 0.11 m high.
inline const WetBed& pressed_bed() {
  static const WetBed bed = make_bed(800, 8, 1e4);
  return bed;
}
inline const WetBed& walled_bed() {  // the same between four walls
  static const WetBed bed = make_bed(800, 8, 1e4, 0, true);
  return bed;
}
// The first with two boulders, as wide as two cells of water_over().
inline const WetBed& boulder_bed() {
  static const WetBed bed = make_bed(800, 8, 1e4, 0.045);
  return bed;
}
// A column for one-dimensional problems: as many, 0.11 m wide and half a metre high.
inline const WetBed& tall_bed() {
  static const WetBed bed = make_bed(900, 5, 1e4);
  return bed;
}
inline const WetBed& heavy_bed() {  // settled, without a wall
  static const WetBed bed = make_bed(800, 6, 0);
  return bed;
}

// Sizes 1:20 under a light wall, sheared and drifting.
inline WetBed pressed_graded() {
  const dem::Bed& settled = dem::graded_bed();
  WetBed bed{settled.scene, settled.state};
  bed.scene.body(dem::BodyId::top_wall) = dem::wall_pressed_by(500, 0.5);
  bed.state.wall_z() = bed_top(bed.state);
  for (dem::Index i = 0; i < bed.state.size(); ++i) bed.state.v[i] = {2 * bed.state.x[i].z, 0.1, 0};
  return bed;
}

// Real water in cells some 2.5 diameters wide; drained at the top.
inline Water water_over(const WetBed& bed, double height = 0) {
  Water w;
  w.present = true;
  const double h = 0.05, z = height > 0 ? height : bed.state.wall_z();
  w.cells = {std::max(1, static_cast<int>(bed.scene.box.x / h)),
             std::max(1, static_cast<int>(bed.scene.box.y / h)), std::max(1, static_cast<int>(z / h))};
  w.height = height;
  w.k_c = 1e-12;
  w.sides.high[2].kind = fluid::Side::Kind::pressure;
  return w;
}

// The same under a top wall that drains, or that is tight as all other sides then are.
inline Water water_under(const WetBed& bed, TopSide top) {
  Water w = water_over(bed);
  w.top = top;
  if (top == TopSide::impermeable) w.sides = {};
  return w;
}

// A bed in water under way.
struct WetRun {
  Scene scene;
  std::unique_ptr<PoreWater> water;
  std::unique_ptr<dem::Engine> engine;

  // In an engine that another keeps.
  WetRun(const WetBed& bed, const Water& w, dem::Engine& in)
      : scene(bed.scene), water(make_pore_water(w, bed.scene, bed.state, {}, false)) {
    scene.exchange_interval = water->interval();
    in.load(scene, bed.state, water.get());
  }
  WetRun(const WetBed& bed, const Water& w, const WaterState& before = {},
         dem::Backend backend = dem::Backend::cpu, int threads = 1)
      : scene(bed.scene),
        water(make_pore_water(w, bed.scene, bed.state, before, false)),
        engine(dem::make_engine(backend, threads)) {
    scene.exchange_interval = water->interval();
    engine->load(scene, bed.state, water.get());
  }
  // At least so many steps, and up to an exchange.
  void advance(std::int64_t steps) {
    const std::int64_t m = scene.exchange_interval;
    engine->advance((steps + m - 1) / m * m);
  }
};

// A uniform pressure to begin with.
inline WaterState under_pressure(const WetBed& bed, const Water& w, double p) {
  const auto water = make_pore_water(w, bed.scene, bed.state, {}, false);
  const WaterFields f = water->fields();
  WaterState s;
  s.cells.assign(f.grid.n.begin(), f.grid.n.end());
  s.p.assign(f.grid.cells(), p), s.q.resize(f.grid.cells());
  for (std::size_t c = 0; c < s.q.size(); ++c) {
    const double phi = std::clamp(f.porosity[c], w.porosity_range[0], w.porosity_range[1]);
    s.q[c] = w.compressibility * phi * f.grid.cell_volume() * p;
  }
  return s;
}

// By m^3 points in each cell; x and y are periodic where the bed says so.
inline std::vector<double> sampled_porosity(const WetBed& bed, const fluid::Grid& grid, int m) {
  const std::array<int, 3> n{grid.n[0] * m, grid.n[1] * m, grid.n[2] * m};
  std::vector<char> solid(std::size_t(n[0]) * n[1] * n[2], 0);
  for (dem::Index g = 0; g < bed.state.size(); ++g) {
    const Vec3d& x = bed.state.x[g];
    const double r = bed.state.r[g];
    int low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      low[a] = int(std::floor((x[a] - r) / grid.h(a) * m)),
      high[a] = int(std::ceil((x[a] + r) / grid.h(a) * m));
      if (!grid.periodic[a]) low[a] = std::max(low[a], 0), high[a] = std::min(high[a], n[a] - 1);
    }
    for (int k = low[2]; k <= high[2]; ++k)
      for (int j = low[1]; j <= high[1]; ++j)
        for (int i = low[0]; i <= high[0]; ++i) {
          const Vec3d d{(i + 0.5) * grid.h(0) / m - x.x, (j + 0.5) * grid.h(1) / m - x.y,
                        (k + 0.5) * grid.h(2) / m - x.z};
          if (dot(d, d) < r * r)
            solid[(std::size_t(k) * n[1] + (j % n[1] + n[1]) % n[1]) * n[0] + (i % n[0] + n[0]) % n[0]] = 1;
        }
  }
  std::vector<double> phi(grid.cells(), 1);
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i)
        phi[grid.cell(i / m, j / m, k / m)] -=
            solid[(std::size_t(k) * n[1] + j) * n[0] + i] / double(m * m * m);
  return phi;
}

inline double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = 0;
  for (std::size_t c = 0; c < a.size(); ++c) worst = std::max(worst, std::abs(a[c] - b[c]));
  return worst;
}

// What the grains gain the water loses, under either top. also(state, sum of |force|): what else must hold.
// cells: others than those of water_over().
template <class Also>
void expect_momentum_kept(const WetBed& bed, Also&& also, const std::array<int, 3>& cells = {}) {
  for (const TopSide top : {TopSide::drained, TopSide::impermeable}) {
    Water w = water_under(bed, top);
    if (cells[0] > 0) w.cells = cells;
    if (top == TopSide::drained) w.sides.high[2].value = 3e3;
    WetRun run(bed, w);
    run.advance(3000);
    const dem::State s = run.engine->state();
    const WaterFields f = run.water->fields();
    dem::Vec3d sum{0, 0, 0};
    double scale = 0, floor = 0;  // floor: the water's thrust on it, downwards
    for (const dem::Vec3d& force : s.water_force) sum += force, scale += dem::length(force);
    for (std::size_t c = 0; c < f.grid.cell(0, 0, 1); ++c) floor += f.grid.face_area(2) * f.pressure[c];
    const double wall = run.scene.area() * run.water->state().wall_pressure;
    ASSERT_GT(scale, 1);
    // Sums of some thousand roundings; 1e-10 is asked for.
    EXPECT_NEAR(sum.x / scale, 0, 1e-12);
    EXPECT_NEAR(sum.y / scale, 0, 1e-12);
    EXPECT_NEAR((sum.z + wall - floor) / scale, 0, 1e-12);
    also(s, scale);
  }
}

}  // namespace moraine::coupling
