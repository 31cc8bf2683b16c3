#include "case/case.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "case/keys.hpp"
#include "case/preset.hpp"
#include "error.hpp"
#include "temporary_directory.hpp"

namespace moraine::cases {
namespace {

const std::string settle = "[[stage]]\nname = \"settle\"\nkind = \"settle\"\nduration = \"5 s\"\n";
const std::string shear =
    "[[stage]]\nname = \"shear\"\nkind = \"shear\"\nnormal_stress = \"80 kPa\"\nstrain_rate = 0.05\nduration "
    "= 20\n";

class CaseTest : public testing::Test {
 protected:
  void write(const std::string& text, const std::string& name = "x") {
    files.write(name + "/case.toml", text);
  }
  Case load(const std::vector<Override>& overrides = {}, const std::string& name = "x") {
    return cases::load(files.path() / name, overrides);
  }
  // The message, with the temporary directory cut off.
  std::string fault(const std::vector<Override>& overrides = {}) {
    try {
      load(overrides);
    } catch (const Error& e) {
      std::string text = e.what();
      const std::string above = files.path().string() + "/";
      for (std::size_t at; (at = text.find(above)) != text.npos;) text.erase(at, above.size());
      return text;
    }
    return "no error";
  }
  std::string fault_of(const std::string& text) {
    write(text);
    return fault();
  }

  TemporaryDirectory files;
};

TEST_F(CaseTest, defaults_are_those_of_the_paper) {
  write(settle + shear);
  const Case c = load();
  EXPECT_EQ(c.directory, files.path() / "x");
  EXPECT_EQ(c.title, "");
  EXPECT_TRUE(c.start.empty());
  EXPECT_TRUE(c.periodic_x && c.periodic_y && !c.periodic_z && c.floor && c.ledger);
  EXPECT_EQ(c.grains.count, 10000);
  EXPECT_EQ(c.grains.distribution, "lognormal");
  EXPECT_NEAR(c.grains.radius_std * c.grains.radius_std, 8.8e-9, 1e-11);
  EXPECT_EQ(c.grains.density, 2600);
  EXPECT_EQ(c.grains.seed, 1u);
  EXPECT_EQ(c.contact.k_n, 1.16e9);
  EXPECT_EQ(c.contact.k_t, 1.16e9);
  EXPECT_EQ(c.gravity, 9.80665);
  EXPECT_EQ(c.stages[0].f, 0.075);
  EXPECT_EQ(c.output.series_interval, 0.05);

  ASSERT_EQ(c.stages.size(), 2u);
  const Stage& first = c.stages[0];
  EXPECT_EQ(first.kind, Stage::Kind::settle);
  EXPECT_EQ(first.top_wall, Stage::TopWall::automatic);
  EXPECT_EQ(first.duration, 5);
  EXPECT_EQ(first.wall_gamma_n, 1e4);
  EXPECT_EQ(first.wall_mu, 0.3);
  const Stage& second = c.stages[1];
  EXPECT_EQ(second.kind, Stage::Kind::shear);
  EXPECT_EQ(second.normal_stress, 80e3);
  EXPECT_EQ(second.strain_rate, 0.05);
  EXPECT_EQ(second.velocity, 0);
  EXPECT_EQ(second.wall_gamma_n, 0);
  EXPECT_EQ(second.wall_mu, 0);
  EXPECT_LT(second.bottom_layer, 0);
  EXPECT_TRUE(second.zero_kinematics);
}

TEST_F(CaseTest, a_stage_takes_its_contacts_from_above) {
  write("[contact]\nmu_s = 0.6\ngamma_n = \"100 N s/m\"\n" + settle + "mu_d = 0.2\n" + shear);
  const Case c = load();
  EXPECT_EQ(c.stages[0].gamma_n, 100);
  EXPECT_EQ(c.stages[0].mu_s, 0.6);
  EXPECT_EQ(c.stages[0].mu_d, 0.2);
  EXPECT_EQ(c.stages[0].wall_mu, 0.2);
  EXPECT_EQ(c.stages[1].mu_d, 0.6);
}

TEST_F(CaseTest, choices_become_enumerators) {
  write("[box]\nperiodic = \"xz\"\nz = 1\nfloor = false\n" + settle + "top_wall = \"none\"\n");
  const Case c = load();
  EXPECT_TRUE(c.periodic_x && !c.periodic_y && c.periodic_z);
  EXPECT_EQ(c.stages[0].top_wall, Stage::TopWall::none);
  write(
      "[box]\nperiodic = \"none\"\n[[stage]]\nname = \"a\"\nkind = \"uniaxial\"\nstrain_rate = 1e-2\nstrain "
      "= \"1 %\"\n");
  const Case u = load();
  EXPECT_FALSE(u.periodic_x || u.periodic_y || u.periodic_z);
  EXPECT_EQ(u.stages[0].kind, Stage::Kind::uniaxial);
  EXPECT_DOUBLE_EQ(u.stages[0].strain, 0.01);
}

TEST_F(CaseTest, extends_merges_tables_and_stages_by_name) {
  write("title = \"base\"\n[contact]\nmu_s = 0.5\n[model]\nf = 0.1\n" + settle + shear, "base");
  write(
      "extends = \"../base\"\n[model]\nf = 0.05\n[[stage]]\nname = \"shear\"\nnormal_stress = \"40 kPa\"\n"
      "[[stage]]\nname = \"more\"\nkind = \"consolidate\"\nnormal_stress = 1e4\nduration = 1\n");
  const Case c = load();
  EXPECT_EQ(c.title, "base");
  EXPECT_EQ(c.stages[0].f, 0.05);
  ASSERT_EQ(c.stages.size(), 3u);
  EXPECT_EQ(c.stages[1].name, "shear");
  EXPECT_EQ(c.stages[1].normal_stress, 40e3);
  EXPECT_EQ(c.stages[1].strain_rate, 0.05);
  EXPECT_EQ(c.stages[2].name, "more");
  EXPECT_EQ(c.stages[2].mu_s, 0.5);
}

TEST_F(CaseTest, stages_names_what_runs) {
  write(settle + shear, "base");
  write("extends = \"../base\"\nstages = [\"shear\"]\n", "middle");
  write("extends = \"../middle\"\n" + settle);
  const Case c = load();
  ASSERT_EQ(c.stages.size(), 2u);
  EXPECT_EQ(c.stages[0].name, "shear");
  EXPECT_EQ(c.stages[1].name, "settle");
  EXPECT_EQ(load({{"stages", "[\"settle\"]"}}).stages.size(), 1u);
  EXPECT_EQ(fault_of("stages = [\"sheer\"]\n" + settle + shear),
            "x/case.toml:1: stages = [ 'sheer' ]: no stage \"sheer\"; stages: settle, shear");
}

TEST_F(CaseTest, an_inherited_start_is_the_same_file) {
  files.write("beds/a.h5", "");
  files.write("old/output/checkpoint.h5", "");
  write("start = \"../../beds/a.h5\"\n" + shear, "deep/base");
  write("extends = \"../deep/base\"\n");
  EXPECT_EQ(load().start, files.path() / "beds/a.h5");
  EXPECT_EQ(load({{"start", "../old"}}).start, files.path() / "old/output/checkpoint.h5");
}

TEST_F(CaseTest, overrides) {
  write(settle + shear);
  const Case c = load({{"model.f", "0.05"},
                       {"stage.shear.normal_stress", "40 kPa"},
                       {"title", "2 words"},
                       {"grains.count", "1e3"},
                       {"stage.settle.top_wall", "none"},
                       {"box.floor", "false"}});
  EXPECT_EQ(c.stages[0].f, 0.05);
  EXPECT_EQ(c.stages[1].normal_stress, 40e3);
  EXPECT_EQ(c.title, "2 words");
  EXPECT_EQ(c.grains.count, 1000);
  EXPECT_EQ(c.stages[0].top_wall, Stage::TopWall::none);
  EXPECT_FALSE(c.floor);
}

// A name without its table: the one table that has it, or every stage that gives it.
TEST_F(CaseTest, overrides_without_a_table) {
  write(settle + shear);
  const Case c = load({{"normal_stress", "40 kPa"}, {"count", "500"}});
  EXPECT_EQ(c.stages[0].normal_stress, 0);
  EXPECT_EQ(c.stages[1].normal_stress, 40e3);
  EXPECT_EQ(c.grains.count, 500);
  EXPECT_EQ(fault({{"mu_s", "0.3"}}),
            "--set mu_s=0.3: expected the full name, one of contact.mu_s, stage.mu_s");
  EXPECT_EQ(
      fault({{"shear_stress", "1"}}),
      "--set shear_stress=1: no stage gives this key in case.toml; expected stage.NAME.shear_stress with "
      "NAME one of settle, shear");
  EXPECT_EQ(fault({{"normal_stress", "40 m"}}),
            "--set normal_stress=40 m: \"m\" has the wrong dimension; expected a unit convertible to Pa");
}

TEST_F(CaseTest, an_extension_is_the_case_with_its_overrides) {
  files.write("bed.h5", "");
  write(settle + shear);
  const std::vector<Override> overrides{
      {"normal_stress", "40 kPa"}, {"seed", "7"}, {"stages", "[\"shear\"]"}, {"start", "../bed.h5"}};
  write(extension_text(files.path() / "x", overrides, "../../x"), "deep/y");
  Case wanted = load(overrides), found = load({}, "deep/y");
  EXPECT_EQ(found.start, wanted.start);
  EXPECT_EQ(found.stages, wanted.stages);
  EXPECT_EQ(found.grains, wanted.grains);
}

TEST_F(CaseTest, resolved_loads_to_the_same_case) {
  files.write("bed.h5", "");
  write("title = \"a \\\"b\\\" \\\\ \\n ü\"\nstart = \"../bed.h5\"\n" + settle, "base");
  write(
      "extends = \"../base\"\n[contact]\nmu_s = 0.1\nk_n = 123456789012345678901.0\n[grains]\nradius_std = "
      "\"0.3 mm\"\n[model]\nf = 0.30000000000000004\n" +
      shear);
  const Case c = load({{"stage.shear.strain_rate", "3.3 %/s"}, {"stage.shear.normal_stress_phase", "-0.0"}});
  EXPECT_NE(c.resolved.find("normal_stress = 80000.0  # Pa\n"), c.resolved.npos);
  write(c.resolved);
  EXPECT_TRUE(load() == c);
}

TEST_F(CaseTest, a_preset_sets_step_and_stiffness) {
  const std::string contact = "[contact]\nk_n = 3e8\nk_t = 2e8\n[wall]\nk_t = 1e8\n";
  const auto with = [&](const std::string& model) {
    write(contact + "[model]\n" + model + "\n" + settle + shear + "f = 0.01\n");
    return load();
  };
  const Case plain = with("");
  EXPECT_EQ(plain.preset, "none");
  EXPECT_EQ(plain.softening, 1);
  EXPECT_EQ(plain.contact.k_n, 3e8);
  EXPECT_EQ(plain.stages[0].f, 0.075);
  for (const Preset& p : presets()) {
    const Case c = with("preset = \"" + p.name + "\"");
    EXPECT_EQ(c.contact.k_n, 3e8 / p.softening);
    EXPECT_EQ(c.contact.k_t, 2e8 / p.softening);
    EXPECT_EQ(c.wall.k_t, 1e8 / p.softening);
    EXPECT_EQ(c.stages[0].wall_gamma_n, p.wall_gamma);
    EXPECT_EQ(c.stages[0].wall_gamma_t, p.wall_gamma);
    EXPECT_EQ(c.stages[1].wall_gamma_n, 0);
    EXPECT_EQ(c.stages[0].f, p.f);
    EXPECT_EQ(c.stages[1].f, 0.01);  // a stage's own f stays
    EXPECT_NE(reference().find(p.evidence), std::string::npos);
  }
  const Case paper = with("preset = \"paper\"");
  EXPECT_EQ(paper.contact.k_n, plain.contact.k_n);
  EXPECT_EQ(paper.stages, plain.stages);
}

TEST_F(CaseTest, explicit_keys_override_a_preset) {
  write("[model]\npreset = \"fast\"\nsoftening = 2\nf = 0.05\n" + settle);
  EXPECT_EQ(load().contact.k_n, 1.16e9 / 2);
  EXPECT_EQ(load().stages[0].f, 0.05);
  EXPECT_EQ(load({{"model.softening", "4"}}).contact.k_n, 1.16e9 / 4);
  write("[model]\npreset = \"fast\"\n" + settle, "base");
  write("extends = \"../base\"\n[model]\npreset = \"paper\"\n");
  EXPECT_EQ(load().contact.k_n, 1.16e9);
}

TEST_F(CaseTest, a_resolved_preset_softens_once) {
  write("[model]\npreset = \"fast\"\n" + settle);
  const Case c = load();
  write(c.resolved, "again");
  Case again = load({}, "again");
  again.directory = c.directory;
  EXPECT_EQ(again, c);
}

TEST_F(CaseTest, every_key_is_in_the_reference) {
  for (const Key& key : keys()) {
    const std::string leaf = key.name.substr(key.table().size());
    EXPECT_NE(reference().find("\n  " + leaf + " "), std::string::npos) << key.name;
    EXPECT_FALSE(key.meaning.empty()) << key.name;
  }
}

TEST_F(CaseTest, a_case_is_dry_unless_it_says_otherwise) {
  write(settle + shear);
  EXPECT_FALSE(load().has_water());
  EXPECT_FALSE(load().stages[1].fluid);
  EXPECT_EQ(load().fluid.viscosity, 1.8e-3);
  EXPECT_EQ(load().fluid.compressibility, 4.5e-10);
  EXPECT_EQ(load().fluid.density, 1000);
  EXPECT_EQ(load().fluid.cell, 2.5);
  EXPECT_EQ(load().fluid.exchange_interval, 0);
  EXPECT_EQ(load().fluid.tolerance, 1e-10);
  EXPECT_TRUE(load({{"stage.shear.fluid", "true"}}).has_water());
  EXPECT_FALSE(load({{"stage.shear.fluid", "true"}}).stages[0].fluid);
  const Case wet = load({{"fluid.enabled", "true"}, {"stage.settle.fluid", "false"}});
  EXPECT_FALSE(wet.stages[0].fluid);
  EXPECT_TRUE(wet.stages[1].fluid);
}

TEST_F(CaseTest, water_in_any_unit) {
  write(
      "[box]\nperiodic = \"x\"\n[fluid]\nenabled = true\nviscosity = \"1.8 mPa s\"\ncompressibility = "
      "\"0.45 1/GPa\"\npermeability_factor = \"35 mm2\"\nclosure = \"pressure_gradient\"\nsolver = "
      "\"cholmod\"\ny_low = \"pressure\"\ny_low_pressure = \"2 kPa\"\ny_high = \"flux\"\ny_high_flux = "
      "\"1 mm/s\"\n" +
      shear +
      "top_pressure = \"3 kPa\"\ntop_pressure_amplitude = \"1 kPa\"\ntop_pressure_frequency = \"0.2 "
      "Hz\"\nfluid_bottom = \"flux\"\nbottom_flux = \"1 mm/s\"\n");
  const Case c = load();
  EXPECT_DOUBLE_EQ(c.fluid.viscosity, 1.8e-3);
  EXPECT_DOUBLE_EQ(c.fluid.compressibility, 4.5e-10);
  EXPECT_DOUBLE_EQ(c.fluid.permeability_factor, 3.5e-5);
  EXPECT_EQ(c.fluid.closure, Fluid::Closure::pressure_gradient);
  EXPECT_EQ(c.fluid.solver, Fluid::Solver::cholmod);
  EXPECT_EQ(c.fluid.y_low.kind, FluidSide::Kind::pressure);
  EXPECT_EQ(c.fluid.y_low.pressure, 2e3);
  EXPECT_EQ(c.fluid.y_high.kind, FluidSide::Kind::flux);
  EXPECT_DOUBLE_EQ(c.fluid.y_high.flux, 1e-3);
  EXPECT_EQ(c.stages[0].top_pressure, 3e3);
  EXPECT_EQ(c.stages[0].fluid_bottom, Stage::FluidBottom::flux);
  EXPECT_DOUBLE_EQ(c.stages[0].bottom_flux, 1e-3);
  write(c.resolved);
  const Case again = load();
  EXPECT_EQ(again.fluid, c.fluid);
  EXPECT_EQ(again.stages, c.stages);
}

TEST_F(CaseTest, water_that_contradicts_itself) {
  write(settle + shear);
  // With these settings the error names the key, and what was expected.
  const auto expect_fault = [&](const std::vector<Override>& settings, const std::string& key,
                                const std::string& expected) {
    const std::string found = fault(settings);
    EXPECT_NE(found.find(key), found.npos) << found;
    EXPECT_NE(found.find("expected " + expected), found.npos) << found;
  };
  const Override wet{"fluid.enabled", "true"};
  expect_fault({wet, {"model.dt", "auto"}}, "fluid", "false with model.dt = \"auto\"");
  expect_fault({wet,
                {"box.periodic", "xyz"},
                {"box.z", "1"},
                {"box.floor", "false"},
                {"stage.shear.top_wall", "none"},
                {"stage.shear.normal_stress", "0"}},
               "fluid", "false where z is periodic");
  expect_fault({wet, {"stage.settle.fluid_top", "impermeable"}}, "stage.settle.fluid_top",
               "drained: there is no");
  const Override tight{"stage.shear.fluid_top", "impermeable"};
  for (const char* key : {"top_pressure", "top_pressure_amplitude", "top_pressure_frequency"})
    expect_fault({wet, tight, {"stage.shear." + std::string(key), "1"}}, "stage.shear." + std::string(key),
                 "0");
  expect_fault({wet, {"stage.shear.top_pressure_amplitude", "1"}}, "top_pressure_frequency", "> 0 Hz");
  expect_fault({wet, {"stage.shear.bottom_flux", "1"}}, "bottom_flux", "0 m/s, or fluid_bottom");
  expect_fault({wet, {"stage.shear.bottom_pressure", "1"}}, "bottom_pressure", "0 Pa, or fluid_bottom");
  expect_fault({{"stage.shear.top_pressure", "1"}}, "top_pressure", "0 Pa: there is no pore water");
  expect_fault({{"fluid.x_low", "pressure"}}, "fluid.x_low", "no_flow: x is periodic");
  expect_fault({{"box.periodic", "y"}, {"fluid.x_low_flux", "1"}}, "fluid.x_low_flux", "0 m/s, or x_low");
  expect_fault({{"box.periodic", "y"}, {"fluid.x_low", "flux"}, {"fluid.x_low_pressure", "1"}},
               "fluid.x_low_pressure", "0 Pa, or x_low");
  expect_fault({{"fluid.porosity_min", "0.9"}}, "fluid.porosity_min", "less than fluid.porosity_max = 0.9");
  expect_fault({{"fluid.porosity_max", "1"}}, "fluid.porosity_max", "less than 1");
  expect_fault({{"fluid.tolerance", "0.5"}}, "fluid.tolerance", "1e-15 .. 1e-6");
  for (const char* key : {"viscosity", "compressibility", "density", "porosity_min", "cell"})
    expect_fault({{"fluid." + std::string(key), "0"}}, "fluid." + std::string(key), "> 0");
  expect_fault({{"fluid.cells_x", "-1"}}, "fluid.cells_x", ">= 0");
}

TEST_F(CaseTest, unknown_keys_name_the_nearest) {
  EXPECT_EQ(fault_of("[contact]\nmu_ss = 0.3\n" + settle),
            "x/case.toml:2: contact.mu_ss = 0.3: unknown key; did you mean contact.mu_s?");
  EXPECT_EQ(fault_of("titel = \"a\"\n" + settle),
            "x/case.toml:1: titel = \"a\": unknown key; did you mean title?");
  EXPECT_EQ(fault_of("[contact]\ngravity = 9\n" + settle),
            "x/case.toml:2: contact.gravity = 9: unknown key; did you mean model.gravity?");
  EXPECT_EQ(fault_of("[contcat]\nmu_s = 9\n" + settle),
            "x/case.toml:1: [contcat]: unknown table; did you mean [contact]?");
  EXPECT_EQ(fault_of("[ice]\nmu = 9\n" + settle),
            "x/case.toml:1: [ice]: unknown table; known: box, grains, contact, wall, model, fluid, material, "
            "pair, stage, "
            "output, guards");
  EXPECT_EQ(fault_of("[wall]\nroughness = 9\n" + settle),
            "x/case.toml:2: wall.roughness = 9: unknown key; known here: k_t, material, young, poisson, "
            "restitution, mu_roll, k_roll, mu_twist, k_twist, cohesion, mass, gamma_n, gamma_t");
  EXPECT_EQ(
      fault_of(settle + "normal_stres = 3\n"),
      "x/case.toml:5: stage.settle.normal_stres = 3: unknown key; did you mean stage.settle.normal_stress?");
}

TEST_F(CaseTest, wrong_values_say_what_was_expected) {
  EXPECT_EQ(fault_of("[contact]\nk_n = \"1 kPa\"\n"),
            "x/case.toml:2: contact.k_n = \"1 kPa\": \"kPa\" has the wrong dimension; expected a unit "
            "convertible to N/m");
  EXPECT_EQ(fault_of("[contact]\nk_n = true\n"),
            "x/case.toml:2: contact.k_n = true: expected a number in N/m, or a text with a unit");
  EXPECT_EQ(fault_of("[contact]\nk_n = nan\n"), "x/case.toml:2: contact.k_n = nan: expected a finite number");
  EXPECT_EQ(fault_of("[contact]\nk_n = -1\n"), "x/case.toml:2: contact.k_n = -1: expected > 0 N/m");
  EXPECT_EQ(fault_of("[grains]\ncount = 0\n"), "x/case.toml:2: grains.count = 0: expected 1 .. 2147483647");
  EXPECT_EQ(fault_of("[grains]\ncount = 1.5\n"), "x/case.toml:2: grains.count = 1.5: expected an integer");
  EXPECT_EQ(fault_of("[grains]\ncount = \"1\"\n"),
            "x/case.toml:2: grains.count = \"1\": expected an integer");
  EXPECT_EQ(fault_of("[grains]\ndistribution = \"log-normal\"\n"),
            "x/case.toml:2: grains.distribution = \"log-normal\": expected lognormal | uniform | fractal | "
            "sieves | bimodal; "
            "did you mean lognormal?");
  EXPECT_EQ(fault_of("[box]\nfloor = 1\n"), "x/case.toml:2: box.floor = 1: expected true or false");
  EXPECT_EQ(fault_of("title = 1\n"), "x/case.toml:1: title = 1: expected a text in quotes");
  EXPECT_EQ(fault_of("model = 1\n"), "x/case.toml:1: model = 1: expected a table, [model]");
  EXPECT_EQ(fault_of("stages = \"settle\"\n"),
            "x/case.toml:1: stages = \"settle\": expected a list of texts, such as [\"settle\", \"shear\"]");
}

TEST_F(CaseTest, syntax_errors_name_the_line) {
  EXPECT_TRUE(fault_of("title = \"a\"\n[contact\n").starts_with("x/case.toml:2: ")) << fault();
  EXPECT_TRUE(fault_of("title = \"a\"\n\ntitle = \"b\"\n").starts_with("x/case.toml:3: ")) << fault();
}

TEST_F(CaseTest, missing_files) {
  EXPECT_EQ(fault(), "x/case.toml: not found; a case is a directory that holds a case.toml");
  EXPECT_EQ(
      fault_of("extends = \"../nowhere\"\n"),
      "x/case.toml:1: extends = \"../nowhere\": expected a directory that holds a case.toml, relative to x");
  EXPECT_EQ(fault_of("start = \"../nowhere\"\n" + shear),
            "x/case.toml:1: start = \"../nowhere\": there is no nowhere; expected a finished case, a "
            "checkpoint or a file of "
            "grains, relative to x");
  write(settle, "bed");
  EXPECT_EQ(fault_of("start = \"../bed\"\n" + shear),
            "x/case.toml:1: start = \"../bed\": there is no bed/output/checkpoint.h5; run that case first: "
            "moraine run bed");
}

TEST_F(CaseTest, cases_do_not_extend_in_a_circle) {
  write("extends = \"../x\"\n", "y");
  EXPECT_EQ(fault_of("extends = \"../y\"\n"),
            "y/case.toml:1: extends = \"../x\": the cases extend each other in a circle: x -> y -> x");
}

TEST_F(CaseTest, errors_of_a_base_name_its_file) {
  write("[contact]\nmu_ss = 1\n", "base");
  EXPECT_EQ(fault_of("extends = \"../base\"\n"),
            "base/case.toml:2: contact.mu_ss = 1: unknown key; did you mean contact.mu_s?");
}

TEST_F(CaseTest, errors_of_overrides) {
  write(settle + shear);
  EXPECT_EQ(fault({{"contact.mu_ss", "0.3"}}),
            "--set contact.mu_ss=0.3: unknown key; did you mean contact.mu_s?");
  EXPECT_EQ(fault({{"foo.mu_s", "1"}}), "--set foo.mu_s=1: unknown key; did you mean contact.mu_s?");
  EXPECT_EQ(fault({{"model.f", "-1"}}), "--set model.f=-1: expected > 0");
  EXPECT_EQ(fault({{"model.f", ""}}), "--set model.f=: expected a number");
  EXPECT_EQ(fault({{"stage.sheer.velocity", "1"}}),
            "--set stage.sheer.velocity=1: no stage \"sheer\"; stages: settle, shear");
  EXPECT_EQ(fault({{"stages", "[\"shear\"]"}, {"stage.settle.duration", "1"}}),
            "--set stage.settle.duration=1: no stage \"settle\"; stages: shear");
  EXPECT_EQ(fault({{"stage.shear.velocty", "1"}}),
            "--set stage.shear.velocty=1: unknown key; did you mean stage.shear.velocity?");
  EXPECT_EQ(fault({{"stage.shear.normal_stress", "40 m"}}),
            "--set stage.shear.normal_stress=40 m: \"m\" has the wrong dimension; expected a unit "
            "convertible to Pa");
  EXPECT_EQ(fault({{"stage.shear.name", "a"}}), "--set stage.shear.name=a: a stage keeps its name");
  EXPECT_EQ(fault({{"extends", "../a"}}), "--set extends=../a: only case.toml can say what it extends");
}

TEST_F(CaseTest, a_number_too_many_in_an_override) {
  write(settle + shear);
  EXPECT_EQ(load({{"normal_stress", "12 500 Pa"}}).stages[1].normal_stress, 12500);
  for (const char* wrong :
       {"12 50 Pa", "1.2.5 kPa", "2 kPa.5", "12 kPa 3", "12,500 Pa", "12,5", "1 2", "80 # kPa"})
    EXPECT_NE(fault({{"normal_stress", wrong}}), "no error") << wrong;
  for (const char* wrong : {"0.3 0.5", "1/3", "0,3", "30 degree", "0.3 1", "0.3 # 0.5"})
    EXPECT_NE(fault({{"contact.mu_s", wrong}}), "no error") << wrong;
  for (const char* wrong : {"1 2", "1,000", "5 # 6", "1 000"})
    EXPECT_NE(fault({{"seed", wrong}}), "no error") << wrong;
  EXPECT_EQ(
      fault_of(settle + "gamma_n = \"12 500 3 N s/m\"\n"),
      "x/case.toml:5: stage.settle.gamma_n = \"12 500 3 N s/m\": understood the number 12500 and the unit "
      "\"3 N s/m\", but \"3 N s/m\" is another number; expected one number and a unit, as in \"1 N s/m\"");
}

// What names a stage goes before what is meant for each, and no key is set twice.
TEST_F(CaseTest, the_order_of_overrides_does_not_matter) {
  write(settle + shear);
  const Override each{"normal_stress", "40 kPa"}, one{"stage.shear.normal_stress", "20 kPa"};
  EXPECT_EQ(load({each, one}).stages[1].normal_stress, 20e3);
  EXPECT_EQ(load({one, each}).stages[1].normal_stress, 20e3);
  EXPECT_EQ(fault({{"seed", "1"}, {"grains.seed", "2"}}),
            "--set seed=1 and --set grains.seed=2: expected each key once");
  EXPECT_EQ(fault({each, {"normal_stress", "50 kPa"}}),
            "--set normal_stress=40 kPa and --set normal_stress=50 kPa: expected each key once");
  EXPECT_EQ(fault({one, one}),
            "--set stage.shear.normal_stress=20 kPa and --set "
            "stage.shear.normal_stress=20 kPa: expected each key once");
}

TEST_F(CaseTest, errors_take_one_line) {
  for (const std::string wrong :
       {"a = [1,\n2", "title = \"a\nb\"", "[contact]\nk_n = \"\"\"1\n2 N/m\"\"\"",
        "[contact.k_n]\na = 1\nb = 2", "[contact]\n\"k\\nn\" = 1", "[contact]\nk_n = [1,\n2]", "= 1",
        "[model]\nf = 0.1.2", "[model]\nf = 1 2", "a = 1\nb = 2\na.b = 3"}) {
    const std::string found = fault_of(wrong + "\n" + settle);
    EXPECT_NE(found, "no error") << wrong;
    EXPECT_EQ(found.find('\n'), found.npos) << found;
  }
  write(settle);
  EXPECT_EQ(fault({{"contact.k_n", "1\n2"}}).find('\n'), std::string::npos);
}

TEST_F(CaseTest, stages_are_named_once_and_well) {
  EXPECT_EQ(fault_of("title = \"\"\n"), "x/case.toml: no stages; expected at least one [[stage]]");
  EXPECT_EQ(fault_of("[stage]\nname = \"a\"\n"),
            "x/case.toml:1: stage: expected stages, each headed by [[stage]]");
  EXPECT_EQ(fault_of("[[stage]]\nkind = \"settle\"\n"),
            "x/case.toml:1: stage.name is missing; expected name = \"...\", unique");
  EXPECT_EQ(fault_of("[[stage]]\nname = \"a b\"\n"),
            "x/case.toml:2: stage.name = \"a b\": expected letters, digits, - and _");
  EXPECT_EQ(
      fault_of(settle + settle),
      "x/case.toml:6: stage.name = \"settle\": there is another stage of this name; expected a unique one");
  EXPECT_EQ(fault_of("[[stage]]\nname = \"a\"\n"),
            "x/case.toml:1: stage.a.kind is missing; expected settle | consolidate | shear | shear_stress | "
            "uniaxial | press");
}

TEST_F(CaseTest, relations_between_keys) {
  EXPECT_EQ(fault_of("[contact]\nmu_d = 0.4\n" + settle),
            "x/case.toml:2: contact.mu_d = 0.4: expected at most contact.mu_s = 0.3");
  EXPECT_EQ(fault_of(settle + "mu_s = 0.2\n"),
            "x/case.toml:1: stage.settle.mu_d = 0.3 (by default): expected at most mu_s = 0.2");
  EXPECT_EQ(fault_of("[grains]\ndistribution = \"uniform\"\nradius_min = 2\nradius_max = 1\n" + settle),
            "x/case.toml:4: grains.radius_max = 1: expected at least grains.radius_min = 2");
  EXPECT_EQ(fault_of("[grains]\ndistribution = \"uniform\"\n" + settle),
            "x/case.toml: grains.radius_min = 0.0 (by default): expected > 0 m for uniform radii");
  const std::string mixed = "[grains]\ndistribution = \"bimodal\"\n", fine = "fine_radius_mean = 0.005\n";
  EXPECT_EQ(fault_of(mixed + settle),
            "x/case.toml: grains.fine_radius_mean = 0.0 (by default): expected > 0 m and less than "
            "grains.radius_mean = 0.02, that of the coarse grains");
  EXPECT_EQ(
      fault_of(mixed + "fine_radius_mean = 0.03\nfine_fraction = 0.3\n" + settle),
      "x/case.toml:3: grains.fine_radius_mean = 0.03: expected > 0 m and less than grains.radius_mean = "
      "0.02, that of the coarse grains");
  EXPECT_EQ(fault_of(mixed + fine + "fine_fraction = 1\n" + settle),
            "x/case.toml:4: grains.fine_fraction = 1: expected more than 0 and less than 1, by mass");
  EXPECT_EQ(
      fault_of("[grains]\n" + fine + settle),
      "x/case.toml:2: grains.fine_radius_mean = 0.005: expected 0, or grains.distribution = \"bimodal\"");
  EXPECT_EQ(fault_of("[box]\nperiodic = \"xyz\"\n" + settle),
            "x/case.toml: box.z = 0.0 (by default): expected > 0 m where z is periodic");
  EXPECT_EQ(
      fault_of("[box]\nperiodic = \"xyz\"\nz = 1\nfloor = false\n" + shear),
      "x/case.toml:5: stage.shear.top_wall = \"automatic\" (by default): expected none where z is periodic");

  EXPECT_EQ(fault_of(shear + "strain = 1\n"),
            "x/case.toml:7: stage.shear.strain = 1: expected either duration or strain");
  EXPECT_EQ(fault_of(shear + "velocity = 1\n"),
            "x/case.toml:5: stage.shear.strain_rate = 0.05: expected either velocity or strain_rate");
  EXPECT_EQ(
      fault_of(settle + "strain = 1\n"),
      "x/case.toml:5: stage.settle.strain = 1: expected none: it belongs to kind shear, uniaxial, and this "
      "stage is settle");
  EXPECT_EQ(fault_of(settle + "normal_stress = 1\n"),
            "x/case.toml:5: stage.settle.normal_stress = 1: expected 0 Pa: no stress drives the top wall of "
            "this stage");
  EXPECT_EQ(
      fault_of("[[stage]]\nname = \"a\"\nkind = \"consolidate\"\nduration = 1\n"),
      "x/case.toml:1: stage.a.normal_stress = 0.0 (by default): expected > 0 Pa: stress drives the top wall");
  EXPECT_EQ(fault_of("[[stage]]\nname = \"a\"\nkind = \"settle\"\n"),
            "x/case.toml:1: stage.a.duration = 0.0 (by default): expected a duration > 0 s");
  EXPECT_EQ(fault_of("[[stage]]\nname = \"a\"\nkind = \"uniaxial\"\nduration = 1\n"),
            "x/case.toml:1: stage.a.strain_rate = 0.0 (by default): expected other than 0 1/s");
  EXPECT_EQ(fault_of("[[stage]]\nname = \"a\"\nkind = \"shear_stress\"\nnormal_stress = 1\nduration = 1\n"),
            "x/case.toml:1: stage.a.shear_stress = 0.0 (by default): expected other than 0 Pa");
  EXPECT_EQ(
      fault_of(shear + "normal_stress_amplitude = \"90 kPa\"\n"),
      "x/case.toml:7: stage.shear.normal_stress_amplitude = \"90 kPa\": expected at most normal_stress = "
      "80000 Pa: "
      "the wall cannot pull");
  EXPECT_EQ(fault_of(shear + "normal_stress_amplitude = \"10 kPa\"\n"),
            "x/case.toml:1: stage.shear.normal_stress_frequency = 0.0 (by default): expected > 0 Hz with an "
            "amplitude");
}

TEST_F(CaseTest, one_value_is_judged_as_one_of_a_file) {
  const auto fault_in = [](const std::string& name, const std::string& toml, const std::string& kind = "") {
    try {
      read_value(name, toml, kind);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(std::get<double>(read_value("stage.shear.normal_stress", "\"80 kPa\"", "shear")), 80e3);
  EXPECT_EQ(fault_in("contact.k_n", "-1"), "contact.k_n = -1: expected > 0 N/m");
  EXPECT_EQ(fault_in("title", "3"), "title = 3: expected a text in quotes");
  EXPECT_EQ(fault_in("stage.shear.strian", "1"),
            "stage.shear.strian = 1: unknown key; did you mean stage.shear.strain?");
  EXPECT_EQ(fault_in("normal_stres", "1"),
            "normal_stres = 1: unknown key; did you mean stage.normal_stress?");
  EXPECT_EQ(fault_in("stage.fall.velocity", "1", "settle"),
            "stage.fall.velocity = 1: expected none: it belongs to kind shear, and this stage is settle");
  EXPECT_NE(fault_in("contact.k_n", "1 2"), "no error");
}

TEST_F(CaseTest, a_text_is_filled_with_presets_and_defaults_though_it_is_unfinished) {
  write("[contact]\nmu_s = 0.4\n", "base");
  const std::string text =
      "extends = \"../base\"\n[model]\npreset = \"fast\"\n[[stage]]\nname = \"a\"\nkind = \"settle\"\n";
  const auto values = read_resolved(filled(files.path() / "x", text));  // no such directory
  EXPECT_EQ(values.at("contact.mu_d"), "0.4");
  EXPECT_EQ(values.at("stage.a.f"), "0.3");
  EXPECT_EQ(values.at("stage.a.wall_gamma_n"), "450.0");
  EXPECT_EQ(values.at("stage.a.duration"), "0.0");  // which load() would refuse
}

}  // namespace
}  // namespace moraine::cases
