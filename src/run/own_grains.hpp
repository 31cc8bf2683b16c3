// Grains that a case begins with and that were not drawn: from a table (grain_table.hpp) a data file of
// LAMMPS (lammps_data.hpp) or a snapshot (snapshot_grains.hpp).
#pragma once
#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "case/case.hpp"
#include "dem/state.hpp"

namespace moraine::run {

struct OwnGrains {
  std::filesystem::path file;
  dem::State state;                  // by id
  std::vector<int> lines;            // of a text, for each grain
  double box_x, box_y, box_z;        // m
  std::vector<dem::BodyId> roles{};  // the layers of stages that shear; empty: by height
  std::string note{};                // for the log: what the file could not say

  std::string at(dem::Index i) const;  // "FILE, line N" or "FILE, grain N", for messages
};

// Whether `start` holds grains rather than the end of a case.
// Grains across a periodic side have images in that box alone. Throws Error where the case gives another
// side. box: m, found with the grains, 0: none; periodic: there.
void expect_same_sides(const cases::Case& c, const dem::Vec3d& box, const std::array<bool, 3>& periodic);

bool has_own_grains(const std::filesystem::path& start);

// Reads them. Roles that are all free count as none. Throws Error with the line of the file where a grain has
// no size, lies outside the box or overlaps another one too deeply (guards.max_overlap).
OwnGrains read_own_grains(const cases::Case& c);

}  // namespace moraine::run
