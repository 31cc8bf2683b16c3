// Stages that press a periodic box: the packings that are known, the account of energy, bits, and what a
// person is told.
#include "backends.hpp"
#include "program.hpp"
#include "run/run.hpp"

namespace moraine {
namespace {

class Press : public Program {
 protected:
  // Equal spheres of 2 cm: a gas, agitated while it is pressed, then 10 kPa. k_n/(P d) = 1e4; gamma_n is 0.29
  // of what is critical.
  static std::string packing(int grains, double mu, double duration) {
    const std::string friction = "mu_s = " + std::to_string(mu) + "\nmu_d = " + std::to_string(mu) + "\n";
    return box + "[grains]\nradius_mean = 0.01\nradius_std = 0\nplacement = \"random\"\ncount = " +
           std::to_string(grains) +
           "\n[contact]\nk_n = 2e6\nk_t = 2e6\nmu_s = 0\n[model]\ngravity = 0\nf = 0.15\n"
           "[[stage]]\nname = \"gas\"\nkind = \"press\"\nporosity = 0.55\nstrain_rate = 1\n"
           "[[stage]]\nname = \"press\"\nkind = \"press\"\npressure = \"10 kPa\"\nstrain_rate = 3\n"
           "gamma_n = 60\nduration = " +
           std::to_string(duration) + "\n" + friction +
           "[output]\nseries_interval = 0.01\nsnapshot_interval = 10\n[guards]\ninterval = 2000\n";
  }
  // 1:20, pressed with little friction.
  static std::string graded(double porosity) {
    return box +
           "[grains]\ncount = 1000\ndistribution = \"fractal\"\nradius_min = 0.001\nradius_max = 0.02\n"
           "fractal_dimension = 1.5\nplacement = \"random\"\n"
           "[contact]\nk_n = 2e6\nk_t = 2e6\ngamma_n = 2\nmu_s = 0.1\n[model]\ngravity = 0\nf = 0.2\n"
           "[[stage]]\nname = \"press\"\nkind = \"press\"\nstrain_rate = 10\nporosity = " +
           std::to_string(porosity) +
           "\n[output]\nseries_interval = 0.002\nsnapshot_interval = 0.01\ncheckpoint_interval = 0.2\n"
           "[guards]\ninterval = 500\n";
  }
  static inline const std::string box = "[box]\nperiodic = \"xyz\"\nfloor = false\n";

  // Contacts of each grain that has at least so many, when those with fewer are taken away, again and again.
  static double coordination(const dem::State& s, int fewest) {
    std::vector<int> bears(s.r.size(), 1);
    for (bool changed = true; changed;) {
      std::vector<int> count(s.r.size(), 0);
      for (const dem::Contact& c : s.contacts)
        if (bears[c.i] && bears[c.j]) ++count[c.i], ++count[c.j];
      changed = false;
      double contacts = 0, grains = 0;
      for (std::size_t i = 0; i < bears.size(); ++i) {
        if (bears[i] && count[i] < fewest) bears[i] = 0, changed = true;
        contacts += bears[i] * count[i], grains += bears[i];
      }
      if (!changed) return contacts / grains;
    }
    return 0;
  }

  void expect_packing(double mu, double duration, double solid_fraction, double fraction_error, double z,
                      double z_error) {
    const fs::path c = make("packing", packing(500, mu, duration));
    run(c, {}, {"--threads", "1"});
    const output::Row last = output::read_series(series_of(c)).back();
    EXPECT_LT(last.unbalanced_force, 0.1);
    for (const double stress : {last.stress_x, last.stress_y, last.stress_z}) EXPECT_NEAR(stress, 1e4, 1e3);
    EXPECT_NEAR(1 - last.porosity, solid_fraction, fraction_error);
    EXPECT_NEAR(coordination(output::read_checkpoint(checkpoint_of(c)).state, mu > 0 ? 2 : 4), z, z_error);
  }
};

// Agnolin & Roux (2007) have 0.639 and 6.0, 0.593 and 4.5 for rigid grains in a box without end, and so does
// bench/packing, which extrapolates. Its packings of 500 grains at 10 kPa are looser by 0.0045 without
// friction, and have 0.05 and 0.13 contacts more; they scatter by 0.0021 and 0.0029, and by 0.09 and 0.04
// contacts. Three times that is allowed.
TEST_F(Press, FrictionlessSpheresPackAsKnown) { expect_packing(0, 1.4, 0.639 - 0.0045, 0.0063, 6.05, 0.27); }
TEST_F(Press, SpheresWithFrictionPackAsKnown) { expect_packing(0.3, 0.3, 0.593, 0.0087, 4.63, 0.12); }

// The work of the sides is pressure times the loss of volume; the account closes.
TEST_F(Press, TheWorkOfTheSides) {
  const std::string text = packing(300, 0.3, 0.3);
  const auto press = text.find("[[stage]]\nname = \"press\""), output = text.find("[output]");
  std::string more = text.substr(press, output - press);
  for (const auto& [old, now] : {std::pair{"\"press\"", "\"more\""}, {"10 kPa", "40 kPa"}})
    more.replace(more.find(old), std::string(old).size(), now);
  const fs::path c = make("packing", text.substr(0, output) + more + text.substr(output));
  run(c, {"stage.more.strain_rate=0.01", "stage.more.duration=0.15", "output.series_interval=1e-4"});
  const auto rows = output::read_series(series_of(c));
  double work = 0;
  for (std::size_t k = 1; k < rows.size(); ++k) {
    const output::Row &a = rows[k - 1], &b = rows[k];
    if (a.stage != 2) continue;
    const double pressure = (a.stress_x + a.stress_y + a.stress_z + b.stress_x + b.stress_y + b.stress_z) / 6;
    work += pressure * (a.side_x * a.side_y * a.side_z - b.side_x * b.side_y * b.side_z);
  }
  EXPECT_NEAR(rows.back().stress_x, 4e4, 1e3);
  EXPECT_NEAR(work, rows.back().top_wall_work, 0.02 * work);
  EXPECT_LT(std::abs(rows.back().residue), 0.01 * rows.back().top_wall_work);
  EXPECT_EQ(rows.back().height, rows.back().side_z);
}

TEST_F(Press, AGradedBedReachesItsPorosityWithTheSameBits) {
  const fs::path one = make("one", graded(0.47)), two = make("two", graded(0.47));
  ASSERT_NO_FATAL_FAILURE(run(one, {}, {"--threads", "1"}));
  const auto rows = output::read_series(series_of(one));
  EXPECT_NEAR(rows.back().porosity, 0.47, 1e-12);
  EXPECT_EQ(rows.back().side_x, rows.back().side_y);
  EXPECT_LT(std::abs(rows.back().residue), 0.01 * rows.back().top_wall_work);

  // The other one on two threads, cut off on the way.
  auto words = to_run(two);
  words.insert(words.end(), {"--threads", "2"});
  {
    const auto process = start(words);
    while (process->running() && !(fs::exists(two / "output/checkpoint.previous.h5"))) usleep(1000);
    process->send(SIGINT);
    EXPECT_EQ(process->wait(), 1) << "not cut off";
  }
  ASSERT_NO_FATAL_FAILURE(run(two, {}, {"--resume"}));
  expect_same_results(one, two);
}

// Kinetic energy is that of the mass that answers to forces, also across a jump of the sides.
TEST_F(Press, DensityScalingKeepsTheAccount) {
  const fs::path c = make("scaled", graded(0.45));
  run(c, {"model.density_scaling=0.004"});
  const output::Row last = output::read_series(series_of(c)).back();
  EXPECT_NEAR(last.porosity, 0.45, 1e-4);
  EXPECT_LT(std::abs(last.residue), 0.01 * last.top_wall_work);
}

// Also where the cut falls between two jumps of the sides, or on one.
TEST_F(Press, ACutStageEndsWithTheBitsOfTheUncutOne) {
  const std::string head = packing(300, 0.3, 0.01);
  const std::string stages = head.substr(head.find("[[stage]]\nname = \"press\""));
  const std::string press = stages.substr(0, stages.find("[output]"));
  for (const int steps : {900, 925}) {
    const double dt = 2e-5;
    const auto text = [&](std::vector<std::string> names, double duration) {
      std::string out = head.substr(0, head.find("[[stage]]\nname = \"press\""));
      for (const std::string& name : names) {
        std::string one = press;
        one.replace(one.find("\"press\""), 7, "\"" + name + "\"");
        one.replace(one.find("duration = 0.010000"), 19, "duration = " + std::to_string(duration));
        out += one;
      }
      return out + stages.substr(stages.find("[output]"));
    };
    const std::string n = std::to_string(steps);
    const fs::path whole = make("whole" + n, text({"a"}, 2 * steps * dt));
    const fs::path cut = make("cut" + n, text({"a", "b"}, steps * dt));
    for (const fs::path& c : {whole, cut})
      run(c, {"model.dt=2e-5", "stage.gas.porosity=0.74", "output.series_interval=1"});
    const dem::State a = output::read_checkpoint(checkpoint_of(whole)).state,
                     b = output::read_checkpoint(checkpoint_of(cut)).state;
    EXPECT_EQ(a.step, b.step);
    EXPECT_TRUE(a.x == b.x && a.v == b.v && a.omega == b.omega && a.force == b.force) << steps;
    EXPECT_EQ(output::read_checkpoint(checkpoint_of(whole)).scene.box,
              output::read_checkpoint(checkpoint_of(cut)).scene.box);
  }
}

// The loop of the GPU, there and on the host, ends with the bits of the CPU's.
TEST_F(Press, BothEnginesHaveTheSameBits) {
  std::vector<fs::path> both;
  for (const dem::Backend backend : both_engines()) {
    const fs::path c = make("engine" + std::to_string(both.size()), packing(150, 0.3, 0.04));
    run::Options options;
    options.directory = c, options.backend = backend, options.threads = 1, options.quiet = true;
    run::run_one(options, cases::load(c, {{"stage.gas.strain_rate", "3"}}));
    both.push_back(c);
  }
  for (const fs::path& other : both) expect_same_results(both[0], other);
}

// Under a wall: a uniaxial stage that ends at a porosity.
TEST_F(Press, AWallComesDownToAPorosity) {
  const std::string head = "stages = [\"settle\", \"down\"]\n" + small_case();
  const fs::path c = make("bed", head +
                                     "[[stage]]\nname = \"down\"\nkind = \"uniaxial\"\nstrain_rate = 0.5\n"
                                     "porosity = 0.4\nwall_gamma_n = 40\n");
  run(c);
  EXPECT_NEAR(output::read_series(series_of(c)).back().porosity, 0.4, 1e-3);  // to a step
  expect_error(to_run(c, {"stage.down.strain=0.1"}),
               {"stage.down.strain", "porosity and strain_rate say when"});
  expect_error(to_run(c, {"stage.down.strain_rate=-1"}), {"stage.down.strain_rate", "> 0 1/s"});
}

// A later case takes the box that a press has left.
TEST_F(Press, TheNextCaseHasTheBoxOfTheEnd) {
  const fs::path first = make("first", packing(300, 0, 0.005));
  ASSERT_NO_FATAL_FAILURE(run(first));
  const std::string next =
      "extends = \"../first\"\nstart = \"../first\"\nstages = [\"on\"]\n[[stage]]\nname = \"on\"\n"
      "kind = \"press\"\npressure = \"5 kPa\"\nstrain_rate = 1\nduration = 0.002\n";
  const fs::path second = make("second", next);
  ASSERT_NO_FATAL_FAILURE(run(second));
  EXPECT_EQ(output::read_series(series_of(first)).back().side_x,
            output::read_series(series_of(second)).front().side_x);
  expect_error(to_run(make("third", next), {"box.x=0.3"}), {"first", "box.x = 0.3", "expected 0"});
}

TEST_F(Press, SaysThatThePressureIsNotReached) {
  const fs::path c = make("press", packing(300, 0, 0.01));
  run(c);
  const std::string log = contents(c / "output/log.txt");
  EXPECT_NE(log.find("warning: stage press ends with "), std::string::npos) << log;
  EXPECT_NE(log.find(" Pa along x, y and z, not with pressure = 10000 Pa"), std::string::npos) << log;
}

TEST_F(Press, Errors) {
  const fs::path c = make("press", packing(300, 0, 0.1));
  const auto expect = [&](const std::vector<std::string>& overrides, const std::vector<std::string>& words) {
    expect_error(to_run(c, overrides), words);
  };
  expect({"box.periodic=xy"}, {"box.periodic", "expected xyz", "stage gas presses all sides"});
  expect({"model.gravity=9.81"}, {"model.gravity", "expected 0 m/s2"});
  expect({"stage.press.porosity=0.4"}, {"stage.press.pressure", "either porosity or pressure"});
  expect({"stage.press.pressure=0"}, {"stage.press.porosity", "either porosity or pressure"});
  expect({"stage.press.duration=0"}, {"stage.press.duration", "expected a duration > 0 s"});
  expect({"stage.gas.duration=1"}, {"stage.gas.duration", "porosity and strain_rate say when"});
  expect({"stage.press.strain_rate=0"}, {"stage.press.strain_rate", "> 0 1/s"});
  expect({"stage.press.normal_stress=1e3"}, {"stage.press.normal_stress", "expected 0 Pa"});
  expect({"stage.gas.strain=0.1"}, {"stage.gas.strain", "none: it belongs to kind shear, uniaxial"});
  expect({"fluid.enabled=true"}, {"fluid", "z is periodic"});
  expect({"stage.gas.porosity=0.8"}, {"stage gas: porosity = 0.8", "0.75 already", "does not loosen"});
  expect({"grains.count=5", "stage.gas.porosity=0.5"},
         {"stage gas: at porosity = 0.5", "too narrow", "more grains"});
  expect(
      {"stage.gas.porosity=0.2", "stage.gas.strain_rate=10"},
      {"guards.max_overlap", "gas has pressed the grains to a porosity of 0.", "may not bear that of 0.2"});
  expect({"stage.gas.strain_rate=1e4"},
         {"stage gas: strain_rate = 10000 1/s shortens each side by", "in one jump", "expected at most"});
  expect({"stage.press.pressure=0", "stage.press.duration=0", "stage.press.porosity=0.6"},
         {"stage press: porosity = 0.6, where a stage before it presses to 0.55"});
}

}  // namespace
}  // namespace moraine
