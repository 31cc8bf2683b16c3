#include "coupling/stability.hpp"

#include <algorithm>
#include <cmath>

#include "coupling/thrust.hpp"
#include "coupling/walls.hpp"
#include "dem/spectrum.hpp"
#include "error.hpp"

namespace moraine::coupling {

namespace {

// Of the step at which grains and water would swing up: contacts come and go.
constexpr double most_of_limit = 0.9;
constexpr int power_iterations = 60;

// Mixed, so that the stiffest mode is in it.
std::vector<double> first_guess(const fluid::Grid& grid) {
  std::vector<double> p(grid.cells());
  for (std::size_t c = 0; c < p.size(); ++c) {
    int i = static_cast<int>(c) % grid.n[0], j = static_cast<int>(c) / grid.n[0] % grid.n[1],
        k = static_cast<int>(c) / (grid.n[0] * grid.n[1]);
    p[c] = ((i + j + k) % 2 ? -1 : 1) + 0.3 * std::sin(1.7 * static_cast<double>(c));
  }
  return p;
}

// Largest w^2 of grains (and an impermeable wall) on the stiffness of undrained water, by power iteration on
// M^-1 B^T D^T C^-1 D B, from above by its last change.
double water_frequency(const Skeleton& skeleton, const Water& water, const std::vector<double>& storage,
                       const dem::Scene& scene, const dem::State& grains) {
  const fluid::Grid& grid = skeleton.grid();
  const Mapping& mapping = skeleton.mapping();
  const std::vector<double>& volume = skeleton.volume();
  fluid::Sides sides = sides_of(water);  // how they differ from rest
  for (auto* list : {&sides.low, &sides.high})
    for (fluid::Side& s : *list) s.value = s.amplitude = 0, s.history = {};
  const double wall_mass = mass_of_free_wall(scene);

  Thrust thrust{zeros_on_faces(grid), zeros_on_faces(grid)};
  std::vector<dem::WaterRow> force(volume.size() + 1, dem::WaterRow{});
  std::vector<dem::Vec3d> d(volume.size());
  Faces u = zeros_on_faces(grid);
  std::vector<double> p = first_guess(grid), div_u(p.size());
  double lambda = 0, last = 0;
  for (int n = 0; n < power_iterations; ++n) {
    double norm = 0;
    for (const double v : p) norm += v * v;
    norm = std::sqrt(norm / static_cast<double>(p.size()));
    if (norm == 0) return 0;  // water that no motion presses
    for (double& v : p) v /= norm;
    find_thrust(skeleton, sides, Closure::full, 0, p, thrust);
    for (dem::Index c = 0; c < mapping.chunks(); ++c) mapping.push(c, thrust.to_push, force.data());
    for (std::size_t i = 0; i < d.size(); ++i)
      d[i] = (1 / scene.inertial_mass_of_volume(volume[i], grains.material_of(static_cast<dem::Index>(i)))) *
             force[i].f;
    mapping.apply(d, u);
    if (water.top == TopSide::impermeable) {
      const double a = wall_mass > 0 ? mean_below_top(grid, p) * scene.area() / wall_mass : 0;
      for (std::size_t f = grid.face(2, 0, 0, grid.n[2]); f < u[2].size(); ++f)
        u[2][f] = grid.face_area(2) * a;
    }
    divergence(grid, u, div_u);
    last = lambda;
    double along = 0, norm2 = 0;
    for (std::size_t c = 0; c < p.size(); ++c) {
      const double next = div_u[c] / storage[c];
      along += next * p[c], norm2 += p[c] * p[c];
      p[c] = next;
    }
    lambda = along / norm2;
  }
  return std::max(0.0, lambda + std::abs(lambda - last));  // of nothing but rounding it may be below
}

}  // namespace

Stability stability_of(const Skeleton& skeleton, const Water& water, const std::vector<double>& storage,
                       const dem::Scene& scene, const dem::State& grains) {
  Stability s;
  s.w_sk = std::sqrt(dem::spectrum(scene, grains).stiffness);
  // A bed that has not met yet will.
  s.w_sk = std::max(s.w_sk, 2 / dem::one_contact_step(scene, grains));
  s.w_f = std::sqrt(water_frequency(skeleton, water, storage, scene, grains));
  s.longest_dt = most_of_limit * 2 / std::hypot(s.w_sk, s.w_f);
  s.longest = static_cast<std::int64_t>(s.longest_dt / scene.dt);
  return s;
}

std::int64_t choose_interval(const Stability& s, std::int64_t asked, double dt) {
  if (s.longest < 1)
    throw error("pore water: grains on the water's stiffness swing at ", s.w_f, " rad/s, the contacts at ",
                s.w_sk, " rad/s, so a step of ", dt,
                " s is unstable even with an exchange at each; expected a step of at most ", s.longest_dt,
                " s (a smaller model.f), larger cells, or a heavier wall.mass");
  if (asked > s.longest)
    throw error("fluid.exchange_interval = ", asked, ": unstable; expected at most ", s.longest, " steps of ",
                dt, " s (contacts swing at ", s.w_sk, " rad/s, the water at ", s.w_f,
                " rad/s), or 0 for an automatic one");
  return asked > 0 ? asked : s.longest;
}

}  // namespace moraine::coupling
