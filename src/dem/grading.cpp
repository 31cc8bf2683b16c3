#include "dem/grading.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>

#include "error.hpp"

namespace moraine::dem {

double Random::uniform() { return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1p-53; }
double Random::normal() {
  return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * std::numbers::pi * uniform());
}

namespace {

// Integral of r^(-1 - e) from a to b.
double number_between(double a, double b, double e) {
  return e == 0 ? std::log(b / a) : (std::pow(a, -e) - std::pow(b, -e)) / e;
}
// The radius with the share u of the range's grains below it.
double radius_at(const SizeRange& range, double u) {
  if (range.r_max == range.r_min) return range.r_min;
  const double e = range.exponent;
  if (e == 0) return range.r_min * std::pow(range.r_max / range.r_min, u);
  const double low = std::pow(range.r_min, -e), high = std::pow(range.r_max, -e);
  return std::clamp(std::pow(low + u * (high - low), -1 / e), range.r_min, range.r_max);
}

}  // namespace

std::vector<SizeRange> ranges_of(const std::vector<Sieve>& sieves,
                                 const std::function<std::string(std::size_t)>& name) {
  if (sieves.size() < 2) throw error("a grading has ", sieves.size(), " sieves; expected two or more");
  const auto at = [&](std::size_t k) { return name ? name(k) : text("sieve ", k + 1); };
  for (std::size_t k = 0; k < sieves.size(); ++k) {
    const Sieve& s = sieves[k];
    if (!(s.size > 0) || !std::isfinite(s.size))
      throw error(at(k), ": size ", s.size, " m; expected more than 0");
    if (!(s.passing >= 0 && s.passing <= 1))
      throw error(at(k), ": ", 100 * s.passing,
                  " % finer; expected 0 to 100 (in a column \"finer (%)\"; without a unit shares, 0 to 1)");
    if (k > 0 && !(s.size > sieves[k - 1].size && s.passing >= sieves[k - 1].passing))
      throw error(at(k), " (", s.size, " m, ", 100 * s.passing, " %) after one of ", sieves[k - 1].size,
                  " m, ", 100 * sieves[k - 1].passing,
                  " %; expected larger sizes with as much or more that is finer, from the finest on");
  }
  if (sieves.front().passing != 0)
    throw error(at(0), ": the finest sieve, ", sieves.front().size, " m, has ", 100 * sieves.front().passing,
                " % finer; expected 0, or it is not known how fine the rest is");
  if (std::abs(sieves.back().passing - 1) > 1e-9)
    throw error(at(sieves.size() - 1), ": the coarsest sieve, ", sieves.back().size, " m, has ",
                100 * sieves.back().passing, " % finer; expected 100");
  std::vector<SizeRange> ranges;
  double total = 0;
  for (std::size_t k = 1; k < sieves.size(); ++k) {
    const double mass = sieves[k].passing - sieves[k - 1].passing;
    if (mass == 0) continue;
    const double a = sieves[k - 1].size / 2, b = sieves[k].size / 2;
    // Mass evenly over log r is dN ~ r^-4 dr.
    ranges.push_back({a, b, 3, mass / std::log(b / a) * number_between(a, b, 3)});
    total += ranges.back().count;
  }
  for (SizeRange& range : ranges) range.count /= total;
  return ranges;
}

std::vector<double> draw_radii(const std::vector<SizeRange>& ranges, std::int64_t n, Random& random) {
  std::vector<double> r(n);
  std::size_t k = 0;
  double below = 0;  // share of the grains in the ranges before
  for (std::int64_t i = 0; i < n; ++i) {
    const double u = (static_cast<double>(i) + random.uniform()) / static_cast<double>(n);
    while (k + 1 < ranges.size() && u >= below + ranges[k].count) below += ranges[k++].count;
    r[i] = radius_at(ranges[k], std::clamp((u - below) / ranges[k].count, 0.0, 1.0));
  }
  std::sort(r.begin(), r.end(), std::greater<>());
  return r;
}

namespace {

double normal_share(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }  // below z

// Of a LogNormal: in z = (log r - mu)/sigma its radii are normal.
class Population {
 public:
  explicit Population(const LogNormal& p) : of_(p) {
    const double relative = p.std / p.mean, variance = std::log1p(relative * relative);
    mu_ = std::log(p.mean) - 0.5 * variance, sigma_ = std::sqrt(variance);
    const double most = p.r_max > 0 ? p.r_max : std::numeric_limits<double>::infinity();
    if (sigma_ == 0 ? p.mean >= p.r_min && p.mean <= most : share(0) > 1e-4) return;
    throw error("no radius around ", p.mean, " m lies between grains.radius_min = ", p.r_min,
                " m and grains.radius_max = ", most, " m; expected limits around both means");
  }

  double mean_cube() const {  // m3
    if (sigma_ == 0) return of_.mean * of_.mean * of_.mean;
    return std::exp(3 * mu_ + 4.5 * sigma_ * sigma_) * share(3 * sigma_) / share(0);
  }
  void draw(std::int64_t n, Random& random, std::vector<double>& r) const {
    const double below = normal_share(low()), between = share(0);
    for (std::int64_t i = 0; i < n; ++i) {
      const double u = (static_cast<double>(i) + random.uniform()) / static_cast<double>(n);
      r.push_back(sigma_ == 0 ? of_.mean : at(below + u * between));
    }
  }

 private:
  static constexpr double far = 8.5;  // of z; beyond it lies nothing that a double could tell from 0 or 1
  double low() const { return of_.r_min > 0 ? std::max((std::log(of_.r_min) - mu_) / sigma_, -far) : -far; }
  double high() const { return of_.r_max > 0 ? std::min((std::log(of_.r_max) - mu_) / sigma_, far) : far; }
  // Of the normal distribution about `shift`, between the limits.
  double share(double shift) const { return normal_share(high() - shift) - normal_share(low() - shift); }
  double at(double wanted) const {
    double a = low(), b = high();
    for (int k = 0; k < 60; ++k) {
      const double z = 0.5 * (a + b);
      (normal_share(z) < wanted ? a : b) = z;
    }
    const double r = std::exp(mu_ + sigma_ * 0.5 * (a + b));
    return of_.r_max > 0 ? std::clamp(r, of_.r_min, of_.r_max) : std::max(r, of_.r_min);
  }

  LogNormal of_;
  double mu_, sigma_;
};

}  // namespace

std::vector<double> draw_mixture(const LogNormal& coarse, const LogNormal& fine, double fine_fraction,
                                 std::int64_t n, Random& random) {
  const Population large(coarse), small(fine);
  const double larges = (1 - fine_fraction) / large.mean_cube(), smalls = fine_fraction / small.mean_cube();
  const std::int64_t count = std::llround(static_cast<double>(n) * larges / (larges + smalls));
  if (count < 1 || count >= n)
    throw error("of ", n, " grains ", count, " would be of the coarse population and ", n - count,
                " of the fine one; expected at least one of each: ",
                std::ceil((larges + smalls) / std::min(larges, smalls)),
                " grains or more (grains.count), or another ", "grains.fine_fraction than ", fine_fraction);
  std::vector<double> r;
  large.draw(count, random, r), small.draw(n - count, random, r);
  std::sort(r.begin(), r.end(), std::greater<>());
  return r;
}

GradingSummary summary_of(std::vector<double> r) {
  std::sort(r.begin(), r.end());
  double sum = 0, area = 0, volume = 0;
  for (const double radius : r) sum += radius, area += radius * radius, volume += radius * radius * radius;
  const auto finer = [&](double share) {
    double mass = 0;
    for (const double radius : r)
      if ((mass += radius * radius * radius) >= share * volume) return 2 * radius;
    return 2 * r.back();
  };
  return {finer(0.1),        finer(0.5),    finer(0.6),  finer(0.9), 2 * sum / static_cast<double>(r.size()),
          2 * volume / area, 2 * r.front(), 2 * r.back()};
}

}  // namespace moraine::dem
