// A run that goes wrong stops in time and says where; a healthy one is left alone.
#include <cmath>
#include <limits>

#include "dem/packing.hpp"
#include "error.hpp"
#include "program.hpp"
#include "run/guard.hpp"

namespace moraine {
namespace {

constexpr double r = 0.01, k = 1e5, density = 2600;
const double m = dem::sphere_mass(density, r);

class Guards : public Program {
 protected:
  // A case of grains of radius r in a box 0.1 m wide without gravity, from a start file of its own.
  fs::path grains(const std::vector<dem::Vec3d>& x, const std::vector<dem::Vec3d>& v, const std::string& more,
                  double wall_z = 0) const {
    output::Checkpoint c;
    c.finished = true;
    c.scene.box = {0.1, 0.1, 0};
    c.state = dem::grains_at_rest(std::vector<double>(x.size(), r), x);
    c.state.v = v;
    c.state.wall_z() = wall_z;
    const fs::path made = make("grains", R"(
start = "start.h5"
[contact]
k_n = 1e5
k_t = 1e5
[output]
series_interval = 100
[model]
gravity = 0
)" + more);
    output::write_checkpoint(made / "start.h5", c);
    return made;
  }
  static std::string settle(const std::string& more = "") {
    return "[[stage]]\nname = \"fly\"\nkind = \"settle\"\nduration = 0.5\nzero_kinematics = false\n"
           "wall_gamma_n = 0\nwall_gamma_t = 0\n" +
           more;
  }
  // The step that the last error named.
  std::int64_t step_named() const {
    const std::string said = contents(directory.path() / "err");
    return std::stoll(said.substr(said.find(" at step ") + 9));
  }
};

// The floor is soft: the grain is 0.2 r deep after 0.3 r of flight and sinking, all but unhindered.
TEST_F(Guards, OverlapWithTheFloor) {
  const double speed = 20, dt = 1e-6;
  for (const int interval : {1, 7, 10}) {
    const fs::path made = grains({{0.05, 0.05, 1.1 * r}}, {{0, 0, -speed}}, "dt = 1e-6\n" + settle());
    expect_error(to_run(made, {"guards.interval=" + std::to_string(interval)}),
                 {"grain 0 at step ", "of stage fly", "position (0.05, 0.05, 0.00", "velocity (", "the floor",
                  "of the smaller radius", "guards.max_overlap = 0.2", "contact.k_n"});
    // Depth of a spring hit at t_0: speed/omega sin(omega (t - t_0)).
    const double omega = std::sqrt(k / m);
    const double deep = (0.1 * r / speed + std::asin(0.2 * r * omega / speed) / omega) / dt;
    EXPECT_GE(step_named(), deep);
    EXPECT_LE(step_named(), deep + interval + 1);
    fs::remove_all(made / "output");
  }
}

TEST_F(Guards, OverlapOfTwoGrainsNamesBoth) {
  const fs::path made = grains({{0.03, 0.05, 0.05}, {0.055, 0.05, 0.05}, {0.05, 0.02, 0.05}},
                               {{50, 0, 0}, {-50, 0, 0}, {0, 0, 0}}, "dt = 1e-6\n" + settle());
  expect_error(to_run(made, {"guards.interval=5"}),
               {"grain 0 at step ", "overlaps grain 1 at (", "expected at most guards.max_overlap"});
  EXPECT_LE(step_named(), (0.25 * r + 0.2 * r) / 50 / 1e-6);
}

TEST_F(Guards, DeepOverlapOfTheStart) {
  const fs::path made =
      grains({{0.001, 0.05, 0.05}, {0.05, 0.05, 0.05}, {0.0955, 0.05, 0.05}}, {{}, {}, {}}, settle());
  for (const char* command : {"run", "check"})
    expect_error({command, made.string()}, {"grains/start.h5: grain 0 at (0.001, 0.05, 0.05) m",
                                            "overlaps grain 2 at (0.0955, 0.05, 0.05) m by 0.0145 m",
                                            "1.45 of the smaller radius", "guards.max_overlap"});
  EXPECT_FALSE(fs::exists(made / "output"));
}

// A grain that swings on the floor without leaving it: unstable beyond 2 sqrt(m/k).
TEST_F(Guards, EnergyCreated) {
  const double limit = 2 * std::sqrt(m / k), sunk = m * 9.80665 / k;
  const auto swing = [&](double of_limit, const std::string& ledger) {
    const fs::path made = grains({{0.05, 0.05, r - 0.9 * sunk}}, {{}},
                                 "dt = " + std::to_string(of_limit * limit) + "\n" + settle());
    auto words = to_run(made, {"model.gravity=9.80665", "model.ledger=" + ledger, "guards.interval=1"});
    words.push_back("--force");
    return words;
  };
  for (const char* ledger : {"true", "false"}) {
    const Outcome good = moraine(swing(0.95, ledger));
    EXPECT_EQ(good.status, 0) << good.err;
    expect_error(swing(1.05, ledger), {"grain 0 at step ", "of stage fly", "J were created",
                                       "guards.max_residue = 0.1", "smaller model.f"});
    EXPECT_LT(step_named(), 100);
    EXPECT_NE(contents(directory.path() / "grains/output/log.txt").find("warning: stage fly: the step of "),
              std::string::npos);
  }
}

// Two grains that begin at rest, pressed together: kinetic energy, v(n-1/2).v(n+1/2), begins below zero, and
// in an unstable step by more than the springs hold.
TEST_F(Guards, EnergyIsMeasuredByWhatIsThere) {
  const double limit = std::sqrt(2 * m / k), deep = 0.1 * r;
  const auto jump = [&](double of_limit, const std::string& ledger) {
    const fs::path made =
        grains({{0.05 - 0.5 * (2 * r - deep), 0.05, 0.05}, {0.05 + 0.5 * (2 * r - deep), 0.05, 0.05}},
               {{}, {}}, "dt = " + std::to_string(of_limit * limit) + "\n" + settle());
    auto words = to_run(made, {"model.ledger=" + ledger, "guards.interval=1", "contact.mu_s=0"});
    words.push_back("--force");
    return words;
  };
  for (const char* ledger : {"true", "false"}) {
    const Outcome good = moraine(jump(0.1, ledger));
    EXPECT_EQ(good.status, 0) << good.err;
    expect_error(jump(1.05, ledger), {"J were created, ", " J stored and put in"});
    const std::string said = contents(directory.path() / "err");
    const double had = std::stod(said.substr(said.find(" of the ") + 8));
    EXPECT_NEAR(had, 0.5 * k * deep * deep, 1e-6 * k * deep * deep) << said;
  }
}

// Damping that pushes balances in the ledger, which books a negative dissipation.
TEST_F(Guards, DampingOfALightWall) {
  const fs::path made = grains({{0.05, 0.05, 0.999 * r}}, {{}}, R"(dt = 1e-5
[wall]
mass = 1e-4
[[stage]]
name = "load"
kind = "consolidate"
normal_stress = 100
duration = 1
wall_gamma_n = 30
wall_gamma_t = 0
)",
                               1.998 * r);
  expect_error(to_run(made, {"guards.interval=20"}), {"grain 0 at step ", "of stage load", "J were created"});
  const std::string log = contents(made / "output/log.txt");
  for (const char* word :
       {"warning: stage load: wall_gamma_n = 30", "top wall (0.0001 kg)", "heavier wall.mass"})
    EXPECT_NE(log.find(word), std::string::npos) << log;
}

TEST_F(Guards, UnstableDampingIsRefused) {
  const fs::path small = make("small", small_case());
  for (const char* command : {"run", "check"})
    expect_error({command, small.string(), "--set", "stage.settle.wall_gamma_n=1e4"},
                 {"stage settle: wall_gamma_n = 10000 N s/m", "unstable", "expected at most", "model.f"});
  expect_error(to_run(small, {"stage.shear.gamma_t=400"}), {"stage shear: gamma_t = 400", "unstable"});
  EXPECT_FALSE(fs::exists(small / "output"));
}

TEST_F(Guards, CheckWarns) {
  const fs::path small = make("small", small_case());
  const auto check = [&](const std::string& set) {
    const Outcome o = moraine({"check", small.string(), "--backend", "cpu", "--set", set, "--set",
                               "stage.consolidate.wall_gamma_n=0"});
    EXPECT_EQ(o.status, 0) << o.err;
    return o.out;
  };
  EXPECT_EQ(check("model.f=0.05").find("warning"), std::string::npos);
  EXPECT_NE(check("stage.shear.f=0.8").find("warning: stage shear: the step of "), std::string::npos);
  const Outcome rolling = moraine({"check", small.string(), "--backend", "cpu", "--set", "model.dt=1e-5",
                                   "--set", "contact.mu_roll=0.3", "--set", "contact.k_roll=1e12"});
  EXPECT_NE(rolling.out.find("for motion rolling of two grains"), std::string::npos) << rolling.out;
  EXPECT_NE(check("model.slope=0.1").find("warning: stage settle: nothing holds the bed"), std::string::npos);
  // The driven layer moves at 1 1/s times the height of the lattice.
  EXPECT_NE(
      check("model.neighbour_margin=1e-5").find("warning: stage shear: model.neighbour_margin = 1e-05 m"),
      std::string::npos);
}

TEST_F(Guards, HealthyRunKeepsItsBits) {
  const fs::path a = make("a", small_case()), b = make("b", small_case());
  run(a, {"guards.interval=1000000", "guards.max_residue=1e9", "guards.max_overlap=1e9"});
  run(b, {"guards.interval=7"});
  expect_same_results(a, b);
}

TEST(Guard, NumbersThatAreNotFinite) {
  run::Stage stage{};
  stage.name = "one";
  stage.scene.dt = 1e-5;
  stage.scene.body(dem::BodyId::top_wall) = dem::top_wall();
  dem::State good = dem::grains_at_rest({r, r}, {{0.03, 0.03, 0.02}, {0.07, 0.07, 0.02}});
  good.id = {5, 3};
  good.wall_z() = 0.1;
  const auto check = [&](const dem::State& s) {
    try {
      run::Guard({10, 0.2, 0.1}, stage, {output::Row{}}, {}).check(s);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(check(good).find("finite"), std::string::npos);
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  dem::State bad = good;
  bad.force[1].y = nan;
  EXPECT_NE(check(bad).find("grain 3 at step 0 (t = 0 s) of stage one, position (0.07"), std::string::npos);
  bad = good, bad.rotation[0].z = infinity;
  EXPECT_NE(check(bad).find("grain 5 at step 0"), std::string::npos);
  bad = good, bad.at(dem::BodyId::top_wall).v.z = nan;
  EXPECT_NE(check(bad).find("a wall or the driven layer at step 0"), std::string::npos);
  bad = good, bad.wall_z() = -1;
  EXPECT_NE(check(bad).find("fell through the floor"), std::string::npos);
}

// Whatever the first row holds, the message counts in energy that is there.
TEST(Guard, EnergyWhereNoneIsStored) {
  run::Stage stage{};
  stage.name = "one";
  stage.scene.dt = 1e-5, stage.scene.gravity = 0;
  const dem::State rest = dem::grains_at_rest({r, r}, {{0.03, 0.03, 0.02}, {0.07, 0.07, 0.02}});
  dem::State moving = rest;
  moving.v[1] = {1, 0, 0};
  const auto check = [&](const dem::State& s, const output::Row& first) {
    try {
      output::StageStart start;
      start.energy = first.kinetic + first.rotational + first.elastic_normal + first.elastic_tangential +
                     first.wall_kinetic + first.potential;
      run::Guard({10, 0.2, 0.1}, stage, {first}, start).check(s);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("healthy");
  };
  EXPECT_EQ(check(rest, {}), "healthy");
  output::Row first{};
  EXPECT_NE(check(moving, first).find("J were created where none was stored or put in"), std::string::npos)
      << check(moving, first);
  for (double output::Row::*part :
       {&output::Row::kinetic, &output::Row::rotational, &output::Row::wall_kinetic}) {
    first = {}, first.*part = -0.0058;
    EXPECT_EQ(check(moving, first).find("-0.0058"), std::string::npos) << check(moving, first);
    first.potential = 1;  // now gone, which is put in
    EXPECT_NE(check(rest, first).find("J were lost, "), std::string::npos) << check(rest, first);
    EXPECT_NE(check(rest, first).find(" of the 1"), std::string::npos) << check(rest, first);
  }
  moving.v[1] = {1e160, 0, 0};
  EXPECT_NE(check(moving, {}).find("the energy grew beyond all numbers"), std::string::npos)
      << check(moving, {});
}

}  // namespace
}  // namespace moraine
