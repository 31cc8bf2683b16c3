#include "run/grain_table.hpp"

#include <algorithm>
#include <fstream>
#include <iostream>
#include <sstream>

#include "case/csv.hpp"
#include "case/materials.hpp"
#include "dem/engine.hpp"
#include "dem/packing.hpp"
#include "dem/periodic_sides.hpp"
#include "error.hpp"
#include "output/files.hpp"

namespace moraine::run {

namespace fs = std::filesystem;

namespace {

const std::vector<std::string> velocities = {"vx", "vy", "vz"}, spins = {"wx", "wy", "wz"};

std::string digits(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  return text;
}

using Line = std::initializer_list<double>;
void add(std::ostream& out, const Line& numbers, const char* between, const std::string& after = {}) {
  const char* before = "";
  for (const double x : numbers) out << before << digits(x), before = between;
  out << after << "\n";
}

const char* role_name(dem::BodyId id) {
  return id == dem::BodyId::bottom_layer ? "bottom_layer"
         : id == dem::BodyId::top_layer  ? "top_layer"
                                         : "free";
}

std::vector<dem::BodyId> roles_in(const cases::CsvTable& table) {
  std::vector<dem::BodyId> roles;
  if (!table.has("role")) return roles;
  for (const std::string& word : table.words("role")) {
    const auto at = table.at(roles.size());
    roles.push_back(dem::BodyId::none);
    for (const dem::BodyId layer : {dem::BodyId::bottom_layer, dem::BodyId::top_layer})
      if (word == role_name(layer)) roles.back() = layer;
    if (word != role_name(roles.back()))
      throw error(at, ": role = \"", word, "\"; expected free, bottom_layer or top_layer");
  }
  return roles;
}

std::vector<dem::Material> materials_in(const cases::Case& c, const cases::CsvTable& table) {
  std::vector<dem::Material> materials;
  if (!table.has("material")) return materials;
  const std::vector<std::string> known = cases::material_names(c);
  for (const std::string& word : table.words("material")) {
    const int number = cases::material_number(c, word);
    if (number < 0) {
      const std::string near = cases::nearest(word, known);
      throw error(table.at(materials.size()), ": material = \"", word, "\": ",
                  known.empty()  ? "the case has no [[material]]"
                  : near.empty() ? "known: " + cases::join(known, ", ")
                                 : "did you mean " + near + "?");
    }
    materials.push_back(dem::Material(number));
  }
  return materials;
}

// names: of the materials.
void write_csv(std::ostream& out, const dem::State& s, const std::vector<std::string>& names) {
  const bool layers = std::ranges::count(s.part_of, dem::BodyId::none) < s.size();
  out << "# m, m/s, rad/s\nid, x, y, z, r, vx, vy, vz, wx, wy, wz" << (layers ? ", role" : "")
      << (s.material.empty() ? "\n" : ", material\n");
  for (dem::Index i = 0; i < s.size(); ++i) {
    const dem::Vec3d &x = s.x[i], &w = s.omega[i];
    add(out, {double(s.id[i]), x.x, x.y, x.z, s.r[i], s.v[i].x, s.v[i].y, s.v[i].z, w.x, w.y, w.z}, ", ",
        text(layers ? ", " : "", layers ? role_name(s.part_of[i]) : "", s.material.empty() ? "" : ", ",
             s.material.empty() ? "" : names.at(static_cast<std::size_t>(s.material[i]))));
  }
}

void write_lammps(std::ostream& out, const dem::Scene& scene, const dem::State& s) {
  dem::Vec3d low{0, 0, 0}, high = scene.box;
  for (int a = 0; a < 3; ++a)
    for (dem::Index i = 0; i < s.size(); ++i)
      if (dem::Sides::of(scene).side[a] == 0)
        low[a] = std::min(low[a], s.x[i][a] - s.r[i]), high[a] = std::max(high[a], s.x[i][a] + s.r[i]);
  out << "# atom_style sphere, SI units\n\n"
      << s.size() << " atoms\n"
      << scene.materials << " atom types\n\n";
  for (int a = 0; a < 3; ++a)
    out << digits(low[a]) << " " << digits(high[a]) << " "
        << "xyz"[a] << "lo "
        << "xyz"[a] << "hi\n";
  out << "\nAtoms # sphere\n\n";
  for (dem::Index i = 0; i < s.size(); ++i) {
    out << s.id[i] + 1 << " " << static_cast<int>(s.material_of(i)) + 1 << " ";
    add(out, {2 * s.r[i], scene.density_of(s.material_of(i)), s.x[i].x, s.x[i].y, s.x[i].z}, " ");
  }
  out << "\nVelocities\n\n";
  for (dem::Index i = 0; i < s.size(); ++i) {
    out << s.id[i] + 1 << " ";
    add(out, {s.v[i].x, s.v[i].y, s.v[i].z, s.omega[i].x, s.omega[i].y, s.omega[i].z}, " ");
  }
}

void write_vtk(std::ostream& out, const dem::State& s) {
  out << "# vtk DataFile Version 3.0\ngrains, SI units\nASCII\nDATASET POLYDATA\nPOINTS " << s.size()
      << " double\n";
  for (const dem::Vec3d& x : s.x) add(out, {x.x, x.y, x.z}, " ");
  out << "VERTICES " << s.size() << " " << 2 * s.size() << "\n";
  for (dem::Index i = 0; i < s.size(); ++i) out << "1 " << i << "\n";
  out << "POINT_DATA " << s.size() << "\nSCALARS radius double 1\nLOOKUP_TABLE default\n";
  for (const double r : s.r) out << digits(r) << "\n";
  if (!s.material.empty()) {
    out << "SCALARS material int 1\nLOOKUP_TABLE default\n";
    for (const dem::Material m : s.material) out << static_cast<int>(m) << "\n";
  }
  out << "VECTORS velocity double\n";
  for (const dem::Vec3d& u : s.v) add(out, {u.x, u.y, u.z}, " ");
  out << "VECTORS spin double\n";
  for (const dem::Vec3d& w : s.omega) add(out, {w.x, w.y, w.z}, " ");
}

}  // namespace

bool is_grain_table(const fs::path& start) { return start.extension() == ".csv"; }

OwnGrains read_grain_table(const cases::Case& c) {
  const cases::CsvTable table(c.start, {"role", "material"});
  table.expect_only({"id", "x", "y", "z", "r", "vx", "vy", "vz", "wx", "wy", "wz", "role", "material"});
  for (int a = 0; a < 2; ++a)
    if (!((a == 0 ? c.box_x : c.box_y) > 0))
      throw error(c.start.string(), ": a table of grains has no box; expected box.", "xy"[a],
                  " of more than 0 m");
  std::vector<dem::Vec3d> x(table.rows());
  const std::string axes[3] = {"x", "y", "z"};
  for (int a = 0; a < 3; ++a) {
    const std::vector<double> values = table.column(axes[a], "m");
    for (std::size_t i = 0; i < x.size(); ++i) x[i][a] = values[i];
  }
  std::vector<double> r = table.column("r", "m");
  for (std::size_t i = 0; i < r.size(); ++i)
    if (!(r[i] > 0)) throw error(table.at(i), ": r = ", r[i], " m; expected more than 0");
  dem::State s = dem::grains_at_rest(std::move(r), std::move(x));
  const auto vector = [&](const std::vector<std::string>& names, const char* unit,
                          std::vector<dem::Vec3d>& to) {
    for (int a = 0; a < 3; ++a) {
      if (!table.has(names[a])) continue;
      const std::vector<double> values = table.column(names[a], unit);
      for (std::size_t i = 0; i < values.size(); ++i) to[i][a] = values[i];
    }
  };
  vector(velocities, "m/s", s.v), vector(spins, "rad/s", s.omega);
  s.material = materials_in(c, table);
  OwnGrains own{c.start, std::move(s), {}, c.box_x, c.box_y, c.box_z, roles_in(table)};
  for (std::size_t row = 0; row < table.rows(); ++row) own.lines.push_back(table.line(row));
  return own;
}

void export_grains(const fs::path& case_directory, const std::string& format, const fs::path& file) {
  const fs::path checkpoint = case_directory / "output/checkpoint.h5";
  if (!fs::exists(checkpoint))
    throw error(case_directory.string(), ": has no results yet; run it first: moraine run ",
                case_directory.string());
  output::Checkpoint c = output::read_checkpoint(checkpoint);
  dem::synchronise(c.scene, c.state);  // velocities and spins at the time of the places
  // By their ids, whatever the order in memory.
  std::vector<dem::Index> order(c.state.size());
  for (dem::Index i = 0; i < c.state.size(); ++i) order[c.state.id[i]] = i;
  dem::State s;
  for (const dem::Index i : order) {
    s.id.push_back(c.state.id[i]), s.r.push_back(c.state.r[i]), s.x.push_back(c.state.x[i]);
    s.omega.push_back(c.state.omega[i]), s.part_of.push_back(c.state.part_of[i]), s.v.push_back(c.state.v[i]);
    if (!c.state.material.empty()) s.material.push_back(c.state.material[i]);
  }
  std::ostringstream text;
  if (format == "csv") write_csv(text, s, cases::split(c.materials, ", "));
  if (format == "lammps") write_lammps(text, c.scene, s);
  if (format == "vtk") write_vtk(text, s);
  if (file.empty()) {
    std::cout << text.str();
    return;
  }
  if (fs::exists(file)) throw error(file.string(), ": is there already; choose another name or remove it");
  output::write_text(file, text.str());
}

}  // namespace moraine::run
