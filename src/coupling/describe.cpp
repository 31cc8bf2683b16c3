#include "coupling/describe.hpp"

#include <cmath>
#include <numbers>
#include <sstream>

namespace moraine::coupling {

constexpr double tolerable = 0.02;  // of error_of_few_cells(), to say nothing

double error_of_few_cells(const Water& w) {
  const auto drained = [](const fluid::Side& s) { return s.kind == fluid::Side::Kind::pressure; };
  const bool top = w.top == TopSide::drained && drained(w.sides.high[2]), bottom = drained(w.sides.low[2]);
  if (!top && !bottom) return 0;
  const double n = top && bottom ? 0.5 * w.cells[2] : w.cells[2], angle = std::numbers::pi / (2 * n);
  return angle * angle / 6;
}

std::string describe_grid(const Water& water, const Skeleton& skeleton, const Stability& stability,
                          std::int64_t interval) {
  const fluid::Grid& grid = skeleton.grid();
  double d = 0;
  for (const double v : skeleton.volume()) d += 2 * std::cbrt(v * 3 / (4 * std::numbers::pi));
  d /= static_cast<double>(skeleton.volume().size());
  std::ostringstream out;
  out.precision(3);
  out << "water: " << grid.n[0] << " x " << grid.n[1] << " x " << grid.n[2] << " cells of " << grid.h(0)
      << " x " << grid.h(1) << " x " << grid.h(2) << " m (" << std::cbrt(grid.cell_volume()) / d
      << " d), exchange every ";
  if (interval == 1)
    out << "step";
  else
    out << interval << " steps";
  out << " (at most " << stability.longest << ")";
  if (const double error = error_of_few_cells(water); error > tolerable) {
    Water enough = water;
    while (error_of_few_cells(enough) > tolerable) ++enough.cells[2];
    out << "; so few over the height even out the pressure " << 100 * error
        << " % too fast (fluid.cells_z = " << enough.cells[2] << ": " << 100 * error_of_few_cells(enough)
        << " %)";
  }
  return out.str();
}

std::string describe_outside(const fluid::Grid& grid, const fluid::Sides& sides, const Outside& outside) {
  std::ostringstream text;
  text.precision(3);
  for (int a = 0; a < 3; ++a)
    for (const bool high : {false, true}) {
      const int count = outside.grains[a][high];
      if (outside.volume[a][high] == 0) continue;
      text << (text.tellp() > 0 ? "; " : "");
      if (count > 0)
        text << count << (count == 1 ? " grain" : " grains");
      else
        text << "parts of grains";
      text << " beyond "
           << "xyz"[a] << " = " << (high ? grid.length[a] : 0) << " m (" << outside.volume[a][high]
           << " m3 of solids)";
      const fluid::Side& side = high ? sides.high[a] : sides.low[a];
      if (side.kind == fluid::Side::Kind::closed) text << ", where no water can take their place";
    }
  return text.str();
}

std::string describe_solver(const fluid::PressureStep::Report& r) {
  std::ostringstream out;
  out.precision(3);
  out << r.solver;
  if (r.iterations > 0) out << ": " << double(r.iterations) / double(r.solves) << " iterations a solve";
  if (r.factorisations > 0) out << ", " << r.factorisations << " factorisations in " << r.solves << " solves";
  return out.str();
}

}  // namespace moraine::coupling
