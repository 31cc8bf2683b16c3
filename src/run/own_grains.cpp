#include "run/own_grains.hpp"

#include <algorithm>

#include "dem/touching.hpp"
#include "error.hpp"
#include "output/files.hpp"
#include "run/grain_table.hpp"
#include "run/lammps_data.hpp"
#include "run/snapshot_grains.hpp"

namespace moraine::run {

namespace {

// That shear carries a grain across a periodic side before it is written; farther off are other units.
constexpr double most_sides = 100;

void expect_inside(const cases::Case& c, const OwnGrains& own) {
  const dem::State& s = own.state;
  const double side[3] = {own.box_x, own.box_y, own.box_z};
  const bool periodic[3] = {c.periodic_x, c.periodic_y, c.periodic_z};
  const bool walls[3] = {c.walls_x, c.walls_y, c.floor};
  for (dem::Index i = 0; i < s.size(); ++i)
    for (int a = 0; a < 3; ++a) {
      if (!walls[a] && side[a] > 0) {
        const double slack = periodic[a] ? most_sides * side[a] : 0;
        if ((a < 2 || periodic[a]) && !(s.x[i][a] >= -slack && s.x[i][a] <= side[a] + slack))
          throw error(own.at(i), ": the grain at ", "xyz"[a], " = ", s.x[i][a],
                      " m lies outside the box; expected 0 to box.", "xyz"[a], " = ", side[a], " m");
      }
      if (periodic[a] || !walls[a]) continue;
      const double deepest = c.guards.max_overlap * s.r[i];
      const double below = s.r[i] - s.x[i][a], above = a < 2 ? s.x[i][a] + s.r[i] - side[a] : below;
      const double out = std::max(below, above);
      if (out > deepest)
        throw error(own.at(i), ": the grain at ", "xyz"[a], " = ", s.x[i][a], " m with r = ", s.r[i],
                    " m is ", out, " m beyond ", a == 2 ? "the floor" : "a side wall", "; expected at most ",
                    deepest, " m (guards.max_overlap)");
    }
}

void expect_apart(const cases::Case& c, const OwnGrains& own) {
  const dem::State& s = own.state;
  dem::Scene scene;
  scene.box = {own.box_x, own.box_y, own.box_z};
  scene.periodic_x = c.periodic_x, scene.periodic_y = c.periodic_y, scene.periodic_z = c.periodic_z;
  std::vector<dem::GrainRow> rows(s.size(), dem::GrainRow{});
  for (dem::Index i = 0; i < s.size(); ++i) rows[i].x = s.x[i], rows[i].r = rows[i].r_again = s.r[i];
  dem::TouchingPairs().each(scene, rows.data(), s.size(), [&](dem::Index i, dem::Index j, double overlap) {
    const double smaller = std::min(s.r[i], s.r[j]);
    if (overlap <= c.guards.max_overlap * smaller) return;
    throw error(own.at(std::min(i, j)), ": this grain overlaps that of ", own.at(std::max(i, j)), " by ",
                overlap, " m, ", overlap / smaller, " of the smaller radius; expected at most ",
                c.guards.max_overlap, " (guards.max_overlap)");
  });
}

}  // namespace

std::string OwnGrains::at(dem::Index i) const {
  return lines.empty() ? text(file.string(), ", grain ", i) : text(file.string(), ", line ", lines[i]);
}

void expect_same_sides(const cases::Case& c, const dem::Vec3d& box, const std::array<bool, 3>& periodic) {
  const dem::Vec3d given{c.box_x, c.box_y, c.box_z};
  const bool in_case[3] = {c.periodic_x, c.periodic_y, c.periodic_z};
  for (int a = 0; a < 3; ++a)
    if (in_case[a] && periodic[a] && box[a] > 0 && given[a] > 0 &&
        std::abs(given[a] - box[a]) > 1e-9 * box[a])
      throw error(c.start.string(), ": its grains fill a box of ", box[a], " m along ", "xyz"[a],
                  ", not of box.", "xyz"[a], " = ", given[a], " m; expected 0, to take that of `start`");
}

bool has_own_grains(const std::filesystem::path& start) {
  return !start.empty() && (is_grain_table(start) || is_lammps_data(start) || output::is_snapshot(start));
}

OwnGrains read_own_grains(const cases::Case& c) {
  OwnGrains own = is_grain_table(c.start)        ? read_grain_table(c)
                  : output::is_snapshot(c.start) ? read_snapshot_grains(c)
                                                 : read_lammps_data(c);
  if (std::ranges::count(own.roles, dem::BodyId::none) == std::ssize(own.roles)) own.roles.clear();
  expect_inside(c, own);
  expect_apart(c, own);
  return own;
}

}  // namespace moraine::run
