#include "dem/packing.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "dem/scene.hpp"
#include "error.hpp"

namespace moraine::dem {

namespace {

constexpr double margin = 1.05;  // a grain stays this many radii away from the sides of its cell
constexpr double apart = 1e-6;   // of both radii, between grains at random places

// Grains at random places, the largest first, each where it meets none of those before. A grid for each class
// of sizes; grains are no larger than those before, so that no class holds smaller ones.
class RandomPlaces {
 public:
  RandomPlaces(Vec3d box, bool periodic_x, bool periodic_y, bool periodic_z)
      : box_(box), periodic_{periodic_x, periodic_y, periodic_z} {}

  // False where no place was found.
  bool put(double r, Random& random) {
    if (classes_.empty() || r <= classes_.back().largest / 2) classes_.emplace_back(box_, r);
    for (int attempt = 0; attempt < attempts; ++attempt) {
      Vec3d x;
      for (int a = 0; a < 3; ++a) {
        const double away = periodic_[a] ? 0 : margin * r;
        x[a] = away + (box_[a] - 2 * away) * random.uniform();
      }
      if (!is_free(x, r)) continue;
      classes_.back().cells[classes_.back().at(x)].push_back(static_cast<Index>(x_.size()));
      x_.push_back(x), r_.push_back(r);
      return true;
    }
    return false;
  }
  std::vector<Vec3d> places() && { return std::move(x_); }

 private:
  static constexpr int attempts = 20000;
  struct Class {
    Class(const Vec3d& box, double r) : largest(r) {
      for (int a = 0; a < 3; ++a) {
        n[a] = std::max<Index>(1, static_cast<Index>(std::min(box[a] / (2 * r), 300.0)));
        inverse[a] = n[a] / box[a];
      }
      cells.resize(std::size_t(n[0]) * n[1] * n[2]);
    }
    Index along(int a, double x) const { return static_cast<Index>(std::floor(x * inverse[a])); }
    std::size_t index(Index i, Index j, Index k) const { return (std::size_t(k) * n[1] + j) * n[0] + i; }
    std::size_t at(const Vec3d& x) const {
      const auto in = [&](int a) { return std::clamp<Index>(along(a, x[a]), 0, n[a] - 1); };
      return index(in(0), in(1), in(2));
    }
    double largest;  // m, radius
    Index n[3];
    Vec3d inverse;
    std::vector<std::vector<Index>> cells;
  };

  bool is_free(const Vec3d& x, double r) const {
    for (const Class& c : classes_) {
      const double reach = (r + c.largest) * (1 + 2 * apart);
      Index low[3], high[3];
      for (int a = 0; a < 3; ++a) {
        low[a] = c.along(a, x[a] - reach), high[a] = c.along(a, x[a] + reach);
        if (!periodic_[a]) {
          low[a] = std::max<Index>(low[a], 0), high[a] = std::min(high[a], c.n[a] - 1);
        } else if (high[a] - low[a] + 1 >= c.n[a]) {
          low[a] = 0, high[a] = c.n[a] - 1;
        }
      }
      for (Index k = low[2]; k <= high[2]; ++k)
        for (Index j = low[1]; j <= high[1]; ++j)
          for (Index i = low[0]; i <= high[0]; ++i)
            for (const Index g :
                 c.cells[c.index((i + c.n[0]) % c.n[0], (j + c.n[1]) % c.n[1], (k + c.n[2]) % c.n[2])]) {
              Vec3d d = x - x_[g];
              for (int a = 0; a < 3; ++a)
                if (periodic_[a]) d[a] -= box_[a] * std::round(d[a] / box_[a]);
              const double least = (r + r_[g]) * (1 + apart);
              if (dot(d, d) < least * least) return false;
            }
    }
    return true;
  }

  Vec3d box_;
  bool periodic_[3];
  std::vector<Class> classes_;
  std::vector<Vec3d> x_;
  std::vector<double> r_;
};

std::vector<double> draw(const Packing& p, Random& random) {
  if (p.distribution == Packing::Distribution::ranges) return draw_radii(p.ranges, p.count, random);
  std::vector<double> r(p.count);
  const double relative = p.radius_std / p.radius_mean;
  const double variance = std::log(1 + relative * relative), mean = std::log(p.radius_mean) - 0.5 * variance;
  if (p.distribution == Packing::Distribution::uniform) {
    for (double& radius : r) radius = p.radius_min + (p.radius_max - p.radius_min) * random.uniform();
    return r;
  }
  const double most = p.radius_max > 0 ? p.radius_max : std::numeric_limits<double>::infinity();
  for (double& radius : r) {
    int attempts = 0;
    do {
      radius = std::exp(mean + std::sqrt(variance) * random.normal());
      if (++attempts > 10000)
        throw error("no radius between grains.radius_min = ", p.radius_min,
                    " m and grains.radius_max = ", most, " m was drawn in ", attempts - 1,
                    " attempts; expected limits around the mean, ", p.radius_mean, " m");
    } while (!(radius >= p.radius_min && radius <= most));
  }
  return r;
}

double mean_volume_radius(const std::vector<double>& r) {
  double volume = 0;
  for (const double radius : r) volume += radius * radius * radius;
  return std::cbrt(volume / static_cast<double>(r.size()));
}

void expect_box(const Packing& p) {
  if (!(p.box_x > 0 && p.box_y > 0))
    throw error(
        "grains at random places (grains.placement) need a box; expected box.x and box.y of more than 0 m");
}

// The box of this volume whose sides are equal where `box` has 0; `box` itself where it has none.
Vec3d with_sides(Vec3d box, double volume) {
  int open = 0;
  for (int a = 0; a < 3; ++a)
    if (box[a] > 0)
      volume /= box[a];
    else
      ++open;
  const double side = open == 3 ? std::cbrt(volume) : open == 2 ? std::sqrt(volume) : volume;
  for (int a = 0; a < 3; ++a)
    if (!(box[a] > 0)) box[a] = side;
  return box;
}

LooseGrains at_random_places(const Packing& p, std::vector<double> r, Random& random) {
  if (!p.periodic_z) expect_box(p);
  std::sort(r.begin(), r.end(), std::greater<>());
  double solid = 0;
  for (const double radius : r) solid += sphere_volume(radius);
  const double most = 2 * margin * r[0];
  Vec3d box{p.box_x, p.box_y, p.box_z};
  const double loose = solid / p.solid_fraction;  // m3
  if (p.periodic_z)
    box = with_sides(box, loose);
  else
    box.z = std::max(loose / (p.box_x * p.box_y), most);
  for (const double side : {box.x, box.y, box.z})
    if (side < most)
      throw error("the largest grain, of ", 2 * r[0], " m, does not fit into a box ", side, " m wide");
  RandomPlaces places(box, p.periodic_x, p.periodic_y, p.periodic_z);
  for (std::size_t i = 0; i < r.size(); ++i)
    if (!places.put(r[i], random))
      throw error("no place was found for grain ", i + 1, " of ", r.size(), ", ", 2 * r[i],
                  " m wide, where they fill ", solid / (box.x * box.y * box.z),
                  " of the space; expected a smaller grains.solid_fraction, or a larger box");
  const double cell = p.cell * 2 * mean_volume_radius(r);
  // Ids in no order of size.
  std::vector<Vec3d> x = std::move(places).places();
  for (std::size_t i = r.size() - 1; i > 0; --i) {
    const auto j = static_cast<std::size_t>(random.uniform() * static_cast<double>(i + 1));
    std::swap(r[i], r[j]), std::swap(x[i], x[j]);
  }
  return {grains_at_rest(std::move(r), std::move(x)), box.x, box.y, p.periodic_z ? box.z : 0, cell};
}

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

LooseGrains make_loose_grains(const Packing& p) {
  Random random(p.seed);
  std::vector<double> r = draw(p, random);
  if (p.placement == Packing::Placement::random) return at_random_places(p, std::move(r), random);
  if (p.distribution == Packing::Distribution::ranges)  // drawn by size
    for (std::size_t i = r.size() - 1; i > 0; --i)
      std::swap(r[i], r[static_cast<std::size_t>(random.uniform() * static_cast<double>(i + 1))]);
  const double r_max = *std::max_element(r.begin(), r.end());

  LooseGrains out;
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
