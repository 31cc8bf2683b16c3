#include "run/lammps_data.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>

#include "dem/packing.hpp"
#include "error.hpp"

namespace moraine::run {

namespace {

using std::string;
using Words = std::vector<string>;

constexpr double same = 1e-6;  // density and box: to so much of themselves, as a file of few digits has them

Words words_of(const string& line) {
  std::istringstream in(line);
  Words words;
  for (string word; in >> word;) words.push_back(word);
  return words;
}

template <class T>
std::optional<T> number_in(const string& word) {
  T value{};
  const char* const end = word.data() + word.size();
  const auto result = std::from_chars(word.data() + (word.starts_with("+") ? 1 : 0), end, value);
  if (result.ec != std::errc() || result.ptr != end) return {};
  if constexpr (std::is_same_v<T, double>)
    if (!std::isfinite(value)) return {};
  return value;
}

struct Row {
  int line;
  Words words;
};
struct Section {
  int line = 0;  // 0: not there
  string style;  // after the #
  std::vector<Row> rows;
};

// A file taken apart, and errors about its lines.
class DataFile {
 public:
  explicit DataFile(const std::filesystem::path& file) : file_(file.string()) {
    std::ifstream in(file);
    if (!in) throw error(file_, ": cannot be read");
    string line;
    std::getline(in, line);
    expect_si(line);
    std::vector<Row>* rows = nullptr;  // of the section that the line stands in
    for (int number = 2; std::getline(in, line); ++number) {
      const auto hash = line.find('#');
      const Words words = words_of(line.substr(0, hash));
      if (words.empty()) continue;
      if (std::isalpha(static_cast<unsigned char>(words[0][0])))
        rows = begin_section(number, words, hash == line.npos ? "" : line.substr(hash + 1));
      else if (rows)
        rows->push_back({number, words});
      else
        read_header(number, words);
    }
    if (count_line_ == 0)
      throw error(file_, ": there is no line \"N atoms\"; expected a data file of LAMMPS");
  }

  template <class... Parts>
  Error wrong(int line, const Parts&... parts) const {
    return error(file_, ", line ", line, ": ", parts...);
  }
  double number(const Row& row, std::size_t k, const char* what) const {
    const auto value = number_in<double>(row.words[k]);
    if (!value) throw wrong(row.line, what, " = \"", row.words[k], "\"; expected a number");
    return *value;
  }
  std::int64_t id(const Row& row) const {
    const auto value = number_in<std::int64_t>(row.words[0]);
    if (!value || *value < 1)
      throw wrong(row.line, "id = \"", row.words[0], "\"; expected a whole number of 1 or more");
    return *value;
  }
  // As many rows as the header says, each of so many words.
  const std::vector<Row>& rows_of(const char* name, const Section& section, const char* columns,
                                  std::initializer_list<std::size_t> sizes) const {
    const bool hinted = !section.style.empty();
    if (hinted && section.style != "sphere")
      throw wrong(section.line, name, " of style ", section.style, "; expected atom_style sphere");
    for (const Row& row : section.rows)
      if (std::ranges::find(sizes, row.words.size()) == sizes.end())
        throw wrong(row.line, row.words.size(), " values; expected ", columns,
                    hinted ? "" : text(" (atom_style sphere; \"", name, "\" names no other)"));
    if (static_cast<std::int64_t>(section.rows.size()) != count_)
      throw wrong(section.line, name, " has ", section.rows.size(), " rows; expected ", count_, ", as line ",
                  count_line_, " says");
    return section.rows;
  }

  struct Bounds {
    int line = 0;
    double low, high;  // m
  };
  Bounds bounds[3];
  Section atoms, velocities;
  const string& file() const { return file_; }

 private:
  void expect_si(const string& title) const {
    const string key = "units = ";
    const auto at = title.find(key);
    if (at == title.npos) return;
    const Words words = words_of(title.substr(at + key.size()));
    if (!words.empty() && words[0] != "si" && words[0] != "si,")
      throw wrong(1, "units = ", words[0], "; expected si");
  }

  void read_header(int line, const Words& words) {
    const Row row{line, words};
    if (words.size() == 2 && words[1] == "atoms") {
      const auto value = number_in<std::int64_t>(words[0]);
      if (!value || *value < 1 || *value > std::numeric_limits<dem::Index>::max())
        throw wrong(line, words[0], " atoms; expected 1 to ", std::numeric_limits<dem::Index>::max());
      count_ = *value, count_line_ = line;
    }
    for (int a = 0; a < 3; ++a) {
      const string axis(1, "xyz"[a]);
      if (words.size() != 4 || words[2] != axis + "lo" || words[3] != axis + "hi") continue;
      bounds[a] = {line, number(row, 0, "xlo"), number(row, 1, "xhi")};
      if (!(bounds[a].high > bounds[a].low))
        throw wrong(line, axis, "lo = ", words[0], " and ", axis, "hi = ", words[1],
                    "; expected the lower bound first");
    }
    const bool tilted = words.size() == 6 && words[3] == "xy" &&
                        (number(row, 0, "xy") != 0 || number(row, 1, "xz") != 0 || number(row, 2, "yz") != 0);
    if (tilted || (words.size() == 4 && words[3].ends_with("vec")))
      throw wrong(line, "the box is tilted; expected one with sides along x, y and z");
  }

  std::vector<Row>* begin_section(int line, const Words& words, const string& comment) {
    string name;
    for (const string& word : words) name += (name.empty() ? "" : " ") + word;
    string style;
    for (const string& word : words_of(comment)) style += (style.empty() ? "" : " ") + word;
    for (auto& [known, section] : {std::pair("Atoms", &atoms), std::pair("Velocities", &velocities)})
      if (name == known) {
        if (section->line)
          throw wrong(line, "a second section ", name, ", after that of line ", section->line);
        section->line = line, section->style = style;
        return &section->rows;
      }
    if (!name.ends_with("Coeffs") && name != "Masses" && name != "Atom Type Labels")
      throw wrong(line, "section ", name,
                  "; expected Atoms and Velocities: grains are spheres without bonds");
    unread_.clear();
    return &unread_;
  }

  string file_;
  std::int64_t count_ = 0;
  int count_line_ = 0;
  std::vector<Row> unread_;
};

// Of the box along each axis, and where its lower side lies in the file.
struct Box {
  double side[3];  // m
  double low[3];   // m
};
Box box_of(const cases::Case& c, const DataFile& data) {
  const double wanted[3] = {c.box_x, c.box_y, c.box_z};
  const bool periodic[3] = {c.periodic_x, c.periodic_y, c.periodic_z};
  Box box{};
  for (int a = 0; a < 3; ++a) {
    const string axis(1, "xyz"[a]);
    box.side[a] = wanted[a];
    if (!periodic[a]) {
      if (a < 2 && !(wanted[a] > 0))
        throw error(data.file(), ": ", axis,
                    " is not periodic (box.periodic), and bounds of LAMMPS need not be ",
                    "walls; expected box.", axis, " of more than 0 m");
      continue;
    }
    const DataFile::Bounds& bounds = data.bounds[a];
    if (bounds.line == 0)
      throw error(data.file(), ": there is no line \"", axis, "lo ", axis, "hi\" with the bounds along ",
                  axis, ", which is periodic (box.periodic)");
    const double side = bounds.high - bounds.low;
    if (wanted[a] > 0 && std::abs(wanted[a] - side) > same * side)
      throw data.wrong(bounds.line, "the box is ", side, " m long along ", axis, " and box.", axis, " = ",
                       wanted[a], " m; expected the same, or no box.", axis);
    if (!(wanted[a] > 0)) box.side[a] = side;
    box.low[a] = bounds.low;
  }
  return box;
}

}  // namespace

bool is_lammps_data(const std::filesystem::path& start) {
  if (start.extension() == ".data" || start.extension() == ".lammps") return true;
  std::ifstream in(start);
  char head[2000];
  in.read(head, sizeof head);
  std::istringstream lines(string(head, static_cast<std::size_t>(in.gcount())));
  string line;
  for (int k = 0; k < 10 && std::getline(lines, line); ++k) {
    const Words words = words_of(line.substr(0, line.find('#')));
    if (k > 0 && words.size() == 2 && words[1] == "atoms" && number_in<std::int64_t>(words[0])) return true;
  }
  return false;
}

// The material of a type, in the order of the case; without materials types do not count.
static dem::Material type_of(const cases::Case& c, const DataFile& data, const Row& row) {
  if (c.materials.size() < 2) return dem::Material::grain;
  const double type = data.number(row, 1, "type");
  if (!(type >= 1 && type <= static_cast<double>(c.materials.size())))
    throw data.wrong(row.line, "type = ", row.words[1], ", and the case has ", c.materials.size(),
                     " materials");
  return dem::Material(static_cast<int>(type) - 1);
}
static double density_of(const cases::Case& c, dem::Material m) {
  return c.materials.empty() ? c.grains.density : c.materials[static_cast<std::size_t>(m)].of.at("density");
}

OwnGrains read_lammps_data(const cases::Case& c) {
  const DataFile data(c.start);
  if (data.atoms.line == 0) throw error(data.file(), ": there is no section Atoms");
  const Box box = box_of(c, data);
  struct Grain {
    const Row* row;
    double r;
    dem::Vec3d x, v, omega;
    dem::Material material;
  };
  std::map<std::int64_t, Grain> grains;
  for (const Row& row : data.rows_of("Atoms", data.atoms,
                                     "7: id type diameter density x y z, or 10 with image flags", {7, 10})) {
    const double diameter = data.number(row, 2, "diameter"), density = data.number(row, 3, "density");
    if (!(diameter > 0)) throw data.wrong(row.line, "diameter = ", diameter, " m; expected more than 0");
    const dem::Material material = type_of(c, data, row);
    const double of_case = density_of(c, material);
    if (!(std::abs(density - of_case) <= same * of_case))
      throw data.wrong(row.line, "density = ", density, " kg/m3, and ",
                       c.materials.empty() ? "grains.density" : "that of its material", " = ", of_case,
                       " kg/m3; expected that of the case for all grains");
    Grain grain{&row, diameter / 2, {}, {}, {}, material};
    for (int a = 0; a < 3; ++a) {
      const char* const names[] = {"x", "y", "z"};
      grain.x[a] = data.number(row, 4 + a, names[a]) - box.low[a];
    }
    const auto [place, is_new] = grains.emplace(data.id(row), grain);
    if (!is_new)
      throw data.wrong(row.line, "id ", row.words[0], " is that of line ", place->second.row->line,
                       ", too; expected each once");
  }
  if (data.velocities.line) {
    std::map<std::int64_t, int> seen;
    for (const Row& row : data.rows_of("Velocities", data.velocities, "7: id vx vy vz wx wy wz", {7})) {
      const auto grain = grains.find(data.id(row));
      if (grain == grains.end())
        throw data.wrong(row.line, "id ", row.words[0], " is none of the section Atoms");
      if (const auto [place, is_new] = seen.emplace(grain->first, row.line); !is_new)
        throw data.wrong(row.line, "id ", row.words[0], " is that of line ", place->second,
                         ", too; expected each once");
      for (int a = 0; a < 3; ++a)
        grain->second.v[a] = data.number(row, 1 + a, "velocity"),
        grain->second.omega[a] = data.number(row, 4 + a, "spin");
    }
  }
  std::vector<double> r;
  std::vector<dem::Vec3d> x;
  for (const auto& [id, grain] : grains) r.push_back(grain.r), x.push_back(grain.x);
  OwnGrains own{c.start,    dem::grains_at_rest(std::move(r), std::move(x)), {}, box.side[0], box.side[1],
                box.side[2]};
  dem::Index i = 0;
  for (const auto& [id, grain] : grains) {
    own.state.v[i] = grain.v, own.state.omega[i++] = grain.omega;
    if (c.materials.size() > 1) own.state.material.push_back(grain.material);
    own.lines.push_back(grain.row->line);
  }
  return own;
}

}  // namespace moraine::run
