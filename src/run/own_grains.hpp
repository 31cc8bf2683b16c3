// Grains that a case begins with and that were not drawn: from a table (grain_table.hpp) or a data file of
// LAMMPS (lammps_data.hpp).
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "case/case.hpp"
#include "dem/state.hpp"

namespace moraine::run {

struct OwnGrains {
  std::filesystem::path file;
  dem::State state;            // by id
  std::vector<int> lines;      // of the file, for each grain
  double box_x, box_y, box_z;  // m

  std::string at(dem::Index i) const;  // "FILE, line N", for messages
};

// Whether `start` holds grains rather than the end of a case.
bool has_own_grains(const std::filesystem::path& start);

// Reads them. Throws Error with the line of the file where a grain has no size, lies outside the box or
// overlaps another one too deeply (guards.max_overlap).
OwnGrains read_own_grains(const cases::Case& c);

}  // namespace moraine::run
