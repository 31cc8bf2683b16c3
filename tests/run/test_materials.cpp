// Materials of a case: which grain is of which, what each pair has, what is refused.
#include <cmath>

#include "case/materials.hpp"
#include "program.hpp"
#include "run/stages.hpp"

namespace moraine {
namespace {

using dem::Material;

const std::string two = R"(
[[material]]
name = "quartz"
density = 2650
mu_s = 0.8
[[material]]
name = "clay"
density = 1800
k_n = "5e4 N/m"
mu_s = 0.2
)";

class CaseMaterials : public Program {
 protected:
  // The small bed; `top`: keys on top of it, `more`: tables at its end.
  fs::path with(const std::string& name, const std::string& more, const std::string& top = "") const {
    std::string text = small_case();
    text.replace(text.find("seed = 3"), 8, "seed = 3\nradius_std = 0.002\n" + top);
    return make(name, text + more);
  }
  static std::string keyed(std::string text, const std::string& material, const std::string& key) {
    const std::string head = "name = \"" + material + "\"\n";
    return text.insert(text.find(head) + head.size(), key + "\n");
  }
  static dem::Scene scene(const cases::Case& c, std::size_t stage = 2) {
    dem::Scene s;
    s.with(Material::grain) = c.contact, s.with(Material::wall) = c.wall;
    s.with(Material::grain).mu_s = c.stages[stage].mu_s, s.with(Material::grain).mu_d = c.stages[stage].mu_d;
    s.with(Material::wall).mu_s = s.with(Material::wall).mu_d = c.stages[stage].wall_mu;
    cases::set_materials(c, c.stages[stage], s);
    return s;
  }
  void expect_refused(const std::string& more, const std::vector<std::string>& words,
                      const std::string& top = "", const std::vector<std::string>& set = {}) const {
    expect_error(to_run(with("bad", more, top), set), words);
  }
};

TEST_F(CaseMaterials, PairsByRule) {
  const fs::path c =
      with("c", two + "[[pair]]\nof = [\"clay\", \"wall\"]\nmu_s = 0.05\n", "material = \"clay\"\n");
  const dem::Scene s = scene(cases::load(c));
  EXPECT_EQ(s.materials, 2);
  EXPECT_EQ(s.density_of(Material::grain), 2650);
  EXPECT_EQ(s.density_of(Material::grain_2), 1800);
  const auto &quartz = s.between(Material::grain, Material::grain),
             &mixed = s.between(Material::grain, Material::grain_2),
             &clay = s.between(Material::grain_2, Material::grain_2);
  dem::ContactParameters mirrored = s.between(Material::grain_2, Material::grain);
  std::swap(mirrored.density_i, mirrored.density_j);
  EXPECT_EQ(mixed, mirrored);
  EXPECT_EQ(mixed.density_j, 1800);
  EXPECT_EQ(quartz.k_n, 2e5);
  EXPECT_EQ(clay.k_n, 5e4);
  EXPECT_DOUBLE_EQ(mixed.k_n, 8e4);  // 2 k k'/(k + k')
  EXPECT_EQ(mixed.k_t, 2e5);
  EXPECT_EQ(quartz.mu_d, 0.8);  // as mu_s
  EXPECT_DOUBLE_EQ(mixed.mu_s, 0.4);
  EXPECT_EQ(s.between(Material::grain_2, Material::wall).mu_s, 0.05);
  EXPECT_EQ(s.between(Material::grain_2, Material::wall).k_n, 5e4);
  EXPECT_EQ(s.between(Material::grain, Material::wall).k_n, 2e5);

  EXPECT_EQ(
      scene(cases::load(c, {{"contact.pairs", "minimum"}})).between(Material::grain, Material::grain_2).mu_s,
      0.2);
  // What a stage gives itself holds for all; softening divides what a material gives, too.
  const dem::Scene own = scene(
      cases::load(c, {{"stage.shear.mu_s", "0.7"}, {"stage.shear.mu_d", "0.6"}, {"model.softening", "2"}}));
  for (const Material a : {Material::grain, Material::grain_2})
    for (const Material b : {Material::grain, Material::grain_2}) EXPECT_EQ(own.between(a, b).mu_s, 0.7);
  EXPECT_EQ(own.between(Material::grain_2, Material::grain_2).k_n, 2.5e4);
  EXPECT_EQ(own.between(Material::grain_2, Material::grain_2).mu_d, 0.6);
}

TEST_F(CaseMaterials, PairsOfATable) {
  const std::string pair = "[[pair]]\nof = [\"clay\", \"quartz\"]\nmu_s = 0.33\nk_n = 1e5\n";
  const cases::Case loaded = cases::load(with("d", two + pair, "material = \"clay\"\n"),
                                         {{"contact.pairs", "table"}, {"pair.quartz-clay.k_n", "9e4"}});
  const dem::Scene s = scene(loaded);
  EXPECT_EQ(s.between(Material::grain, Material::grain_2).mu_s, 0.33);
  EXPECT_EQ(s.between(Material::grain, Material::grain_2).mu_d, 0.33);
  EXPECT_EQ(s.between(Material::grain_2, Material::grain).k_n, 9e4);
}

TEST_F(CaseMaterials, WallsOfAMaterial) {
  const cases::Case c = cases::load(
      with("c", two + "[[material]]\nname = \"steel\"\nk_n = 6e5\nmu_s = 0.05\n", "material = \"quartz\"\n"),
      {{"wall.material", "steel"}});
  EXPECT_EQ(c.materials.size(), 2u);  // steel is that of walls alone
  const dem::Scene s = scene(c);
  EXPECT_DOUBLE_EQ(s.between(Material::grain, Material::wall).k_n, 3e5);
  EXPECT_EQ(s.between(Material::grain, Material::wall).mu_s, 0);  // stage.wall_mu: a top wall that rubs
  EXPECT_EQ(s.between(Material::grain_2, Material::wall).mu_s, 0);
  const dem::Scene own = scene(c, 0);  // settle has viscosities of its own
  EXPECT_EQ(own.between(Material::grain, Material::wall).gamma_n, c.wall.gamma_n);
}

TEST_F(CaseMaterials, StiffnessOfRollingFollowsThatOfTheMaterial) {
  const cases::Case c =
      cases::load(with("c", keyed(two, "clay", "k_t = 3e4\nmu_roll = 0.2"), "material = \"clay\"\n"));
  const dem::ContactParameters p = scene(c).between(Material::grain_2, Material::grain_2);
  EXPECT_EQ(p.mu_roll, 0.2);
  EXPECT_EQ(p.k_roll, 3e4);
  EXPECT_EQ(p.k_twist, 3e4);
}

TEST_F(CaseMaterials, GrainsBySizeAndLayer) {
  const auto state = [&](const std::string& more, const std::string& top = "") {
    return run::start_of(cases::load(with("c", more, top))).before.state;
  };
  const dem::State by_size =
      state(keyed(two, "clay", "sizes = [\"0 m\", \"40 mm\"]"), "material = \"quartz\"\n");
  ASSERT_EQ(by_size.material.size(), 300u);
  std::size_t small = 0;
  for (dem::Index i = 0; i < 300; ++i) {
    EXPECT_EQ(by_size.material_of(i) == Material::grain_2, by_size.r[i] < 0.02);
    small += by_size.r[i] < 0.02;
  }
  EXPECT_GT(small, 50u);
  EXPECT_LT(small, 250u);
  const dem::State by_layer = state(
      keyed(keyed(two, "clay", "layer = [\"0 m\", \"0.2 m\"]"), "quartz", "layer = [\"20 cm\", \"100 m\"]"));
  for (dem::Index i = 0; i < 300; ++i)
    EXPECT_EQ(by_layer.material_of(i) == Material::grain_2, by_layer.x[i].z < 0.2);
  EXPECT_TRUE(state("[[material]]\nname = \"quartz\"\ndensity = 2700\n").material.empty());
}

// From a table, through a run, out again as a table and as a LAMMPS data file, and on into a case that has
// the materials in another order.
TEST_F(CaseMaterials, StayWithTheGrains) {
  const std::string rest =
      "[box]\nx = 0.1\ny = 0.1\n[contact]\nk_n = 1e5\nk_t = 1e5\n[wall]\ngamma_n = 1\ngamma_t = 1\n"
      "[[stage]]\nname = \"fall\"\nkind = \"settle\"\nduration = 0.01\n";
  directory.write("c/grains.csv",
                  "x,y,z,r,material\n0.02,0.03,0.02,0.005,clay\n0.06,0.03,0.02,0.004,quartz\n0.06,0.08,0.02,"
                  "0.004,clay\n");
  const fs::path c = make("c", "start = \"grains.csv\"\n" + rest + two);
  ASSERT_NO_FATAL_FAILURE(run(c));
  const output::Checkpoint end = output::read_checkpoint(checkpoint_of(c));
  EXPECT_EQ(end.materials, "quartz, clay");
  for (dem::Index i = 0; i < 3; ++i)
    EXPECT_EQ(end.state.material_of(i) == Material::grain, end.state.id[i] == 1);
  const std::string csv = moraine({"export", c.string(), "--format", "csv"}).out;
  EXPECT_NE(csv.find("wz, material\n"), std::string::npos);
  EXPECT_NE(csv.find(", quartz\n"), std::string::npos);
  const std::string data = moraine({"export", c.string(), "--format", "lammps"}).out;
  EXPECT_NE(data.find("2 atom types"), std::string::npos);
  EXPECT_NE(data.find("\n2 1 0.0080000000000000002 2650 "), std::string::npos) << data;
  for (const auto& [name, text] : {std::pair{"grains.csv", csv}, {"grains.data", data}}) {
    directory.write(std::string("again/") + name, text);
    const fs::path again = make("again", "start = \"" + std::string(name) + "\"\n" + rest + two);
    const dem::State s = run::start_of(cases::load(again)).before.state;
    for (dem::Index i = 0; i < 3; ++i) EXPECT_EQ(s.material_of(i) == Material::grain, s.id[i] == 1) << name;
  }
  const std::string other =
      "[[material]]\nname = \"gravel\"\n[[material]]\nname = \"clay\"\ndensity = 1800\n"
      "[[material]]\nname = \"quartz\"\ndensity = 2650\n";
  const fs::path next = make("next", "start = \"../c\"\n" + rest + other);
  const run::Start start = run::start_of(cases::load(next));
  for (dem::Index i = 0; i < 3; ++i)
    EXPECT_EQ(start.before.state.material_of(i),
              start.before.state.id[i] == 1 ? Material::grain_3 : Material::grain_2);
  EXPECT_EQ(start.before.scene.density_of(Material::grain_3), 2650);
  ASSERT_NO_FATAL_FAILURE(run(next));
  const fs::path lost = make(
      "lost", "start = \"../c\"\n" + rest + "[[material]]\nname = \"clay\"\n[[material]]\nname = \"sand\"\n");
  expect_error(to_run(lost), {"of the materials quartz, clay", "none called quartz"});
  directory.write("c/grains.csv", "x,y,z,r,material\n0.02,0.03,0.02,0.005,qartz\n");
  expect_error(to_run(c), {"grains.csv", "line 2", "material = \"qartz\"", "did you mean quartz?"});
}

// A resolved case is the same case.
TEST_F(CaseMaterials, ResolvedTextReadsBack) {
  const fs::path c =
      with("c", two + "[[pair]]\nof = [\"quartz\", \"clay\"]\nmu_s = 0.3\n", "material = \"clay\"\n");
  const cases::Case first =
      cases::load(c, {{"material.quartz.sizes", "[\"5 cm\", \"1 m\"]"}, {"stage.shear.gamma_n", "3"}});
  const cases::Case again = cases::load(make("again", first.resolved));
  EXPECT_EQ(again.resolved, first.resolved);
  EXPECT_EQ(again.materials, first.materials);
  EXPECT_EQ(again.pairs, first.pairs);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(scene(again, k), scene(first, k));
  const auto changes =
      cases::changes(first.resolved, cases::load(c, {{"material.quartz.sizes", "[\"5 cm\", \"1 m\"]"},
                                                     {"stage.shear.gamma_n", "3"},
                                                     {"pair.clay-quartz.mu_s", "0.4"}}));
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].key, "pair.quartz-clay.mu_s");
  EXPECT_TRUE(changes[0].physics);
  // A case that extends it takes them over.
  const cases::Case extended =
      cases::load(make("e", "extends = \"../c\"\n[[material]]\nname = \"clay\"\nmu_s = 0.1\n"));
  EXPECT_EQ(extended.materials[1].of.at("mu_s"), 0.1);
  EXPECT_EQ(extended.materials[1].of.at("density"), 1800);
}

TEST_F(CaseMaterials, Refused) {
  const std::string all = "material = \"clay\"\n";
  expect_refused(two, {"grain 0 of diameter", "no material takes it", "grains.material"});
  expect_refused(
      keyed(keyed(two, "clay", "sizes = [\"0 m\", \"1 m\"]"), "quartz", "layer = [\"0 m\", \"9 m\"]"),
      {"grain 0 of diameter", "both quartz and clay take it"});
  expect_refused(two, {"bad/case.toml:", "grains.material = \"cley\"", "did you mean clay?"},
                 "material = \"cley\"\n");
  expect_refused(two + "[[pair]]\nof = [\"clay\", \"quarz\"]\n",
                 {"pair.clay-quarz.of", "no material \"quarz\"", "did you mean quartz?"}, all);
  expect_refused(two + "[[pair]]\nof = [\"clay\"]\n", {"pair.of", "expected two materials"}, all);
  expect_refused(two + "[[pair]]\nof = [\"clay\", \"clay\"]\n", {"is said in [[material]]"}, all);
  expect_refused(two + "[[pair]]\nof = [\"clay\", \"quartz\"]\n[[pair]]\nof = [\"quartz\", \"clay\"]\n",
                 {"there is another pair of this name"}, all);
  expect_refused(two, {"contact.pairs", "no [[pair]] of quartz and clay", "expected one for each"}, all,
                 {"contact.pairs=table"});
  expect_refused(two, {"no material \"quart\"", "quartz, clay"}, all, {"material.quart.mu_s=1"});
  expect_refused(two, {"unknown key", "did you mean material.quartz.mu_s?"}, all,
                 {"material.quartz.mu_ss=1"});
  expect_refused(two, {"between quartz and quartz mu_d = 0.9", "at most their mu_s = 0.8"}, all,
                 {"material.quartz.mu_d=0.9"});
  expect_refused(two + "[[pair]]\nof = [\"clay\", \"wall\"]\nmu_s = 0.1\nmu_d = 0.2\n",
                 {"between clay and walls mu_d = 0.2", "at most their mu_s = 0.1"}, all);
  expect_refused(two, {"material.quartz.young=1e9", "expected contact.law = \"hertz\""}, all,
                 {"material.quartz.young=1e9"});
  const std::vector<std::string> hertz = {"contact.law=hertz", "contact.young=1e9"};
  const auto with = [&](const std::string& key) {
    std::vector<std::string> keys = hertz;
    keys.push_back(key);
    return keys;
  };
  expect_refused(two, {"material.quartz.young=0", "expected > 0 Pa"}, all, with("material.quartz.young=0"));
  expect_refused(two, {"material.quartz.mu_roll=0.1", "expected k_roll in N/m", "does not follow from k_t"},
                 all, with("material.quartz.mu_roll=0.1"));
  std::vector<std::string> soft = with("material.quartz.mu_roll=0.1");
  soft.push_back("material.quartz.k_roll=0");
  expect_refused(two, {"material.quartz.k_roll=0", "expected > 0 N/m"}, all, soft);
  expect_refused(two + "[[material]]\nname = \"wall\"\n", {"expected another name"}, all);
  expect_refused(keyed(two, "clay", "sizes = [\"2 m\", \"1 m\"]"),
                 {"material.clay.sizes", "the smaller length first"}, all);
  expect_refused(keyed(two, "clay", "sizes = [\"2 kg\", \"1 m\"]"), {"material.clay.sizes", "kg"}, all);
  std::string five = two;
  for (const char* name : {"silt", "sand", "gravel"})
    five += "[[material]]\nname = \"" + std::string(name) + "\"\n";
  expect_refused(five, {"5 materials", "expected at most 4"}, all);
}

}  // namespace
}  // namespace moraine
