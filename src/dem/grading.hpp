// Sizes of grains: radii drawn from a grading. Throws Error where a grading is none.
#pragma once
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace moraine::dem {

// The same numbers wherever it runs. Not std::normal_distribution, whose numbers differ from one standard
// library to the next.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform();  // in (0, 1)
  double normal();

 private:
  std::mt19937_64 engine_;
};

// A share of the mass is finer than a sieve's mesh.
struct Sieve {
  double size;     // m, diameter
  double passing;  // 0 to 1, by mass
};

// How many grains of which radius, between two radii: dN ~ r^(-1 - exponent) dr. 3: the same mass at every
// size of a logarithmic scale; fractal gradings have the fractal dimension (2.6 or so).
struct SizeRange {
  double r_min, r_max;  // m
  double exponent;
  double count;  // share of the number of grains
};

// Between two sieves mass is spread evenly over the logarithm of size. Errors call the k-th sieve, from 0,
// name(k); "sieve 1" and so on without one.
std::vector<SizeRange> ranges_of(const std::vector<Sieve>& sieves,
                                 const std::function<std::string(std::size_t)>& name = {});
// n radii by these shares, largest first: one from each n-th part of the distribution, so that even the few
// largest grains are as many as they should be.
std::vector<double> draw_radii(const std::vector<SizeRange>& ranges, std::int64_t n, Random& random);

// Radii whose logarithm is normal, between two limits.
struct LogNormal {
  double mean, std;     // m, of the radii before the limits cut them
  double r_min, r_max;  // m; r_max = 0: none
};
// n radii of two such populations, largest first, a fraction of whose mass is of the finer; each drawn from
// equal shares as above. Throws Error where a population has no radius between its limits, or would have no
// grain.
std::vector<double> draw_mixture(const LogNormal& coarse, const LogNormal& fine, double fine_fraction,
                                 std::int64_t n, Random& random);

// What was drawn.
struct GradingSummary {
  double d10, d50, d60, d90;  // m, a tenth ... of the mass is finer
  double mean, sauter;        // m, mean diameter by number; sum of d^3 over sum of d^2
  double smallest, largest;   // m
};
GradingSummary summary_of(std::vector<double> r);

}  // namespace moraine::dem
