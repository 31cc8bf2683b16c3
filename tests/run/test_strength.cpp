// Friction is counted along the direction of the shear, by stage; strain and dilation from where shear began.
#include <cmath>
#include <regex>

#include "dem/packing.hpp"
#include "program.hpp"
#include "run/record.hpp"

namespace moraine {
namespace {

using run::Strength;

output::Row row_at(double strain, double friction, double dilation = 0) {
  output::Row r{};
  r.shear_strain = strain, r.shear_friction = friction, r.dilation_diameters = dilation;
  return r;
}

// Rises to 0.6 at a strain of 0.1, falls to 0.4 from 0.2 on; from `origin` in direction d.
std::vector<output::Row> curve(double d, double origin) {
  std::vector<output::Row> rows;
  for (int k = 0; k <= 300; ++k) {
    const double e = 0.0011 * k;
    const double f = e < 0.1 ? 6 * e : std::max(0.4, 0.6 - 2 * (e - 0.1));
    rows.push_back(row_at(origin + d * e, d * f, 0.5 * e));
  }
  return rows;
}

void expect_same(const Strength& a, const Strength& b) {
  EXPECT_NEAR(a.peak, b.peak, 1e-12);
  EXPECT_NEAR(a.peak_strain, b.peak_strain, 1e-12);
  EXPECT_NEAR(a.smoothed_peak, b.smoothed_peak, 1e-12);
  EXPECT_NEAR(a.ultimate, b.ultimate, 1e-12);
  EXPECT_NEAR(a.dilation_diameters, b.dilation_diameters, 1e-12);
}

TEST(Strength, IsThatOfTheMirrorImageAndOfAnyOrigin) {
  const Strength forth = run::strength_of(curve(1, 0));
  EXPECT_NEAR(forth.peak, 0.6, 0.0066);
  EXPECT_NEAR(forth.peak_strain, 0.1, 0.0011);
  EXPECT_NEAR(forth.ultimate, 0.4, 1e-12);
  // 21 values about the peak: 0.6 less 0.006 or 0.002 for each 0.001 of strain; the best window lies further
  // on.
  EXPECT_GT(forth.smoothed_peak, 0.57);
  EXPECT_LT(forth.smoothed_peak, 0.6);
  for (const double d : {1.0, -1.0})
    for (const double origin : {0.0, 0.31, -0.17}) expect_same(run::strength_of(curve(d, origin)), forth);
}

// A stage whose friction never points along its shear has a peak below zero, not at zero.
TEST(Strength, MayBeNegative) {
  std::vector<output::Row> rows;
  for (int k = 0; k <= 10; ++k) rows.push_back(row_at(-0.001 * k, 0.3 - 0.01 * k));
  EXPECT_NEAR(run::strength_of(rows).peak, -0.2, 1e-12);
  EXPECT_EQ(run::strength_of({row_at(0, 0.1)}).peak, 0);
}

class Directions : public Program {
 protected:
  static std::string shear(const std::string& name, double velocity, const std::string& more = {}) {
    return "[[stage]]\nname = \"" + name + "\"\nkind = \"shear\"\nnormal_stress = 2000\nduration = 0.125\n" +
           "velocity = " + std::to_string(velocity) + "\n" + more;
  }
  static std::string on_bed(const std::string& start, const std::string& stages, const std::string& named) {
    return "start = \"../" + start + "\"\nextends = \"../bed\"\nstages = [" + named + "]\n" +
           "[output]\nseries_interval = \"1 ms\"\nsnapshot_interval = 1\n" + stages;
  }
  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(run(make("bed", "stages = [\"settle\", \"consolidate\"]\n" + small_case())));
  }
  std::vector<output::Row> rows_of_stage(const fs::path& which, int stage) const {
    std::vector<output::Row> own;
    for (const output::Row& r : output::read_series(series_of(which)))
      if (r.stage == stage) own.push_back(r);
    return own;
  }
};

// x to -x: a bed sheared towards -x has the forces of its mirror image, and the numbers of the table with
// them.
TEST_F(Directions, AMirroredBedHasTheSameStrength) {
  output::Checkpoint bed = output::read_checkpoint(checkpoint_of(directory.path() / "bed"));
  dem::State& s = bed.state;
  const auto mirror = [](dem::Vec3d& v) { v.x = -v.x; };
  const auto mirror_axial = [](dem::Vec3d& v) { v.y = -v.y, v.z = -v.z; };
  for (dem::Vec3d& x : s.x) x.x = bed.scene.box.x - x.x;
  for (auto* list : {&s.v, &s.force})
    for (dem::Vec3d& v : *list) mirror(v);
  for (auto* list : {&s.omega, &s.torque, &s.rotation})
    for (dem::Vec3d& v : *list) mirror_axial(v);
  for (dem::Contact& c : s.contacts) mirror(c.spring.delta_t);
  for (dem::WallContact& c : s.wall_contacts) mirror(c.spring.delta_t);
  fs::create_directories(directory.path() / "mirror/output");
  output::write_checkpoint(checkpoint_of(directory.path() / "mirror"), bed);

  const fs::path plus = make("plus", on_bed("bed", shear("one", 0.2), "\"one\""));
  const fs::path minus = make("minus", on_bed("mirror", shear("one", -0.2), "\"one\""));
  ASSERT_NO_FATAL_FAILURE(run(plus));
  ASSERT_NO_FATAL_FAILURE(run(minus));
  const auto a = rows_of_stage(plus, 0), b = rows_of_stage(minus, 0);
  ASSERT_EQ(a.size(), b.size());
  // The sums are taken in another order, and what is rounded grows: the first half is compared closely.
  for (std::size_t k = 0; k < a.size() / 2; ++k) {
    ASSERT_NEAR(a[k].shear_friction, -b[k].shear_friction, 1e-6) << "row " << k;
    ASSERT_NEAR(a[k].shear_strain, -b[k].shear_strain, 1e-12) << "row " << k;
    ASSERT_NEAR(a[k].dilation, b[k].dilation, 1e-9) << "row " << k;
  }
  const Strength p = run::strength_of(a), m = run::strength_of(b);
  EXPECT_GT(p.peak, 0.3);
  EXPECT_NEAR(p.peak, m.peak, 0.02);
  EXPECT_NEAR(p.smoothed_peak, m.smoothed_peak, 0.02);
  EXPECT_NEAR(p.ultimate, m.ultimate, 0.02);
  EXPECT_NEAR(p.dilation_diameters, m.dilation_diameters, 0.02);
}

// Forth and back to where it began: one origin, one height, a loop that closes.
TEST_F(Directions, ForthAndBackMakesALoop) {
  const fs::path both =
      make("both", on_bed("bed", shear("forth", 0.2) + shear("back", -0.2) + shear("again", 0.2),
                          "\"forth\", \"back\", \"again\""));
  ASSERT_NO_FATAL_FAILURE(run(both));
  const auto forth = rows_of_stage(both, 0), back = rows_of_stage(both, 1), again = rows_of_stage(both, 2);
  const double most = forth.back().shear_strain;
  EXPECT_NEAR(most, 0.2 * 0.125 / (forth[0].height - forth[0].dilation), 1e-3 * most);
  EXPECT_EQ(forth[0].shear_strain, 0);
  EXPECT_EQ(forth[0].dilation, 0);
  // Through the seams nothing jumps.
  for (const auto& [before, after] : {std::pair{&forth, &back}, {&back, &again}}) {
    EXPECT_EQ(before->back().shear_strain, after->front().shear_strain);
    EXPECT_NEAR(before->back().dilation, after->front().dilation, 1e-12);
    EXPECT_NEAR(before->back().height - before->back().dilation,
                after->front().height - after->front().dilation, 1e-12);
  }
  EXPECT_NEAR(back.back().shear_strain, 0, 2e-3 * most);
  EXPECT_NEAR(again.back().shear_strain, most, 2e-3 * most);
  for (const auto* stage : {&forth, &back, &again}) {
    const Strength s = run::strength_of(*stage);
    EXPECT_GT(s.peak, 0.2);
    EXPECT_GT(s.ultimate, 0.1);
    EXPECT_LE(s.smoothed_peak, s.peak);
  }
  EXPECT_LT(back.back().shear_friction, 0);  // the rows keep the sign of x

  // A stage of another kind in between begins anew.
  const fs::path anew = make("anew", on_bed("both",
                                            "[[stage]]\nname = \"rest\"\nkind = \"consolidate\"\n"
                                            "normal_stress = 2000\nduration = 0.02\nwall_gamma_n = 40\n"
                                            "wall_gamma_t = 40\n" +
                                                shear("one", 0.2),
                                            "\"rest\", \"one\""));
  ASSERT_NO_FATAL_FAILURE(run(anew));
  EXPECT_EQ(rows_of_stage(anew, 1).front().shear_strain, 0);
  EXPECT_EQ(rows_of_stage(anew, 1).front().dilation, 0);
  // A case that starts from a sheared bed shears on.
  const fs::path on = make("on", on_bed("both", shear("one", 0.1), "\"one\""));
  ASSERT_NO_FATAL_FAILURE(run(on));
  EXPECT_NEAR(rows_of_stage(on, 0).front().shear_strain, again.back().shear_strain, 1e-12);
}

// One grain held, one driven over it, and nothing but friction at their contact: mu = 0.3 either way.
TEST_F(Directions, TwoGrainsForthAndBack) {
  output::Checkpoint c;
  c.finished = true;
  c.state = dem::grains_at_rest({0.02, 0.02}, {{0.1, 0.1, 0.02}, {0.1, 0.1, 0.06}});
  c.scene.box = {0.2, 0.2, 0};
  output::write_checkpoint(directory.path() / "two.h5", c);
  const auto shear = [](const std::string& name, const std::string& velocity) {
    return "[[stage]]\nname = \"" + name + "\"\nkind = \"shear\"\nvelocity = \"" + velocity + "\"\n" +
           "duration = 0.3\nnormal_stress = 1000\nbottom_layer = 0.03\ntop_layer = 0.03\n";
  };
  const fs::path two = make("two", R"(
start = "../two.h5"
[contact]
k_n = 1e6
k_t = 1e6
gamma_n = 20
[wall]
mass = 0.2
[output]
series_interval = 0.001
snapshot_interval = 1
[[stage]]
name = "press"
kind = "consolidate"
normal_stress = 1000
duration = 0.2
wall_gamma_n = 20
wall_gamma_t = 0
)" + shear("forth", "0.5 mm/s") + shear("back", "-0.5 mm/s") +
                                       shear("again", "0.5 mm/s"));
  const Outcome o = moraine(to_run(two));
  ASSERT_EQ(o.status, 0) << o.err;
  const auto forth = rows_of_stage(two, 1);
  EXPECT_NEAR(run::strength_of(forth).ultimate, 0.3, 0.01);  // the normal leans by up to 0.15 mm/40 mm
  for (const int stage : {2, 3}) {
    const Strength s = run::strength_of(rows_of_stage(two, stage));
    EXPECT_NEAR(s.peak, 0.3, 0.01) << stage;
    EXPECT_NEAR(s.ultimate, 0.3, 0.01) << stage;
  }
  EXPECT_NEAR(rows_of_stage(two, 2).back().shear_friction, -0.3, 0.01);
  // The table has them, too: peak, smooth (over all of so short a stage, its reversal included), ultimate.
  std::smatch found;
  const std::regex line(R"(\nback .* (-?[0-9.]+) +(-?[0-9.]+) +(-?[0-9.]+) +[+-])");
  ASSERT_TRUE(std::regex_search(o.out, found, line)) << o.out;
  EXPECT_NEAR(std::stod(found[1]), 0.3, 0.01) << o.out;
  EXPECT_NEAR(std::stod(found[3]), 0.3, 0.01) << o.out;
}

}  // namespace
}  // namespace moraine
