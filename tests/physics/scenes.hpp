// Scenes that several tests share.
#pragma once
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "dem/engine.hpp"
#include "dem/memory_order.hpp"
#include "dem/observe.hpp"
#include "dem/packing.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::dem {

inline double length(const Vec3d& a) { return std::sqrt(dot(a, a)); }
inline double mass(const Scene& s, double r) { return sphere_mass(s.density_of(Material::grain), r); }
inline double inertia(const Scene& s, double r) { return 0.4 * mass(s, r) * r * r; }

// Parameters of a contact, all of which a test has to give.
struct LinearContact {
  double k_n, k_t;          // N/m
  double gamma_n, gamma_t;  // N s/m
  double mu_s, mu_d;

  operator ContactParameters() const {
    ContactParameters p;
    p.k_n = k_n, p.k_t = k_t, p.gamma_n = gamma_n, p.gamma_t = gamma_t, p.mu_s = mu_s, p.mu_d = mu_d;
    return p;
  }
};

// Elastic spheres in place of linear springs, about as stiff as 1e5 N/m under 0.2 N.
inline void use_hertz(Scene& s, double restitution = 1) {
  for (ContactParameters& p : s.contact) {
    p.k_n = p.k_t = 0, p.E_star = 5e8, p.G_star = 1e8;
    p.zeta = damping_ratio(restitution), p.density_i = p.density_j = s.density_of(Material::grain);
  }
}
inline void resist_rolling(Scene& s, double mu_roll = 0.1, double mu_twist = 0) {
  for (ContactParameters& p : s.contact) {
    p.k_roll = 5e4, p.mu_roll = mu_roll;
    p.k_twist = mu_twist > 0 ? 3e4 : 0, p.mu_twist = mu_twist;
  }
}
inline void cohere(Scene& s, double cohesion) {  // N
  for (ContactParameters& p : s.contact) p.cohesion = cohesion;
}
// Hertz and Mindlin with all parts there are.
inline void use_every_law(Scene& s) {
  use_hertz(s, 0.8), resist_rolling(s, 0.1, 0.05), cohere(s, 0.02);
  for (ContactParameters& p : s.contact) p.mu_d = 0.8 * p.mu_s, p.gamma_t = 2;
}

inline Body wall_at_rest() {
  Body b = top_wall();
  b.z = Drive::at(0);
  return b;
}
inline Body wall_pressed_by(double stress, double mass) {  // Pa, kg
  Body b = top_wall();
  b.z = Drive::by(stress), b.mass = mass;
  return b;
}
// The bottom layer stands still.
inline void drive_top_layer(Scene& s, const Drive& along_x, bool hold_z = false) {
  s.body(BodyId::bottom_layer) = layer({}, hold_z);
  s.body(BodyId::top_layer) = layer(along_x, hold_z);
}

// Of a layer.
inline Drive changing_velocity() {
  return {.kind = Drive::Kind::velocity,
          .velocity = 0.1,
          .amplitude = 0.05,
          .frequency = 40,
          .rate = 2,
          .profile = Profile::cosine};
}
inline Drive changing_stress() {
  return {.kind = Drive::Kind::stress, .mean = 100, .amplitude = 50, .frequency = 30, .rate = 5e3};
}

// Grains alone: no gravity, no walls, no periodic sides.
inline Scene empty_space(double k) {
  Scene s;
  s.box = {1, 1, 1};
  s.periodic_x = s.periodic_y = false;
  s.body(BodyId::floor) = {};
  s.gravity = 0;
  for (ContactParameters& p : s.contact) p.k_n = p.k_t = k;
  return s;
}

// The staggered state after so many steps.
inline State run(Engine& engine, const Scene& scene, const State& start, std::int64_t steps) {
  engine.load(scene, start);
  engine.advance(steps);
  return engine.state();
}

// Slope of log(error) over log(dt), between neighbours in the two series.
inline std::vector<double> orders(const std::vector<double>& dt, const std::vector<double>& error) {
  std::vector<double> slope;
  for (std::size_t k = 1; k < dt.size(); ++k)
    slope.push_back(std::log(error[k] / error[k - 1]) / std::log(dt[k] / dt[k - 1]));
  return slope;
}

struct Bed {
  Scene scene;
  State state;
};
// Radii of five classes between `largest` and a twentieth of it, largest first; fewer small ones than would
// make as much mass in each class, which takes thousands.
inline std::vector<double> one_to_twenty(double largest) {
  std::vector<double> r;
  for (const auto& [part, count] : {std::pair{1, 3}, {2, 12}, {4, 70}, {8, 250}, {20, 300}})
    r.insert(r.end(), count, largest / part);
  return r;
}

// Grains at random places between the sides x, y and z of a box, the largest first, which overlap by a
// twentieth of the sum of their radii at most. Sides count as periodic.
inline std::vector<Vec3d> random_places(const std::vector<double>& r, const Vec3d& box, double overlap,
                                        std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Vec3d> x;
  for (std::size_t i = 0; i < r.size(); ++i)
    for (bool free = false; !free;) {
      Vec3d at{0, 0, 0};
      for (int a = 0; a < 3; ++a) at[a] = box[a] * (static_cast<double>(random() >> 11) * 0x1p-53);
      free = true;
      for (std::size_t j = 0; j < i && free; ++j) {
        Vec3d d = at - x[j];
        for (int a = 0; a < 3; ++a) d[a] -= box[a] * std::rint(d[a] / box[a]);
        const double least = (1 - overlap) * (r[i] + r[j]);
        free = dot(d, d) > least * least;
      }
      if (free) x.push_back(at);
    }
  return x;
}

// Three hundred soft grains of mixed size after so many steps under their weight; x and y are periodic.
inline Bed bed_after(std::int64_t steps, double margin = 0) {
  Packing p;
  p.count = 300, p.columns_x = p.columns_y = 5;
  p.radius_mean = 0.01, p.radius_std = 0.0005, p.cell = 1.06, p.seed = 3;
  const LooseGrains lattice = make_loose_grains(p);
  Scene s;
  s.box = {lattice.box_x, lattice.box_y, 1};
  s.contact.fill(LinearContact{1e5, 1e5, 20, 8, 0.5, 0.5});
  s.dt = 0.1 * std::sqrt(mass(s, 0.008) / s.with(Material::grain).k_n);
  s.neighbour_margin = margin;
  State state = lattice.state;
  sort_spatially(s, state);
  const auto engine = make_engine(Backend::cpu, 1);
  Bed out{s, run(*engine, s, state, steps)};
  synchronise(out.scene, out.state);
  out.state.step = 0, out.state.ledger = {};
  return out;
}
// Of sizes 1:20, x and y are periodic. Motion is taken out time and again, or small grains would long fly
// about in the pores of the large; at first under many times the weight.
inline Bed make_graded_bed(int bursts = 12) {
  const std::vector<double> r = one_to_twenty(0.02);
  Scene s;
  s.box = {0.1, 0.1, 1};
  s.contact.fill(LinearContact{1e5, 1e5, 0.5, 0.2, 0.5, 0.5});
  s.dt = 0.1 * std::sqrt(mass(s, 0.001) / s.with(Material::grain).k_n);
  std::vector<Vec3d> x = random_places(r, {0.1, 0.1, 0.06}, 0, 3);
  for (Vec3d& at : x) at.z += 0.02;
  Bed out{s, grains_at_rest(r, x)};
  sort_spatially(s, out.state);
  const auto engine = make_engine(Backend::cpu, 1);
  for (int burst = 0; burst < bursts; ++burst) {
    s.gravity = (burst < bursts / 2 ? 100 : burst < 3 * bursts / 4 ? 10 : 1) * out.scene.gravity;
    out.state.step = 0, out.state.ledger = {};
    for (auto* v : {&out.state.v, &out.state.omega}) std::fill(v->begin(), v->end(), Vec3d{0, 0, 0});
    out.state = run(*engine, s, out.state, 4000);
    synchronise(s, out.state);
  }
  out.state.step = 0, out.state.ledger = {};
  sort_spatially(out.scene, out.state);
  return out;
}
inline const Bed& graded_bed() {
  static const Bed bed = make_graded_bed();
  return bed;
}
inline const Bed& settled_bed() {  // at rest
  static const Bed bed = bed_after(60000);
  return bed;
}

// Sheared by its top layer under a loaded wall, with everything the contact law can do.
// Layers: grains whose centre is so far, m, from the floor or from the top of the bed.
inline void shear(Bed& bed, double bottom = 0.02, double upper = 0.03) {
  Scene& s = bed.scene;
  State& state = bed.state;
  double top = 0;
  for (Index i = 0; i < state.size(); ++i) top = std::max(top, state.x[i].z + state.r[i]);
  for (Index i = 0; i < state.size(); ++i)
    state.part_of[i] = state.x[i].z < bottom        ? BodyId::bottom_layer
                       : state.x[i].z > top - upper ? BodyId::top_layer
                                                    : BodyId::none;
  state.wall_z() = top;
  s.with(Material::grain).gamma_n = s.with(Material::grain).gamma_t = 0;
  s.body(BodyId::top_wall) = wall_pressed_by(500, 0.5);
  drive_top_layer(s, Drive::at(0.2));
}
inline Bed sheared_bed(Bed bed = settled_bed()) {
  shear(bed);
  return bed;
}

inline Bed sheared_graded_bed(Bed bed = graded_bed()) {
  shear(bed, 0.012, 0.021);
  return bed;
}

// Planes at both sides of these axes, which are periodic no longer.
inline void put_side_walls(Scene& s, bool along_x = true, bool along_y = true) {
  if (along_x) {
    s.periodic_x = false;
    s.body(BodyId::x_low) = plane(0, 1), s.body(BodyId::x_high) = plane(0, -1, s.box.x);
  }
  if (along_y) {
    s.periodic_y = false;
    s.body(BodyId::y_low) = plane(1, 1), s.body(BodyId::y_high) = plane(1, -1, s.box.y);
  }
}

// Grains of 2 cm that have settled between four side walls, some 1.2 diameters apart for each column.
inline Bed column_between_walls(Index count, int columns, double wall_mu, std::int64_t steps,
                                double margin = 0) {
  Packing p;
  p.count = count, p.columns_x = p.columns_y = columns;
  p.radius_mean = 0.01, p.radius_std = 0.0005, p.cell = 1.06, p.seed = 3;
  const LooseGrains lattice = make_loose_grains(p);
  Bed bed{{}, lattice.state};
  Scene& s = bed.scene;
  s.box = {lattice.box_x, lattice.box_y, 1};
  put_side_walls(s);
  s.contact.fill(LinearContact{1e5, 1e5, 20, 8, 0.5, 0.5});
  s.with(Material::wall).mu_s = s.with(Material::wall).mu_d = wall_mu;
  s.dt = 0.1 * std::sqrt(mass(s, 0.008) / s.with(Material::grain).k_n);
  s.neighbour_margin = margin;
  sort_spatially(s, bed.state);
  bed.state = run(*make_engine(Backend::cpu, 1), s, bed.state, steps);
  synchronise(s, bed.state);
  bed.state.step = 0, bed.state.ledger = {};
  return bed;
}
inline Bed walled_bed_after(std::int64_t steps) { return column_between_walls(300, 5, 0.4, steps); }
inline const Bed& walled_bed() {  // as many grains as the settled bed, at rest
  static const Bed bed = walled_bed_after(45000);
  return bed;
}
// Its side wall moves in: 0.5 mm in a hundredth of a second.
inline Bed squeezed_bed(Bed bed = walled_bed()) {
  bed.scene.body(BodyId::x_low).x = Drive::at(0.05);
  return bed;
}
// Sheared by its top layer along the walls at y; x is periodic.
inline Bed sheared_between_walls(Bed bed = walled_bed()) {
  bed.scene.periodic_x = true;
  bed.scene.body(BodyId::x_low) = bed.scene.body(BodyId::x_high) = {};
  std::erase_if(bed.state.wall_contacts,
                [](const WallContact& c) { return c.wall == BodyId::x_low || c.wall == BodyId::x_high; });
  shear(bed);
  return bed;
}

// Grains flying about in a box with three periodic sides, some of them in contact.
inline Bed cloud(Index count, double side, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
  };
  std::vector<double> r(count);
  std::vector<Vec3d> x(count);
  for (Index i = 0; i < count; ++i) {
    r[i] = uniform(0.006, 0.012);
    for (bool free = false; !free;) {  // at most slightly overlapping
      x[i] = {uniform(0, side), uniform(0, side), uniform(0, side)};
      free = true;
      for (Index j = 0; j < i && free; ++j) {
        Vec3d d = x[i] - x[j];
        for (int a = 0; a < 3; ++a) d[a] -= side * std::rint(d[a] / side);
        free = length(d) > 0.95 * (r[i] + r[j]);
      }
    }
  }
  Bed c{{}, grains_at_rest(r, x)};
  c.scene.box = {side, side, side};
  c.scene.periodic_z = true, c.scene.body(BodyId::floor) = {}, c.scene.gravity = 0;
  c.scene.contact.fill(LinearContact{1e5, 1e5, 0, 0, 0.5, 0.5});
  c.scene.dt = 0.1 * std::sqrt(mass(c.scene, 0.006) / 1e5);
  for (Index i = 0; i < count; ++i) {
    c.state.v[i] = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    c.state.omega[i] = {uniform(-50, 50), uniform(-50, 50), uniform(-50, 50)};
  }
  sort_spatially(c.scene, c.state);
  return c;
}

// The same with as much mass in each of five classes between 1:20, some eight thousand grains. Closed: z is
// periodic, too; else open, and without a floor.
inline Bed graded_cloud(bool closed, std::uint64_t seed) {
  std::vector<double> r;
  for (const int part : {1, 2, 4, 10, 20})  // one or two of the largest, as many of others as that makes
    r.insert(r.end(), part * part * part, 0.02 / part);
  Bed c{{}, grains_at_rest(r, random_places(r, {0.09, 0.09, 0.09}, 0.05, seed))};
  Scene& s = c.scene;
  s.box = {0.09, 0.09, 0.09};
  s.periodic_z = closed, s.body(BodyId::floor) = {}, s.gravity = 0;
  s.contact.fill(LinearContact{1e5, 1e5, 0, 0, 0.5, 0.5});
  s.dt = 0.1 * std::sqrt(mass(s, 0.001) / 1e5);
  std::mt19937_64 random(seed + 1);
  const auto uniform = [&](double most) {
    return most * (2 * (static_cast<double>(random() >> 11) * 0x1p-53) - 1);
  };
  for (Index i = 0; i < c.state.size(); ++i) {
    c.state.v[i] = {uniform(1), uniform(1), uniform(1)};
    c.state.omega[i] = {uniform(50), uniform(50), uniform(50)};
  }
  sort_spatially(s, c.state);
  return c;
}

// Vertical force that contacts carry through the horizontal plane at z, upwards, N.
inline double carried(const State& s, const std::vector<ContactForce>& contacts, double z) {
  double sum = 0;
  for (const ContactForce& c : contacts) {
    const double f = c.f_n.z + c.f_t.z;
    if (s.x[c.i].z > z && s.x[c.j].z <= z) sum += f;
    if (s.x[c.j].z > z && s.x[c.i].z <= z) sum -= f;
  }
  return sum;
}

}  // namespace moraine::dem
