#include "case/case.hpp"

#include <algorithm>
#include <cmath>

#include "case/keys.hpp"
#include "case/materials.hpp"
#include "case/preset.hpp"
#include "case/read.hpp"
#include "error.hpp"
#include "output/files.hpp"

namespace moraine::cases {
namespace {

namespace fs = std::filesystem;
using std::string;

bool is_stage_key(const Key& key) { return key.table() == "stage."; }
// Of a list of tables: a stage, a material or a pair.
bool is_listed(const Key& key) { return is_list_of_tables(split(key.name, ".")[0]); }

struct Context {
  const Entries* above;  // keys that a stage may take defaults from
  string prefix;         // "cases/x/case.toml: stage.shear."
  string kind, kind_before;
};

// "0; settle, consolidate: 1e4" -> "1e4" for these kinds; "another of its kind" comes after one of the same.
string fallback_for(const Key& key, const Context& context) {
  const auto alternatives = split(key.fallback, "; ");
  for (std::size_t a = 1; a < alternatives.size(); ++a) {
    const auto parts = split(alternatives[a], ": ");
    const auto kinds = split(parts[0], ", ");
    const bool again = parts[0] == "another of its kind" && context.kind == context.kind_before;
    if (again || std::find(kinds.begin(), kinds.end(), context.kind) != kinds.end()) return parts[1];
  }
  return alternatives[0];
}

Value default_value(const Key& key, const Entries& entries, const Context& context) {
  const string text = fallback_for(key, context);
  if (!find(text)) return parse_default(key, text);
  const auto own = entries.find(text);
  return own != entries.end() ? own->second.value : context.above->at(text).value;
}

void add_default(const Key& key, Entries& entries, const Context& context) {
  if (!key.set || entries.contains(key.name)) return;
  const string name = context.prefix + key.name.substr(is_stage_key(key) ? 6 : 0);
  if (key.fallback == required) throw error(name, " is missing; expected ", key.accepts);
  const Value value = default_value(key, entries, context);
  entries[key.name] = {value, name + " = " + to_toml(value) + " (by default)"};
}

// The values of one table, by key, and errors about them.
class Reader {
 public:
  explicit Reader(const Entries& entries) : entries_(entries) {}
  // Of a load that changes, the largest value.
  double number(const string& key) const {
    const History* h = history(key);
    return h ? h->largest() : std::get<double>(entries_.at(key).value);
  }
  double least(const string& key) const { return history(key) ? history(key)->least() : number(key); }
  // Of a load; null: it does not change.
  const History* history(const string& key) const {
    const Load* load = std::get_if<Load>(&entries_.at(key).value);
    return load ? &load->history : nullptr;
  }
  const string& stated(const string& key) const { return entries_.at(key).stated; }
  string text(const string& key) const { return std::get<string>(entries_.at(key).value); }
  bool by_default(const string& key) const { return entries_.at(key).stated.ends_with("(by default)"); }
  bool flag(const string& key) const { return std::get<bool>(entries_.at(key).value); }
  bool automatic_dt() const { return std::holds_alternative<string>(entries_.at("model.dt").value); }

  template <class... Parts>
  void expect(bool right, const string& key, const Parts&... parts) const {
    if (!right) throw error(entries_.at(key).stated, ": expected ", parts...);
  }

 private:
  const Entries& entries_;
};

void check_case(const Entries& entries) {
  const Reader c(entries);
  c.expect(c.number("contact.mu_d") <= c.number("contact.mu_s"), "contact.mu_d",
           "at most contact.mu_s = ", c.number("contact.mu_s"));
  const bool hertz = c.text("contact.law") == "hertz";
  for (const char* key : {"contact.young", "wall.young"}) {
    c.expect(!hertz || c.number(key) > 0, key, "> 0 Pa with contact.law = \"hertz\"");
    c.expect(hertz || c.number(key) == 0, key, "0 Pa, or contact.law = \"hertz\"");
  }
  for (const char* key : {"contact.poisson", "wall.poisson"})
    c.expect(hertz || c.number(key) == 0.25, key, "0.25, as if not given, or contact.law = \"hertz\"");
  for (const string table : {"contact.", "wall."})
    for (const string couple : {"roll", "twist"}) {
      const string k = table + "k_" + couple;
      if (c.number(table + "mu_" + couple) == 0) continue;
      c.expect(c.number(k) > 0, k, "> 0 N/m with mu_", couple, " > 0");
      c.expect(!hertz || !c.by_default(k) || !c.by_default("contact.k_roll"), k,
               "a stiffness in N/m: with contact.law = \"hertz\" it does not follow from k_t");
    }
  const string radii = c.text("grains.distribution");
  const double r_min = c.number("grains.radius_min"), r_max = c.number("grains.radius_max");
  if (radii == "uniform" || radii == "fractal") {
    c.expect(r_min > 0, "grains.radius_min", "> 0 m for ", radii, " radii");
    c.expect(r_max >= r_min, "grains.radius_max", "at least grains.radius_min = ", r_min);
  } else if (radii == "lognormal" || radii == "bimodal") {
    c.expect(r_max == 0 || r_max >= r_min, "grains.radius_max",
             "0 m, or at least grains.radius_min = ", r_min);
  }
  for (const char* key : {"grains.fine_radius_mean", "grains.fine_radius_std", "grains.fine_fraction"})
    c.expect(radii == "bimodal" || c.number(key) == 0, key, "0, or grains.distribution = \"bimodal\"");
  if (radii == "bimodal") {
    const double coarse = c.number("grains.radius_mean"), fine = c.number("grains.fine_radius_mean");
    c.expect(fine > 0 && fine < coarse, "grains.fine_radius_mean",
             "> 0 m and less than grains.radius_mean = ", coarse, ", that of the coarse grains");
    c.expect(c.number("grains.fine_fraction") > 0 && c.number("grains.fine_fraction") < 1,
             "grains.fine_fraction", "more than 0 and less than 1, by mass");
  }
  c.expect((radii == "sieves") == !c.text("grains.sieves").empty(), "grains.sieves",
           radii == "sieves" ? "the name of a CSV file" : "\"\", or grains.distribution = \"sieves\"");
  c.expect(c.number("fluid.porosity_min") < c.number("fluid.porosity_max"), "fluid.porosity_min",
           "less than fluid.porosity_max = ", c.number("fluid.porosity_max"));
  c.expect(c.number("fluid.porosity_max") < 1, "fluid.porosity_max", "less than 1");
  const string periodic = c.text("box.periodic");
  for (const string side : {"x_low", "x_high", "y_low", "y_high"}) {
    const string key = "fluid." + side, kind = c.text(key);
    c.expect(kind == "no_flow" || periodic == "none" || periodic.find(side[0]) == string::npos, key,
             "no_flow: ", side[0], " is periodic (box.periodic = \"", periodic, "\")");
    c.expect(kind == "pressure" || c.number(key + "_pressure") == 0, key + "_pressure", "0 Pa, or ", side,
             " = \"pressure\"");
    c.expect(kind == "flux" || c.number(key + "_flux") == 0, key + "_flux", "0 m/s, or ", side,
             " = \"flux\"");
  }
  for (const char axis : c.text("box.walls") == "none" ? string() : c.text("box.walls"))
    c.expect(periodic == "none" || periodic.find(axis) == string::npos, "box.walls", "none along ", axis,
             ", which is periodic (box.periodic = \"", periodic, "\")");
  if (c.text("box.periodic").find('z') != string::npos) {
    const string start = c.text("start");
    const bool of_start = !start.empty() && !start.ends_with(".csv");
    const bool by_fraction = start.empty() && c.text("grains.placement") == "random";
    c.expect(c.number("box.z") > 0 || of_start || by_fraction, "box.z", "> 0 m where z is periodic");
    c.expect(!c.flag("box.floor"), "box.floor", "false where z is periodic");
  }
}

// What holds for any load of a stage. `duration`: s, 0 where it is not known yet.
void check_loads(const Reader& s, double duration) {
  for (const Key& key : keys()) {
    if (key.type != Key::Type::load) continue;
    const History* h = s.history(key.name);
    if (h && !h->covers(duration))
      throw error(s.stated(key.name), ": ends at ", h->time.back(), " s and the stage at ", duration,
                  " s; expected values up to there, or a shorter stage");
    s.expect(s.number(key.name + "_amplitude") == 0 || s.number(key.name + "_frequency") > 0,
             key.name + "_frequency", "> 0 Hz with an amplitude");
  }
}

// s; 0 where the height of the bed decides.
double duration_of(const Reader& s) {
  const double rate = std::abs(s.number("stage.strain_rate"));
  return s.number("stage.strain") > 0 && rate > 0 ? s.number("stage.strain") / rate
                                                  : s.number("stage.duration");
}

void check_water(const Reader& s, const Reader& above, bool no_wall) {
  const bool tight = s.text("stage.fluid_top") == "impermeable";
  const string bottom = s.text("stage.fluid_bottom");
  for (const char* key : {"stage.top_pressure", "stage.top_pressure_amplitude"})
    s.expect(!tight || s.number(key) == 0, key, "0 Pa: the top is impermeable");
  for (const char* key : {"stage.top_pressure_frequency", "stage.top_pressure_phase"})
    s.expect(!tight || s.number(key) == 0, key, "0: the top is impermeable");
  for (const char* key : {"stage.bottom_pressure", "stage.bottom_pressure_amplitude"})
    s.expect(bottom == "pressure" || s.number(key) == 0, key, "0 Pa, or fluid_bottom = \"pressure\"");
  s.expect(bottom == "flux" || s.number("stage.bottom_flux") == 0, "stage.bottom_flux",
           "0 m/s, or fluid_bottom = \"flux\"");
  if (!s.flag("stage.fluid")) {
    s.expect(!tight, "stage.fluid_top",
             "drained: there is no pore water in this stage (fluid.enabled, stage.fluid)");
    s.expect(s.number("stage.top_pressure") == 0 && s.number("stage.top_pressure_amplitude") == 0,
             "stage.top_pressure", "0 Pa: there is no pore water in this stage");
    return;
  }
  s.expect(above.number("model.slope") == 0, "stage.fluid",
           "false on a slope: pressures are over the hydrostatic one of level ground (model.slope)");
  s.expect(!(tight && no_wall), "stage.fluid_top", "drained: there is no top wall to be impermeable");
  s.expect(above.text("box.periodic").find('z') == string::npos, "stage.fluid",
           "false where z is periodic: water needs a bottom and a top");
  s.expect(above.flag("box.floor"), "stage.fluid", "false without a floor");
  s.expect(!above.automatic_dt(), "stage.fluid",
           "false with model.dt = \"auto\": water and grains meet every so many equal steps");
}

// Of a stage that presses.
void check_press(const Reader& s, const Reader& above) {
  const bool to_porosity = s.number("stage.porosity") > 0;
  above.expect(above.text("box.periodic") == "xyz", "box.periodic", "xyz: stage ", s.text("stage.name"),
               " presses all sides of the box");
  above.expect(above.number("model.gravity") == 0, "model.gravity", "0 m/s2: stage ", s.text("stage.name"),
               " presses grains that nothing holds up");
  s.expect(to_porosity != (s.number("stage.pressure") > 0), to_porosity ? "stage.pressure" : "stage.porosity",
           "either porosity or pressure");
  s.expect(s.number("stage.strain_rate") > 0, "stage.strain_rate", "> 0 1/s");
}

void check_stage(const Entries& entries, const Entries& above, const Context& context) {
  const Reader s(entries);
  const string kind = context.kind;

  for (const Key& key : keys()) {
    if (!is_stage_key(key)) continue;
    if (const string why = not_of_kind(key, kind); !why.empty())
      s.expect(entries.at(key.name).value == default_value(key, entries, context), key.name, why);
  }

  const bool by_strain = s.number("stage.strain") != 0;
  if (kind == "press") check_press(s, Reader(above));
  if (s.number("stage.porosity") > 0) {
    for (const char* key : {"stage.duration", "stage.strain"})
      s.expect(s.number(key) == 0, key, "0: porosity and strain_rate say when the stage ends");
    s.expect(s.number("stage.strain_rate") > 0, "stage.strain_rate", "> 0 1/s, towards a lower porosity");
  } else {
    s.expect(by_strain != (s.number("stage.duration") != 0), by_strain ? "stage.strain" : "stage.duration",
             kind == "shear" || kind == "uniaxial" ? "either duration or strain" : "a duration > 0 s");
  }
  if (kind == "shear") {
    const bool by_rate = s.number("stage.strain_rate") != 0,
               swings = s.number("stage.velocity_amplitude") != 0;
    s.expect(by_rate != (s.number("stage.velocity") != 0 || swings),
             by_rate ? "stage.strain_rate" : "stage.velocity", "either velocity or strain_rate");
    s.expect(!by_strain || !(swings || s.history("stage.velocity")), "stage.strain",
             "a duration: the velocity changes");
  }
  if (kind == "uniaxial")
    s.expect(s.number("stage.strain_rate") != 0, "stage.strain_rate", "other than 0 1/s");
  if (kind == "shear_stress")
    s.expect(s.number("stage.shear_stress") != 0 || s.number("stage.shear_stress_amplitude") != 0,
             "stage.shear_stress", "other than 0 Pa");

  if (kind == "shear" || kind == "shear_stress")
    Reader(above).expect(Reader(above).text("box.walls").find('x') == string::npos, "box.walls",
                         "none along x, where stage ", s.text("stage.name"), " moves a layer of grains");

  const string wall = s.text("stage.top_wall");
  if (kind == "uniaxial")
    s.expect(wall == "automatic", "stage.top_wall",
             "automatic: strain_rate drives the wall of a uniaxial stage");
  const bool no_wall = wall == "none" || (wall == "automatic" && (kind == "settle" || kind == "press"));
  const bool by_stress = wall == "stress" || (wall == "automatic" && !no_wall && kind != "uniaxial");
  const double normal_stress = s.number("stage.normal_stress");
  const double amplitude = s.number("stage.normal_stress_amplitude");
  if (by_stress) {
    s.expect(normal_stress > 0, "stage.normal_stress", "> 0 Pa: stress drives the top wall");
  } else {
    s.expect(normal_stress == 0, "stage.normal_stress", "0 Pa: no stress drives the top wall of this stage");
    s.expect(amplitude == 0, "stage.normal_stress_amplitude",
             "0 Pa: no stress drives the top wall of this stage");
  }
  const double least = s.least("stage.normal_stress");
  s.expect(
      std::abs(amplitude) <= least, "stage.normal_stress_amplitude",
      s.history("stage.normal_stress") ? "at most the least normal_stress = " : "at most normal_stress = ",
      least, " Pa: the wall cannot pull");
  if (Reader(above).text("box.periodic").find('z') != string::npos)
    s.expect(no_wall, "stage.top_wall", "none where z is periodic");

  check_water(s, Reader(above), no_wall);
  check_loads(s, duration_of(s));
  s.expect(s.number("stage.mu_d") <= s.number("stage.mu_s"), "stage.mu_d",
           "at most mu_s = ", s.number("stage.mu_s"));
}

// By the law, and by softening.
void set_stiffness(Case& c) {
  for (dem::ContactParameters* p : {&c.contact, &c.wall})
    for (double* k : {&p->k_n, &p->k_t, &p->k_roll, &p->k_twist}) *k /= c.softening;
  c.wall.k_n = c.contact.k_n;
  if (c.law == Case::Law::linear) return;
  const auto set = [&](dem::ContactParameters& p, const Elastic& other) {
    const Elastic& grain = c.elastic;
    p.k_n = p.k_t = 0;
    p.E_star = dem::young_star(grain.young, grain.poisson, other.young, other.poisson) / c.softening;
    p.G_star = dem::shear_star(grain.young, grain.poisson, other.young, other.poisson) / c.softening;
  };
  set(c.contact, c.elastic), set(c.wall, c.wall_elastic);
}

// The file that `start` names: itself, or the end of that case.
fs::path start_file(const fs::path& directory, const Entry& entry) {
  const string start = std::get<string>(entry.value);
  if (start.empty()) return {};
  fs::path path = (directory / start).lexically_normal();
  if (fs::is_directory(path)) {
    if (!fs::exists(path / "output/checkpoint.h5"))
      throw error(entry.stated, ": there is no ", (path / "output/checkpoint.h5").string(),
                  "; run that case first: moraine run ", path.string());
    path = (path / "output/checkpoint.h5").lexically_normal();
  }
  if (!fs::is_regular_file(path))
    throw error(entry.stated, ": there is no ", path.string(),
                "; expected a finished case, a checkpoint or a file of grains, relative to ",
                directory.string());
  return path;
}

// A file beside the case.
fs::path file_beside(const fs::path& directory, const Entry& entry, const string& name) {
  if (name.empty()) return {};
  const fs::path path = (directory / name).lexically_normal();
  if (!fs::is_regular_file(path))
    throw error(entry.stated, ": there is no ", path.string(), "; expected a file, relative to ",
                directory.string());
  return path;
}

// Fills in the history of a load that comes from a file, which the case then knows of.
void read_table_of(const Key& key, Entry& entry, Case& c) {
  Load* const load = std::get_if<Load>(&entry.value);
  if (!load || load->form != Load::Form::table) return;
  const fs::path file = file_beside(c.directory, entry, load->table);
  load->history =
      read_table(file, key.unit, load->history.between, [&](double value) { check_range(key, value); });
  if (std::find(c.tables.begin(), c.tables.end(), file) == c.tables.end()) c.tables.push_back(file);
}

// The kind of the last stage of the case that a start file comes from; empty where that is not known.
string last_kind(const fs::path& start) {
  if (start.empty() || start.extension() == ".csv") return {};
  try {
    const auto before = read_resolved(output::read_checkpoint(start).case_text);
    const auto kind = before.find("stage." + split(before.at("stages"), ", ").back() + ".kind");
    return kind == before.end() ? string()
                                : std::get<string>(parse_default(*find("stage.kind"), kind->second));
  } catch (const std::exception&) {  // what is wrong with it is said when its grains are read
    return {};
  }
}

// Whether this key of a stage is of contacts, so that each pair of materials may have its own.
bool differs_by_material(const string& name) { return find("contact." + name) || name.starts_with("wall_"); }
// Whether a stage gives no value of its own, so that each pair has its own.
bool is_left_to_materials(const Draft& draft, const Key& key, const Entries& entries) {
  const auto entry = entries.find(key.name);
  if (draft.materials.empty() || !is_stage_key(key) || entry == entries.end()) return false;
  return entry->second.stated.ends_with("(by default)") && differs_by_material(key.name.substr(6));
}

// As a case.toml in SI.
string text_of(const Draft& draft) {
  string text, table;
  const auto add = [&](const Key& key, const Entries& entries) {
    const auto entry = entries.find(key.name);
    if (!key.set || entry == entries.end()) return;
    if (!is_listed(key) && key.table() != table) {
      table = key.table();
      text += "\n[" + table.substr(0, table.size() - 1) + "]\n";
    }
    text += key.name.substr(key.table().size()) + " = " + to_toml(entry->second.value);
    text += (key.unit.empty() || key.unit == "1" ? "" : "  # " + key.unit) + "\n";
  };
  for (const Key& key : keys())
    if (!is_listed(key)) add(key, draft.entries);
  const auto add_list = [&](const string& name, const std::vector<StageDraft>& list) {
    for (const StageDraft& one : list) {
      text += "\n[[" + name + "]]\n";
      for (const Key& key : keys())
        if (key.table() == name + "." && !is_left_to_materials(draft, key, one.entries))
          add(key, one.entries);
    }
  };
  add_list("material", draft.materials), add_list("pair", draft.pairs), add_list("stage", draft.stages);
  return text;
}

// Messages may quote what spans lines: a table of TOML, or toml++ itself.
string one_line(const string& text) {
  string line;
  for (const char c : text)
    if (static_cast<unsigned char>(c) > ' ')
      line += c;
    else if (!line.ends_with(' '))
      line += ' ';
  return line;
}

Case checked_case(const fs::path& directory, Draft draft) {
  apply_preset(draft);
  const string file = (directory / "case.toml").string();
  Case c{};
  Stage no_stage{};
  c.directory = directory;

  const Context context{&draft.entries, file + ": ", "", ""};
  for (const Key& key : keys()) {
    if (is_listed(key)) continue;
    add_default(key, draft.entries, context);
    if (key.set) key.set(key, c, no_stage, draft.entries.at(key.name).value);
  }
  check_case(draft.entries);
  set_stiffness(c);
  c.start = start_file(directory, draft.entries.at("start"));
  const Entry& sieves = draft.entries.at("grains.sieves");
  c.grains.sieves = file_beside(directory, sieves, std::get<string>(sieves.value));

  if (draft.stages.empty()) throw error(file, ": no stages; expected at least one [[stage]]");
  string kind_before = last_kind(c.start);
  for (StageDraft& s : draft.stages) {
    Context context{&draft.entries, s.stated + ".", "", kind_before};
    if (s.entries.contains("stage.kind")) context.kind = std::get<string>(s.entries.at("stage.kind").value);
    kind_before = context.kind;
    Stage& stage = c.stages.emplace_back();
    if (!draft.materials.empty())
      for (const auto& [name, entry] : s.entries)
        if (differs_by_material(name.substr(6))) stage.own.insert(name.substr(6));
    for (const Key& key : keys()) {
      if (!is_stage_key(key)) continue;
      add_default(key, s.entries, context);
      read_table_of(key, s.entries.at(key.name), c);
      key.set(key, c, stage, s.entries.at(key.name).value);
    }
    check_stage(s.entries, draft.entries, context);
  }
  read_materials(draft, c);
  c.resolved = text_of(draft);
  return c;
}

}  // namespace

bool Case::has_water() const {
  return std::any_of(stages.begin(), stages.end(), [](const Stage& s) { return s.fluid; });
}

bool Case::has_histories() const {
  return std::any_of(stages.begin(), stages.end(), [](const Stage& s) { return s.has_histories(); });
}

bool Case::presses() const {
  return std::any_of(stages.begin(), stages.end(),
                     [](const Stage& s) { return s.kind == Stage::Kind::press; });
}

Case load(const fs::path& directory, const std::vector<Override>& overrides) {
  try {
    return checked_case(directory, read(directory, overrides));
  } catch (const Error& e) {
    throw Error(one_line(e.what()));
  }
}

string filled(const fs::path& directory, const string& text) {
  try {
    Draft draft = read(directory, {}, &text);
    apply_preset(draft);
    const Context above{&draft.entries, (directory / "case.toml").string() + ": ", "", ""};
    for (const Key& key : keys())
      if (!is_listed(key)) add_default(key, draft.entries, above);
    string kind_before;
    for (StageDraft& s : draft.stages) {
      Context context{&draft.entries, s.stated + ".", "", kind_before};
      if (const auto kind = s.entries.find("stage.kind"); kind != s.entries.end())
        context.kind = std::get<string>(kind->second.value);
      kind_before = context.kind;
      for (const Key& key : keys())
        if (is_stage_key(key)) add_default(key, s.entries, context);
    }
    return text_of(draft);
  } catch (const Error& e) {
    throw Error(one_line(e.what()));
  }
}

Case load_resolved(const fs::path& directory, const string& text) {
  return checked_case(directory, read_resolved_case(directory, text));
}

std::vector<Change> changes(const string& resolved_before, const Case& now) {
  const auto before = read_resolved(resolved_before), after = read_resolved(now.resolved);
  if (before.at("stages") != after.at("stages"))
    return {{"stages", before.at("stages"), after.at("stages"), true}};
  std::map<string, std::pair<string, string>> both;
  for (const auto& [name, value] : before) both[name].first = value;
  for (const auto& [name, value] : after) both[name].second = value;
  std::vector<Change> found;
  for (auto& [name, values] : both) {
    if (values.first == values.second) continue;
    const auto dot = name.rfind('.');
    const string table = split(name, ".")[0];
    const Key* key = find(is_list_of_tables(table) ? table + name.substr(dot) : name);
    for (string* value : {&values.first, &values.second})
      if (value->empty())
        *value = "nothing";
      else if (key && !key->unit.empty() && key->unit != "1")
        *value += " " + key->unit;
    using Decides = Key::Decides;
    const Decides decides = key ? key->decides : Decides::physics;
    found.push_back({name, values.first, values.second,
                     decides == Decides::physics || (decides == Decides::records && now.automatic_dt)});
  }
  return found;
}

string extension_text(const fs::path& directory, const std::vector<Override>& overrides, const string& base) {
  Draft draft = read(directory, overrides);
  const auto keep_overrides = [](Entries& entries) {
    std::erase_if(entries, [](const auto& e) { return !e.second.stated.starts_with(by_set); });
  };
  keep_overrides(draft.entries);
  // A path keeps its meaning in the other directory.
  const auto from_there = [&](string& path) {
    if (!path.empty()) path = (fs::path(base) / path).lexically_normal().string();
  };
  for (const char* key : {"start", "grains.sieves"})
    if (const auto entry = draft.entries.find(key); entry != draft.entries.end())
      from_there(std::get<string>(entry->second.value));
  std::vector<string> stages;
  for (StageDraft& stage : draft.stages) {
    stages.push_back(stage.name);
    const Entry name = stage.entries.at("stage.name");
    keep_overrides(stage.entries);
    for (auto& [key, entry] : stage.entries)
      if (Load* load = std::get_if<Load>(&entry.value)) from_there(load->table);
    if (!stage.entries.empty()) stage.entries["stage.name"] = name;
  }
  std::erase_if(draft.stages, [](const StageDraft& stage) { return stage.entries.empty(); });
  for (auto* list : {&draft.materials, &draft.pairs}) {
    for (StageDraft& one : *list) {
      const string key = list == &draft.pairs ? "pair.of" : "material.name";
      const Entry name = one.entries.at(key);
      keep_overrides(one.entries);
      if (!one.entries.empty()) one.entries[key] = name;
    }
    std::erase_if(*list, [](const StageDraft& one) { return one.entries.empty(); });
  }
  return "extends = " + to_toml(base) + "\nstages = " + to_toml(stages) + "\n" + text_of(draft);
}

}  // namespace moraine::cases
