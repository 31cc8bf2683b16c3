#include "case/materials.hpp"

#include <algorithm>
#include <cmath>

#include "case/units.hpp"
#include "error.hpp"

namespace moraine::cases {
namespace {

using std::string;

const string wall = "wall";

bool is_stiffness(const string& key) { return key.starts_with("k_") || key == "young"; }

string leaf(const string& name) { return name.substr(name.find('.') + 1); }

// The two lengths of `sizes` or `layer`, m.
std::vector<double> range_in(const Entry& entry) {
  const auto& words = std::get<std::vector<string>>(entry.value);
  if (words.empty()) return {};
  if (words.size() != 2) throw error(entry.stated, ": expected two lengths, such as [\"1 mm\", \"2 cm\"]");
  std::vector<double> range;
  for (const string& word : words) try {
      range.push_back(to_si(word, "m"));
    } catch (const Error& e) {
      throw error(entry.stated, ": ", e.what());
    }
  if (!(range[0] < range[1])) throw error(entry.stated, ": expected the smaller length first");
  return range;
}

// Numbers that a table gives, by key; stiffnesses softened.
std::map<string, double> numbers_of(const StageDraft& draft, const Case& c) {
  std::map<string, double> numbers;
  for (const auto& [name, entry] : draft.entries)
    if (const double* number = std::get_if<double>(&entry.value))
      numbers[leaf(name)] = is_stiffness(leaf(name)) ? *number / c.softening : *number;
  if (numbers.contains("mu_s")) numbers.try_emplace("mu_d", numbers.at("mu_s"));
  return numbers;
}

GrainMaterial material_in(const StageDraft& draft, const Draft& all, const Case& c) {
  GrainMaterial m;
  m.name = draft.name, m.of = numbers_of(draft, c);
  // As contact.k_roll follows contact.k_t, where neither says otherwise.
  const auto follow = [&](const string& key, const string& other) {
    const auto found = m.of.find(other);
    if (found != m.of.end() && all.entries.at("contact." + key).stated.ends_with("(by default)"))
      m.of.try_emplace(key, found->second);
  };
  follow("k_roll", "k_t"), follow("k_twist", "k_roll");
  for (const Key& key : keys()) {
    if (key.table() != "material." || key.type != Key::Type::number) continue;
    const string name = leaf(key.name);
    const double number = std::get<double>(all.entries.at(key.fallback).value);
    m.of.try_emplace(name, is_stiffness(name) ? number / c.softening : number);
  }
  if (const auto e = draft.entries.find("material.sizes"); e != draft.entries.end())
    m.sizes = range_in(e->second);
  if (const auto e = draft.entries.find("material.layer"); e != draft.entries.end())
    m.layer = range_in(e->second);
  return m;
}

[[noreturn]] void throw_unknown(const string& stated, const string& name, const std::vector<string>& known) {
  const string near = nearest(name, known);
  throw error(stated, ": there is no material \"", name, "\"; ",
              known.empty()  ? "expected a [[material]] of this name"
              : near.empty() ? "known: " + join(known, ", ")
                             : "did you mean " + near + "?");
}

const MaterialPair* pair_of(const Case& c, const string& a, const string& b) {
  for (const MaterialPair& p : c.pairs)
    if ((p.first == a && p.second == b) || (p.first == b && p.second == a)) return &p;
  return nullptr;
}

// What two materials have between them of what each has of its own.
double combined(const Case& c, const string& key, double a, double b) {
  if (a == b) return a;
  if (is_stiffness(key)) return 2 * a * b / (a + b);
  return c.pair_rule == PairRule::minimum ? std::min(a, b) : std::sqrt(a * b);
}

// By key; `given` comes first.
std::map<string, double> between(const Case& c, const GrainMaterial& a, const GrainMaterial& b,
                                 const MaterialPair* given) {
  std::map<string, double> values;
  for (const auto& [key, value] : a.of) values[key] = combined(c, key, value, b.of.at(key));
  if (given)
    for (const auto& [key, value] : given->given) values[key] = value;
  return values;
}

// The parameters of these names that the stage does not give itself: as `prefix` and the name.
void take(const std::map<string, double>& values, const Stage& stage, const string& prefix,
          dem::ContactParameters& p) {
  const auto one = [&](const auto& named) {
    const string name = named.name;
    const bool friction = name == "mu_s" || name == "mu_d";
    const bool own =
        stage.own.contains(prefix + name) || (!prefix.empty() && friction && stage.own.contains("wall_mu"));
    if (const auto value = values.find(name); value != values.end() && !own) p.*named.member = value->second;
  };
  std::apply([&](const auto&... named) { (one(named), ...); }, dem::ContactParameters::list());
}

void check_pairs(const Draft& draft, const Case& c) {
  std::vector<string> known = material_names(c);
  for (const GrainMaterial& m : c.of_walls) known.push_back(m.name);
  for (std::size_t k = 0; k < c.pairs.size(); ++k) {
    const string& stated = draft.pairs[k].entries.at("pair.of").stated;
    const MaterialPair& p = c.pairs[k];
    for (const string& name : {p.first, p.second})
      if (name != wall && std::find(known.begin(), known.end(), name) == known.end())
        throw_unknown(stated, name, known);
    if (p.first == wall && p.second == wall) throw error(stated, ": walls do not touch one another");
    if (p.first == p.second)
      throw error(stated, ": what grains of ", p.first, " have among each other is said in [[material]]");
  }
  if (c.pair_rule != PairRule::table) return;
  for (std::size_t a = 0; a < c.materials.size(); ++a)
    for (std::size_t b = a + 1; b < c.materials.size(); ++b)
      if (!pair_of(c, c.materials[a].name, c.materials[b].name))
        throw error(draft.entries.at("contact.pairs").stated, ": there is no [[pair]] of ",
                    c.materials[a].name, " and ", c.materials[b].name,
                    "; expected one for each two materials of grains");
}

// What [[material]] and [[pair]] say has to fit the law, as what [contact] and [wall] say.
void check_law(const Draft& draft, const Case& c) {
  const bool hertz = c.law == Case::Law::hertz;
  const auto is_given = [&](const string& key) {
    return !draft.entries.at(key).stated.ends_with("(by default)");
  };
  // Whether a stiffness of rolling or twisting comes from elsewhere than k_t: [contact], or those of a pair.
  const auto has_own = [&](const StageDraft& one, const string& couple) {
    const string key = "k_" + couple;
    if (is_given("contact." + key) || is_given("contact.k_roll")) return true;
    const auto of = one.entries.find("pair.of");
    if (of == one.entries.end()) return false;
    const auto& names = std::get<std::vector<string>>(of->second.value);
    return std::all_of(names.begin(), names.end(), [&](const string& name) {
      if (name == wall) return is_given("wall." + key) || is_given("wall.k_roll");
      return std::any_of(draft.materials.begin(), draft.materials.end(), [&](const StageDraft& m) {
        return m.name == name && m.entries.contains("material." + key);
      });
    });
  };
  const auto check = [&](const StageDraft& one, const string& table) {
    const auto number = [&](const string& key) -> const Entry* {
      const auto e = one.entries.find(table + "." + key);
      return e == one.entries.end() ? nullptr : &e->second;
    };
    const auto value = [](const Entry& e) { return std::get<double>(e.value); };
    if (const Entry* young = number("young")) {
      if (hertz && !(value(*young) > 0))
        throw error(young->stated, ": expected > 0 Pa with contact.law = \"hertz\"");
      if (!hertz && value(*young) > 0)
        throw error(young->stated, ": expected contact.law = \"hertz\", or no Young's modulus");
    }
    for (const string couple : {"roll", "twist"}) {
      const Entry *mu = number("mu_" + couple), *k = number("k_" + couple);
      if (!mu || value(*mu) == 0) continue;
      if (k && value(*k) == 0) throw error(k->stated, ": expected > 0 N/m with mu_", couple, " > 0");
      if (hertz && !k && !has_own(one, couple))
        throw error(mu->stated, ": expected k_", couple,
                    " in N/m, too: with contact.law = \"hertz\" it does not follow from k_t");
    }
  };
  for (const StageDraft& m : draft.materials) check(m, "material");
  for (const StageDraft& p : draft.pairs) check(p, "pair");
}

void check_friction(const Case& c) {
  for (const Stage& stage : c.stages) {
    dem::Scene scene;
    scene.with(dem::Material::grain).mu_s = stage.mu_s, scene.with(dem::Material::grain).mu_d = stage.mu_d;
    dem::ContactParameters& at_wall = scene.with(dem::Material::wall);
    at_wall.mu_s = at_wall.mu_d = stage.wall_mu;
    set_materials(c, stage, scene);
    for (int a = 0; a < scene.materials; ++a) {
      const auto& p = scene.between(dem::Material(a), dem::Material::wall);
      if (p.mu_d > p.mu_s)
        throw error((c.directory / "case.toml").string(), ": stage ", stage.name, ": between ",
                    c.materials[a].name, " and walls mu_d = ", p.mu_d,
                    "; expected at most their mu_s = ", p.mu_s);
      for (int b = a; b < scene.materials; ++b) {
        const auto& p = scene.between(dem::Material(a), dem::Material(b));
        if (p.mu_d > p.mu_s)
          throw error((c.directory / "case.toml").string(), ": stage ", stage.name, ": between ",
                      c.materials[a].name, " and ", c.materials[b].name, " mu_d = ", p.mu_d,
                      "; expected at most their mu_s = ", p.mu_s);
      }
    }
  }
}

}  // namespace

int material_number(const Case& c, const string& name) {
  const auto names = material_names(c);
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : static_cast<int>(found - names.begin());
}

std::vector<string> material_names(const Case& c) {
  std::vector<string> names;
  for (const GrainMaterial& m : c.materials) names.push_back(m.name);
  return names;
}

void read_materials(const Draft& draft, Case& c) {
  for (const StageDraft& m : draft.materials) {
    if (m.name == wall)
      throw error(
          m.stated,
          ": expected another name: wall stands for walls in [[pair]]; wall.material says what they are of");
    GrainMaterial material = material_in(m, draft, c);
    const bool of_walls_alone = m.name == c.wall_material && material.sizes.empty() &&
                                material.layer.empty() && m.name != c.grains.material &&
                                draft.materials.size() > 1;
    if (m.name == c.wall_material) c.of_walls.push_back(material);
    if (!of_walls_alone) c.materials.push_back(material);
  }
  if (c.materials.size() > dem::grain_materials)
    throw error(draft.materials[dem::grain_materials].stated, ": grains of ", c.materials.size(),
                " materials; expected at most ", dem::grain_materials);
  for (const StageDraft& p : draft.pairs) {
    const auto& of = std::get<std::vector<string>>(p.entries.at("pair.of").value);
    c.pairs.push_back({of[0], of[1], numbers_of(p, c)});
  }
  const auto expect_known = [&](const string& key, const string& name) {
    std::vector<string> known = material_names(c);
    if (!name.empty() && std::find(known.begin(), known.end(), name) == known.end() &&
        (c.of_walls.empty() || key == "grains.material"))
      throw_unknown(draft.entries.at(key).stated, name, known);
  };
  expect_known("grains.material", c.grains.material), expect_known("wall.material", c.wall_material);
  check_pairs(draft, c);
  check_law(draft, c);
  if (!c.materials.empty()) check_friction(c);
}

void set_materials(const Case& c, const Stage& stage, dem::Scene& scene) {
  if (c.materials.empty()) return;
  using dem::Material;
  scene.materials = static_cast<std::int32_t>(c.materials.size());
  const dem::ContactParameters grain = scene.with(Material::grain), at_wall = scene.with(Material::wall);
  const auto densities = [](dem::ContactParameters& p, double i, double j) {
    p.density_i = i, p.density_j = j;
  };
  // What is no parameter of the law by its own name.
  const auto restitution = [&](const std::map<string, double>& values, const string& prefix,
                               dem::ContactParameters& p) {
    const auto value = values.find("restitution");
    if (value != values.end() && !stage.own.contains(prefix + "restitution"))
      p.zeta = dem::damping_ratio(value->second);
  };
  const auto elastic = [&](const GrainMaterial& i, double young, double poisson, dem::ContactParameters& p) {
    if (c.law == Case::Law::linear) return;
    p.k_n = p.k_t = 0;
    p.E_star = dem::young_star(i.of.at("young"), i.of.at("poisson"), young, poisson);
    p.G_star = dem::shear_star(i.of.at("young"), i.of.at("poisson"), young, poisson);
  };
  for (int a = 0; a < scene.materials; ++a)
    scene.density[static_cast<std::size_t>(a)] = c.materials[static_cast<std::size_t>(a)].of.at("density");
  for (int a = 0; a < scene.materials; ++a) {
    const GrainMaterial& own = c.materials[static_cast<std::size_t>(a)];
    const double density = own.of.at("density");
    for (int b = 0; b < scene.materials; ++b) {
      const GrainMaterial& other = c.materials[static_cast<std::size_t>(b)];
      dem::ContactParameters& p = scene.between(Material(a), Material(b));
      p = grain;
      const std::map<string, double> values = between(c, own, other, pair_of(c, own.name, other.name));
      take(values, stage, "", p), restitution(values, "", p);
      elastic(own, other.of.at("young"), other.of.at("poisson"), p);
      densities(p, density, other.of.at("density"));
    }
    dem::ContactParameters& p = scene.between(Material(a), Material::wall);
    p = at_wall;
    const MaterialPair* pair = pair_of(c, own.name, wall);
    if (!pair && !c.of_walls.empty()) pair = pair_of(c, own.name, c.wall_material);
    std::map<string, double> values;
    if (!c.of_walls.empty()) {
      values = between(c, own, c.of_walls[0], nullptr);
      // Viscosities are those of [wall], and friction that of the stage, 0 while it shears: a top wall that
      // rubs would hold the layer.
      for (const char* key : {"gamma_n", "gamma_t", "mu_s", "mu_d"}) values.erase(key);
    }
    if (pair)
      for (const auto& [key, value] : pair->given) values[key] = value;
    values.try_emplace("k_n", own.of.at("k_n"));  // as [wall] has it
    take(values, stage, "wall_", p), restitution(values, "wall_", p);
    if (c.of_walls.empty())
      elastic(own, c.wall_elastic.young / c.softening, c.wall_elastic.poisson, p);
    else
      elastic(own, c.of_walls[0].of.at("young"), c.of_walls[0].of.at("poisson"), p);
    densities(p, density, density);
  }
}

dem::Material material_of(const Case& c, double diameter, double z) {
  if (c.materials.size() < 2) return dem::Material::grain;
  const auto within = [](const std::vector<double>& range, double x) {
    return range.empty() || (range[0] <= x && x < range[1]);
  };
  std::vector<int> takers;
  for (int k = 0; k < static_cast<int>(c.materials.size()); ++k) {
    const GrainMaterial& m = c.materials[static_cast<std::size_t>(k)];
    const bool has_rule = !m.sizes.empty() || !m.layer.empty();
    if (has_rule && within(m.sizes, diameter) && within(m.layer, z)) takers.push_back(k);
  }
  if (takers.size() > 1)
    throw error("both ", c.materials[static_cast<std::size_t>(takers[0])].name, " and ",
                c.materials[static_cast<std::size_t>(takers[1])].name,
                " take it; expected one material by material.sizes and material.layer");
  if (takers.empty() && c.grains.material.empty())
    throw error(
        "no material takes it; expected one by material.sizes or material.layer, or grains.material for all "
        "others");
  return dem::Material(takers.empty() ? material_number(c, c.grains.material) : takers[0]);
}

}  // namespace moraine::cases
