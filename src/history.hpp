// What drives a bed against time: known at some times, and between them straight or constant. One type for
// stresses, velocities and pressures; times in s, values in SI units.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace moraine {

struct History {
  enum class Between { linear, steps };  // steps: each value from its time on
  Between between = Between::linear;
  bool stays = false;         // after its last time; else it must reach to the end of what it drives
  std::vector<double> time;   // s, rising; empty: there is none, the value does not change
  std::vector<double> value;  // as many

  // Between two times: value + rate (t - since).
  struct Piece {
    double value, rate, since;
  };

  bool is_there() const { return !time.empty(); }
  bool covers(double end) const { return stays || time.empty() || time.back() >= end * (1 - 1e-9); }

  // Of a history that is there. From a time on its own piece counts; before the first time the first value
  // does, after the last the last.
  Piece piece_at(double t) const {
    const auto later = static_cast<std::size_t>(std::upper_bound(time.begin(), time.end(), t) - time.begin());
    if (later == 0) return {value[0], 0, time[0]};
    const std::size_t k = later - 1;
    const bool sloped = between == Between::linear && later < time.size();
    return {value[k], sloped ? (value[later] - value[k]) / (time[later] - time[k]) : 0, time[k]};
  }
  double at(double t) const {
    const Piece p = piece_at(t);
    return p.rate != 0 ? std::fma(p.rate, t - p.since, p.value) : p.value;
  }
  double next_time(double t) const {  // s, where another piece begins; infinite after the last
    const auto later = std::upper_bound(time.begin(), time.end(), t);
    return later == time.end() ? std::numeric_limits<double>::infinity() : *later;
  }
  double least() const { return *std::min_element(value.begin(), value.end()); }
  double largest() const {  // by magnitude
    return *std::max_element(value.begin(), value.end(),
                             [](double a, double b) { return std::abs(a) < std::abs(b); });
  }
  bool operator==(const History&) const = default;
};

// Of what drives the bodies of a stage.
struct Histories {
  History normal_stress, shear_stress;  // Pa
  History velocity;                     // m/s, of the top layer
  bool operator==(const Histories&) const = default;
};

}  // namespace moraine
