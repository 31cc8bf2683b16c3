#include "dem/packing.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "error.hpp"

namespace moraine::dem {

namespace {

constexpr double margin = 1.05;  // a grain stays this many radii away from the sides of its cell

// Not std::normal_distribution, whose numbers differ from one standard library to the next.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform() { return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1p-53; }
  double normal() { return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * std::numbers::pi * uniform()); }

 private:
  std::mt19937_64 engine_;
};

}  // namespace

State grains_at_rest(std::vector<double> r, std::vector<Vec3d> x) {
  State s;
  const std::size_t n = r.size();
  s.id.resize(n);
  std::iota(s.id.begin(), s.id.end(), 0);
  s.r = std::move(r);
  s.x_start = x;
  s.x = std::move(x);
  for (auto* v : {&s.v, &s.omega, &s.rotation, &s.force, &s.torque}) v->assign(n, Vec3d{0, 0, 0});
  s.part_of.assign(n, BodyId::none);
  return s;
}

Lattice make_lattice(const Packing& p) {
  Random random(p.seed);
  std::vector<double> r(p.count);
  const double relative = p.radius_std / p.radius_mean;
  const double variance = std::log(1 + relative * relative), mean = std::log(p.radius_mean) - 0.5 * variance;
  for (double& radius : r)
    radius = p.distribution == Packing::Distribution::lognormal
                 ? std::exp(mean + std::sqrt(variance) * random.normal())
                 : p.radius_min + (p.radius_max - p.radius_min) * random.uniform();
  const double r_max = *std::max_element(r.begin(), r.end());

  Lattice out;
  out.cell = p.cell * 2 * r_max;
  out.box_x = p.box_x > 0 ? p.box_x : static_cast<double>(p.columns_x) * out.cell;
  out.box_y = p.box_y > 0 ? p.box_y : static_cast<double>(p.columns_y) * out.cell;
  const Vec3d cell{out.box_x / static_cast<double>(p.columns_x), out.box_y / static_cast<double>(p.columns_y),
                   out.cell};
  for (const double side : {cell.x, cell.y, cell.z})
    if (side < 2 * margin * r_max)
      throw error("the grains overlap at the start: a lattice cell is ", side,
                  " m wide and the largest grain needs ", 2 * margin * r_max,
                  " m; expected fewer grains.columns_x/columns_y, a larger box, or grains.cell >= ", margin);

  std::vector<Vec3d> x(p.count);
  for (std::int64_t i = 0; i < p.count; ++i) {
    const std::int64_t place[3] = {i % p.columns_x, i / p.columns_x % p.columns_y,
                                   i / (p.columns_x * p.columns_y)};
    for (int a = 0; a < 3; ++a) {
      const double free = cell[a] - 2 * margin * r[i];
      x[i][a] = static_cast<double>(place[a]) * cell[a] + margin * r[i] + free * random.uniform();
    }
  }
  out.state = grains_at_rest(std::move(r), std::move(x));
  return out;
}

}  // namespace moraine::dem
