// box.walls through the program.
#include "program.hpp"

namespace moraine {
namespace {

class SideWalls : public Program {
 protected:
  // Keys of the small case's [box], and what comes before all tables.
  fs::path bed(const std::string& name, const std::string& box, const std::string& above = "") const {
    return make(name, above + "[box]\n" + box + "\n" + small_case());
  }
  static void expect_inside(const fs::path& run) {
    const output::Checkpoint end = output::read_checkpoint(checkpoint_of(run));
    for (dem::Index i = 0; i < end.state.size(); ++i)
      for (int a = 0; a < 2; ++a) {
        if (a == 0 ? end.scene.periodic_x : end.scene.periodic_y) continue;
        EXPECT_GT(end.state.x[i][a], 0.9 * end.state.r[i]);
        EXPECT_LT(end.state.x[i][a], end.scene.box[a] - 0.9 * end.state.r[i]);
      }
  }
};

const std::string four = "periodic = \"none\"\nwalls = \"xy\"", settle = "stages = [\"settle\"]\n";

TEST_F(SideWalls, HoldABedThatSettlesIsPressedAndIsSheared) {
  const fs::path settled = bed("settled", four, settle);
  run(settled);
  expect_inside(settled);
  const output::Row last = output::read_series(series_of(settled)).back();
  EXPECT_GT(last.coordination, 3);
  EXPECT_LT(last.kinetic, 1e-3 * last.potential);
  const fs::path pressed = bed("pressed", four, "start = \"../settled\"\nstages = [\"consolidate\"]\n");
  run(pressed, {"stage.consolidate.duration=1 s"});
  expect_inside(pressed);
  // The top wall swings on the bed, around its load.
  const auto rows = output::read_series(series_of(pressed));
  double stress = 0;
  const std::size_t half = rows.size() / 2;
  for (std::size_t k = half; k < rows.size(); ++k)
    stress += rows[k].normal_stress / static_cast<double>(rows.size() - half);
  EXPECT_NEAR(stress, 2000, 200);
  const fs::path sheared = bed("sheared", "periodic = \"x\"\nwalls = \"y\"");
  run(sheared);
  expect_inside(sheared);
}

TEST_F(SideWalls, GiveTheSameBitsOnOneAndTwoThreads) {
  const fs::path one = bed("one", four, settle), two = bed("two", four, settle);
  run(one, {}, {"--threads", "1"});
  run(two, {}, {"--threads", "2"});
  expect_same_results(one, two);
}

TEST_F(SideWalls, AreRefusedAlongAPeriodicAxis) {
  for (const auto& [walls, periodic, axis] : {std::tuple{"x", "xy", "x"}, {"xy", "x", "x"}, {"xy", "y", "y"}})
    expect_error(
        to_run(bed("bad", std::string("periodic = \"") + periodic + "\"\nwalls = \"" + walls + "\"")),
        {"bad/case.toml:3", std::string("box.walls = \"") + walls + "\"",
         std::string("expected none along ") + axis + ", which is periodic (box.periodic = \"" + periodic});
  expect_error(to_run(bed("bad", "walls = \"z\"")), {"box.walls = \"z\"", "none | x | y | xy"});
}

TEST_F(SideWalls, RefuseABedThatSticksThroughThem) {
  run(bed("periodic", "", settle));
  expect_error(
      to_run(bed("walled", four, "start = \"../periodic\"\nstages = [\"consolidate\"]\n")),
      {"periodic/output/checkpoint.h5", "overlaps the side wall ", "let the bed settle between the walls"});
}

TEST_F(SideWalls, TheirSidesAreNotOpenToGrains) {
  const std::string wet = settle + "fluid.enabled = true\n";
  const auto said = [&](const std::string& name, const std::string& box) {
    const Outcome o =
        moraine({"check", bed(name, box, wet).string(), "--backend", "cpu", "--set", "model.f=0.05"});
    EXPECT_EQ(o.status, 0) << o.err;
    return o.out + o.err;
  };
  EXPECT_NE(said("open", "periodic = \"none\"").find("are open"), std::string::npos);
  EXPECT_EQ(said("walled", four).find("are open"), std::string::npos);
  const std::string half = said("half", "periodic = \"none\"\nwalls = \"y\"");
  EXPECT_NE(half.find("x = 0 and x = "), std::string::npos) << half;
  EXPECT_EQ(half.find("y = 0 and y = "), std::string::npos) << half;
}

}  // namespace
}  // namespace moraine
