// A list of grains as a table: read to begin a case with, or written from where one has come to.
#pragma once
#include <filesystem>
#include <string>

#include "case/case.hpp"
#include "run/own_grains.hpp"

namespace moraine::run {

// Whether `start` names a table rather than a case or a checkpoint: NAME.csv.
bool is_grain_table(const std::filesystem::path& start);

// Columns x, y, z, r (m; centre and radius), and if wanted vx, vy, vz (m/s), wx, wy, wz (rad/s) role
// (free, bottom_layer or top_layer) and material (its name). The box is that of the case. Throws Error with
// the line of the file where a value is wrong.
OwnGrains read_grain_table(const cases::Case& c);

// Where a case has come to: `format` csv (as above, with ids, and roles where there are layers), lammps (a
// data file for atom_style sphere) or vtk (points with radius, velocity and spin). To `file`, or for an empty
// one to the screen. Throws Error where there is a file already.
void export_grains(const std::filesystem::path& case_directory, const std::string& format,
                   const std::filesystem::path& file);

}  // namespace moraine::run
