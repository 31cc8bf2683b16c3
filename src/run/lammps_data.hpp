// Data files of LAMMPS (atom_style sphere, SI units), as its write_data and `moraine export` write them.
// Read: the number of atoms, the bounds of the box, and the sections Atoms (id type diameter density x y z,
// image flags or none) and Velocities (id, velocity, spin), rows in any order. Types and image flags do not
// count.
#pragma once
#include <filesystem>

#include "case/case.hpp"
#include "run/own_grains.hpp"

namespace moraine::run {

// NAME.data, NAME.lammps, or a text whose first lines count atoms.
bool is_lammps_data(const std::filesystem::path& start);

// Grains in the order of their ids, from 0 on. Along a periodic side the bounds are the box, and their lower
// one becomes 0; along others, where floor and walls are at 0 and at the end of the box, places stay as they
// are and the box is that of the case. Throws Error with the line where the file is not of the form above, or
// where box or density are not those of the case.
OwnGrains read_lammps_data(const cases::Case& c);

}  // namespace moraine::run
