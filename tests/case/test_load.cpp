// Loads that change with time, as a case says them.
#include "case/load.hpp"

#include <gtest/gtest.h>

#include "case/case.hpp"
#include "error.hpp"
#include "temporary_directory.hpp"

namespace moraine::cases {
namespace {

class LoadTest : public testing::Test {
 protected:
  // A stage that shears under these keys.
  Case load(const std::string& keys, const std::vector<Override>& overrides = {}) {
    files.write("x/case.toml", "[[stage]]\nname = \"shear\"\nkind = \"shear\"\nduration = 2\n" + keys);
    return cases::load(files.path() / "x", overrides);
  }
  std::string fault(const std::string& keys, const std::vector<Override>& overrides = {}) {
    try {
      load(keys, overrides);
    } catch (const Error& e) {
      std::string text = e.what();
      const std::string above = files.path().string() + "/";
      for (std::size_t at; (at = text.find(above)) != text.npos;) text.erase(at, above.size());
      return text;
    }
    return "no error";
  }
  // Of a table for the velocity with these rows.
  std::string fault_of_table(const std::string& rows) {
    files.write("x/v.csv", "time (ms), value (cm/s)\n" + rows);
    return fault("normal_stress = 1000\nvelocity = { table = \"v.csv\" }\n");
  }
  void expect_fault(const std::string& found, const std::vector<std::string>& words) {
    for (const std::string& word : words) EXPECT_NE(found.find(word), found.npos) << word << "\n" << found;
  }

  TemporaryDirectory files;
};

const std::string moving = "velocity = 0.1\n",
                  ramp = "normal_stress = { ramp = [\"20 kPa\", 8e4], over = \"500 ms\" }\n";

TEST_F(LoadTest, RampListAndTable) {
  files.write("x/v.csv", "# of the test\ntime (ms), value (cm/s)\n0, 10\n1500, -20\n2000, 5\n");
  const Case c = load(ramp +
                      "velocity = { table = \"v.csv\", interpolation = \"steps\" }\n"
                      "velocity_amplitude = \"1 cm/s\"\nvelocity_frequency = 3\n");
  const Stage& s = c.stages[0];
  EXPECT_EQ(s.normal_stress, 8e4);  // the largest
  EXPECT_EQ(s.normal_stress_history, (History{History::Between::linear, true, {0, 0.5}, {2e4, 8e4}}));
  EXPECT_DOUBLE_EQ(s.velocity, -0.2);
  EXPECT_EQ(s.velocity_history.between, History::Between::steps);
  EXPECT_EQ(s.velocity_history.time, (std::vector<double>{0, 1.5, 2}));
  EXPECT_DOUBLE_EQ(s.velocity_history.value[2], 0.05);
  EXPECT_DOUBLE_EQ(s.velocity_amplitude, 0.01);
  EXPECT_EQ(c.tables, (std::vector{files.path() / "x/v.csv"}));
  EXPECT_TRUE(c.has_histories());

  const Case list = load(
      "normal_stress = 1e4\nvelocity = { times = [\"0 s\", \"1 s\", 2], values = [0, \"1 mm/s\", 0], "
      "interpolation = \"linear\" }\n");
  EXPECT_EQ(list.stages[0].velocity_history,
            (History{History::Between::linear, false, {0, 1, 2}, {0, 0.001, 0}}));
}

TEST_F(LoadTest, TheResolvedCaseSaysTheSame) {
  files.write("x/v.csv", "time, value\n0, 0.1\n2, 0.3\n");
  const std::string keys = ramp + "velocity = { table = \"v.csv\", interpolation = \"steps\" }\n";
  const Case c = load(keys);
  files.write("x/case.toml", c.resolved);
  const Case again = cases::load(files.path() / "x");
  EXPECT_EQ(again.stages, c.stages);
  EXPECT_EQ(again.resolved, c.resolved);
  EXPECT_TRUE(changes(c.resolved, again).empty());
  const std::vector<Change> found = changes(c.resolved, load(keys, {{"stage.shear.normal_stress", "5 kPa"}}));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].key, "stage.shear.normal_stress");
  EXPECT_NE(found[0].before.find("ramp"), std::string::npos) << found[0].before;
  EXPECT_TRUE(found[0].physics);
}

TEST_F(LoadTest, OverridesAndOtherDirectories) {
  files.write("x/v.csv", "time, value\n0, 0.1\n2, 0.3\n");
  files.write("x/s.csv", "time, value (kPa)\n0, 1\n2, 3\n");
  const std::string keys = "normal_stress = 1000\nvelocity = { table = \"v.csv\" }\n";
  const std::vector<Override> by_table{
      {"stage.shear.normal_stress", "{ table = \"s.csv\", interpolation = \"linear\" }"}};
  EXPECT_EQ(load(keys, by_table).stages[0].normal_stress, 3000);
  EXPECT_EQ(load(keys, {{"normal_stress", "{ ramp = [\"1 kPa\", \"2 kPa\"], over = \"1 s\" }"}})
                .stages[0]
                .normal_stress,
            2000);
  // A case that extends this one, and one of a sweep, read the same files.
  files.write("y/case.toml", "extends = \"../x\"\n");
  EXPECT_EQ(cases::load(files.path() / "y").stages, load(keys).stages);
  files.write("x/sweep/one/case.toml", extension_text(files.path() / "x", by_table, "../.."));
  EXPECT_EQ(cases::load(files.path() / "x/sweep/one").stages, load(keys, by_table).stages);
}

TEST_F(LoadTest, WhatIsNoHistory) {
  const auto of = [&](const std::string& load) { return fault(moving + "normal_stress = " + load + "\n"); };
  expect_fault(of("{ ramp = [1, 2] }"),
               {"x/case.toml:6: stage.shear.normal_stress", "expected a number, { ramp = "});
  expect_fault(of("{ ramp = [1, 2], over = 0 }"), {"over: expected > 0 s"});
  expect_fault(of("{ ramp = [1, \"2 m\"], over = 1 }"), {"ramp: \"m\" has the wrong dimension", "Pa"});
  expect_fault(of("{ ramp = [1, 2, 3], over = 1 }"), {"ramp: expected two values"});
  expect_fault(of("{ ramp = [-1, 2], over = 1 }"), {"expected >= 0 Pa"});
  expect_fault(of("{ times = [0, 1], values = [1] }"), {"2 times and 1 values"});
  expect_fault(of("{ times = [0, 2, 1], values = [1, 1, 1] }"), {"times[2]: 1 s after 2 s runs backwards"});
  expect_fault(of("{ times = [0, 2, 2], values = [1, 1, 1] }"), {"times[2]: two values at 2 s"});
  expect_fault(of("{ times = [0.5, 2], values = [1, 1] }"), {"times[0]: begins at 0.5 s", "0 s"});
  expect_fault(of("{ times = [0, 2], values = [1, 1], interpolation = \"cubic\" }"),
               {"expected linear or steps"});
  expect_fault(of("{ times = [0, 1.5], values = [1, 1] }"),
               {"ends at 1.5 s and the stage at 2 s", "expected values up to there"});
  expect_fault(of("{ table = \"none.csv\" }"), {"x/case.toml:6", "there is no x/none.csv"});
  expect_fault(
      of("{ ramp = [1000, 3000], over = 1 }\nnormal_stress_amplitude = 1500"),
      {"normal_stress_amplitude", "at most the least normal_stress = 1000 Pa: the wall cannot pull"});
}

TEST_F(LoadTest, TablesAreRefusedByTheirLines) {
  expect_fault(fault_of_table("0, 1\n100, 2\n"),
               {"x/case.toml:6: stage.shear.velocity", "v.csv", "ends at 0.1 s and the stage at 2 s"});
  expect_fault(fault_of_table("0, 1\n# back\n200, 2\n100, 3\n"),
               {"x/v.csv, line 5: 0.1 s after 0.2 s runs backwards"});
  expect_fault(fault_of_table("0, 1\n200, 2\n200, 3\n"), {"x/v.csv, line 4: two values at 0.2 s"});
  expect_fault(fault_of_table("100, 1\n2000, 2\n"), {"x/v.csv, line 2: begins at 0.1 s"});
  files.write("x/s.csv", "time, value\n0, 1000\n2, -1\n");
  expect_fault(fault(moving + "normal_stress = { table = \"s.csv\" }\n"),
               {"x/s.csv, line 3: value = -1: expected >= 0 Pa"});
  files.write("x/s.csv", "time, values\n0, 1000\n2, 1\n");
  expect_fault(fault(moving + "normal_stress = { table = \"s.csv\" }\n"),
               {"s.csv", "values", "expected time, value"});
}

TEST_F(LoadTest, WhatContradictsAChangingVelocity) {
  const std::string pressed = "normal_stress = 1000\n",
                    changing = pressed + "velocity = { ramp = [0, 1], over = 1 }\n";
  expect_fault(fault(changing + "strain = 1\n", {{"stage.shear.duration", "0"}}),
               {"stage.shear.strain", "a duration: the velocity changes"});
  expect_fault(fault(changing + "strain_rate = 1\n"), {"either velocity or strain_rate"});
  expect_fault(fault(pressed + "velocity_amplitude = 1\n"), {"velocity_frequency", "> 0 Hz"});
  EXPECT_EQ(fault(pressed + "velocity_amplitude = 1\nvelocity_frequency = 1\n"), "no error");
  files.write("x/case.toml",
              "[[stage]]\nname = \"creep\"\nkind = \"shear_stress\"\nduration = 2\nnormal_stress = 1000\n"
              "shear_stress = 500\nprofile = \"cosine\"\n");
  try {
    cases::load(files.path() / "x");
    ADD_FAILURE();
  } catch (const Error& e) {
    expect_fault(e.what(),
                 {"stage.creep.profile", "it belongs to kind shear, and this stage is shear_stress"});
  }
}

TEST_F(LoadTest, NoWaterOnASlope) {
  expect_fault(
      fault("normal_stress = 1000\nvelocity = 1\n", {{"model.slope", "3 deg"}, {"fluid.enabled", "true"}}),
      {"stage.shear.fluid", "false on a slope"});
  EXPECT_NEAR(load("normal_stress = 1000\nvelocity = 1\n", {{"model.slope", "3 deg"}}).slope, 0.0523598775598,
              1e-12);
}

}  // namespace
}  // namespace moraine::cases
