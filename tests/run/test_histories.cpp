// Loads that change with time: against closed solutions, and as a case asks for them.
#include <cmath>
#include <functional>

#include "backends.hpp"
#include "physics/same_bits.hpp"
#include "physics/scenes.hpp"
#include "program.hpp"
#include "run/stages.hpp"

namespace moraine {
namespace {

using Between = History::Between;

// A wall of mass M on a layer of N grains, each a mass m between two springs k, floor and wall: two ways down
// u, of the grains and of the wall, with the matrix N k (2 -1; -1 1) and the masses N m and M. From rest
// under s(0).
struct WallOnGrains {
  static constexpr int grains = 9;
  static constexpr double k = 1e5, wall = 0.15, r = 0.01, start = 5000;  // N/m, kg, m, Pa

  dem::Scene scene;
  dem::State state;
  struct Mode {
    double w, share;  // rad/s; of what the wall gives way to a constant stress
  };
  Mode mode[2];

  WallOnGrains() {
    const double d = 2 * r;
    scene.box = {3 * d, 3 * d, 1};
    scene.gravity = 0;
    scene.contact.fill(dem::LinearContact{k, k, 0, 0, 0.3, 0.3});
    scene.body(dem::BodyId::top_wall) = dem::wall_pressed_by(start, wall);
    const double m = grains * dem::mass(scene, r), stiff = grains * k;
    const double mean = 0.5 * stiff * (2 / m + 1 / wall), product = stiff * stiff / (m * wall);
    for (const int j : {0, 1}) {
      const double w2 = mean + (j == 0 ? -1 : 1) * std::sqrt(mean * mean - product);
      const double grain = 1 - w2 * wall / stiff;  // way of the grains to that of the wall
      const double force = 1 / (m * grain * grain + wall);
      mode[j] = {std::sqrt(w2), force / w2 / (2 / stiff)};
    }
    scene.dt = 2 * std::numbers::pi / mode[1].w / 1000;
    std::vector<dem::Vec3d> x;
    for (int c = 0; c < grains; ++c)
      x.push_back({(c % 3 + 0.5) * d, (c / 3 + 0.5) * d, r - 0.5 * way_at_rest(start)});
    state = dem::grains_at_rest(std::vector<double>(x.size(), r), x);
    state.wall_z() = d - way_at_rest(start);
  }
  double way_at_rest(double stress) const { return 2 * stress * scene.area() / (grains * k); }  // m
  double period() const { return 1000 * scene.dt; }

  // The wall's way down, m: the answers to every jump and every change of slope, one on top of the other.
  double way(const History& h, double t) const {
    double stress = h.at(t);
    for (std::size_t n = 0; n < h.time.size() && h.time[n] < t; ++n)
      for (const auto& [w, share] : mode) {
        const double since = t - h.time[n];
        if (h.between == Between::steps) {
          if (n > 0) stress -= share * (h.value[n] - h.value[n - 1]) * std::cos(w * since);
          continue;
        }
        const auto slope = [&](std::size_t k) {
          return (h.value[k + 1] - h.value[k]) / (h.time[k + 1] - h.time[k]);
        };
        const double after = n + 1 < h.time.size() ? slope(n) : 0, before = n > 0 ? slope(n - 1) : 0;
        stress -= share * (after - before) * std::sin(w * since) / w;
      }
    return way_at_rest(stress);
  }
};

class WallUnder : public OnEveryBackend {};

TEST_P(WallUnder, RampStepsAndTable) {
  const WallOnGrains bed;
  const double T = bed.period(), half = 0.5 * bed.scene.dt;  // a jump halfway between two steps has no error
  History ramp{Between::linear, true, {0, 0.7 * T}, {5000, 9000}},
      steps{Between::steps, true, {0, 0.3 * T + half, 1.1 * T + half}, {5000, 8000, 6000}}, table;
  for (int n = 0; n <= 300; ++n)  // every ten steps, and not at steps
    table.time.push_back(0.0101 * T * n), table.value.push_back(5000 + 1500 * std::sin(0.05 * n * n * 0.02));
  const auto engine = make();
  for (const History& h : {ramp, steps, table}) {
    dem::Scene scene = bed.scene;
    run::set_pieces(scene, {.normal_stress = h}, 0);
    engine->load(scene, bed.state);
    const double before = dem::observe(scene, engine->state()).energy.total();
    double worst = 0;
    for (std::int64_t step = 0; step < 3000; step += 37) {
      run::advance(*engine, scene, {.normal_stress = h}, step, step + 37);
      const dem::State now = engine->state();
      const double t = scene.time(now.step), way = 2 * bed.r - now.wall_z();
      worst = std::max(worst, std::abs(way - bed.way(h, t)));
      // The ledger's residue is the kinetic energy that leapfrog's mean leaves out: (w dt)^2/8 of it.
      EXPECT_NEAR(dem::observe(scene, now).energy.total() - before, now.ledger.planes,
                  1e-4 * bed.way_at_rest(4000) * 9000 * scene.area());
    }
    // Leapfrog swings faster by (w dt)^2/24: 3e-5 of the swing after three periods.
    EXPECT_LT(worst, 1e-4 * bed.way_at_rest(4000));
  }
}
ON_EVERY_BACKEND(WallUnder);

// A history does not notice where a run stops to look.
TEST(Pieces, BeginAtTheFirstStepNotBeforeTheirTime) {
  WallOnGrains bed;
  dem::Scene& s = bed.scene;
  s.dt = 0.1;
  const History h{Between::steps, true, {0, 0.3, 0.65}, {1, 2, 3}};
  const auto stress_at = [&](std::int64_t step) {
    run::set_pieces(s, {.normal_stress = h}, step);
    return s.body(dem::BodyId::top_wall).z.stress(s.time(step));
  };
  EXPECT_EQ(run::next_pieces(s, {.normal_stress = h}, 0), 3);  // 3 * 0.1 is above 0.3
  EXPECT_EQ(run::next_pieces(s, {.normal_stress = h}, 3), 7);
  EXPECT_GT(run::next_pieces(s, {.normal_stress = h}, 7), std::int64_t{1} << 60);
  EXPECT_EQ(stress_at(2), 1);
  EXPECT_EQ(stress_at(3), 2);
  EXPECT_EQ(stress_at(6), 2);
  EXPECT_EQ(stress_at(7), 3);
}

// What a layer gives and takes where its velocity jumps is in the ledger, though the step changes just there,
// as dt = "auto" has it where a record falls on a jump.
class LayerUnder : public OnEveryBackend {};
TEST_P(LayerUnder, JumpsWhereTheStepChanges) {
  dem::Scene scene;
  scene.box = {1, 1, 1}, scene.gravity = 0, scene.dt = 0.01;
  scene.body(dem::BodyId::bottom_layer) = dem::layer({}, true);
  scene.body(dem::BodyId::top_layer) = dem::layer(dem::Drive::at(0), true);
  dem::State state =
      dem::grains_at_rest({0.1, 0.1, 0.1}, {{0.2, 0.2, 0.5}, {0.7, 0.2, 0.5}, {0.5, 0.7, 0.2}});
  state.part_of = {dem::BodyId::top_layer, dem::BodyId::top_layer, dem::BodyId::bottom_layer};
  const Histories histories{.velocity = {Between::steps, true, {0, 0.5, 1, 1.5}, {1, 0, -1, 2}}};
  run::set_pieces(scene, histories, 0);
  const auto engine = make();
  engine->load(scene, state);
  state = engine->state();
  const double first = dem::observe(scene, state).energy.total();
  for (const double dt : {0.005, 0.02, 0.01}) {  // each from the jump after the next half second
    const auto steps = static_cast<std::int64_t>(std::lround(0.5 / scene.dt));
    run::advance(*engine, scene, histories, state.step, state.step + steps);
    state = engine->state();
    dem::change_step(scene, state, dt);
    engine->load(scene, state);
    run::advance(*engine, scene, histories, state.step, state.step + 1);
    const dem::State after = engine->state();
    EXPECT_NEAR(dem::observe(scene, after).energy.total() - first, after.ledger.layers, 1e-12 * first);
    engine->load(scene, state);
  }
}
ON_EVERY_BACKEND(LayerUnder);

class LoadTables : public Program {
 protected:
  // The small bed, consolidated and sheared by tables.
  fs::path loaded(const std::string& name, const std::string& stresses, const std::string& velocities) const {
    directory.write(name + "/stress.csv", stresses), directory.write(name + "/velocity.csv", velocities);
    return make(name, small_case() +
                          "\n[[stage]]\nname = \"pulses\"\nkind = \"shear\"\nduration = 0.1\n"
                          "normal_stress = { table = \"stress.csv\" }\n"
                          "velocity = { table = \"velocity.csv\", interpolation = \"linear\" }\n");
  }
  std::vector<output::Row> last_rows(const fs::path& run) const {
    std::vector<output::Row> rows = output::read_series(series_of(run));
    std::erase_if(rows, [&](const output::Row& r) { return r.stage != 3; });
    return rows;
  }
};

// What was asked for stands in the series; made a table again, it asks for the same.
TEST_F(LoadTables, AreReadBackFromTheSeries) {
  const std::string asked_stress = "time (ms), value (kPa)\n0, 2\n40, 3\n100, 1.5\n",
                    asked_velocity = "# cm\ntime, value (cm/s)\n0, 0\n0.05, 20\n0.1, -10\n";
  const fs::path first = loaded("first", asked_stress, asked_velocity);
  ASSERT_NO_FATAL_FAILURE(run(first));
  const History stress{Between::linear, false, {0, 0.04, 0.1}, {2000, 3000, 1500}},
      velocity{Between::linear, false, {0, 0.05, 0.1}, {0, 0.2, -0.1}};
  std::string stresses = "time, value\n", velocities = stresses;
  const std::vector<output::Row> rows = last_rows(first);
  ASSERT_GT(rows.size(), 9u);
  const auto line = [](double t, double value) {
    char text[80];
    std::snprintf(text, sizeof text, "%.17g, %.17g\n", t, value);
    return std::string(text);
  };
  for (const output::Row& r : rows) {
    EXPECT_NEAR(r.asked_normal_stress, stress.at(r.stage_time), 1e-9);
    EXPECT_NEAR(r.asked_velocity, velocity.at(r.stage_time), 1e-13);
    stresses += line(r.stage_time, r.asked_normal_stress);
    velocities += line(r.stage_time, r.asked_velocity);
  }
  // The last row is at most half a step before the end.
  stresses += line(0.11, rows.back().asked_normal_stress),
      velocities += line(0.11, rows.back().asked_velocity);
  const fs::path second = loaded("second", stresses, velocities);
  ASSERT_NO_FATAL_FAILURE(run(second));
  const std::vector<output::Row> again = last_rows(second);
  ASSERT_EQ(again.size(), rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    EXPECT_NEAR(again[k].asked_normal_stress, rows[k].asked_normal_stress, 1e-9);
    EXPECT_NEAR(again[k].asked_velocity, rows[k].asked_velocity, 1e-13);
  }
}

// Pieces reach every engine at the same steps, and wherever one stops.
TEST_F(LoadTables, SameBitsOnAnyThreadsAndBackend) {
  const auto pulses = [&](const std::string& name) {
    return loaded(name, "time, value\n0, 2000\n0.033, 1000\n0.07, 3000\n0.1, 2500\n",
                  "time, value\n0, 0.1\n0.02, -0.2\n0.05, 0.3\n0.1, 0\n");
  };
  const std::vector<std::string> uneven{"stage.pulses.profile=cosine", "stage.pulses.velocity_amplitude=0.05",
                                        "stage.pulses.velocity_frequency=50"};
  const fs::path one = pulses("one"), other = pulses("other");
  ASSERT_NO_FATAL_FAILURE(run(one, uneven, {"--threads", "1"}));
  ASSERT_NO_FATAL_FAILURE(run(other, uneven, {"--threads", "2"}));
  expect_same_results(one, other);

  std::vector<cases::Override> overrides{{"start", "."}, {"stages", "[\"pulses\"]"}};
  for (const std::string& set : uneven) {
    const auto equals = set.find('=');
    overrides.push_back({set.substr(0, equals), set.substr(equals + 1)});
  }
  overrides.push_back({"stage.pulses.zero_kinematics", "true"});
  const cases::Case c = cases::load(one, overrides);
  const run::Start start = run::start_of(c);
  const auto after = [&](dem::Backend backend, std::int64_t at_once) {
    output::Checkpoint now = start.before;
    run::Stage stage = run::prepare(c, 0, start, now);
    const auto engine = dem::make_engine(backend, 1);
    engine->load(stage.scene, now.state);
    for (std::int64_t step = 0; step < 600; step += at_once)
      run::advance(*engine, stage.scene, stage.histories, step, step + at_once);
    return engine->state();
  };
  const dem::State by_pairs = after(dem::Backend::cpu, 600);
  dem::expect_same_bits(after(dem::Backend::cpu, 1), by_pairs);
  dem::expect_same_bits(after(dem::Backend::reference, 100), by_pairs);
}

// A run that goes on refuses a table that is another by now; it knows the resolved case, which says the same.
TEST_F(LoadTables, ArePartOfTheCase) {
  const fs::path run_of =
      loaded("one", "time, value\n0, 2000\n0.2, 2000\n", "time, value\n0, 0.1\n0.2, 0.1\n");
  ASSERT_NO_FATAL_FAILURE(run(run_of));
  fs::create_directories(directory.path() / "again");
  fs::copy(run_of / "stress.csv", directory.path() / "again"),
      fs::copy(run_of / "velocity.csv", directory.path() / "again");
  fs::copy_file(run_of / "output/case.toml", directory.path() / "again/case.toml");
  const fs::path again = directory.path() / "again";
  ASSERT_NO_FATAL_FAILURE(run(again));
  expect_same_results(run_of, again);
  directory.write("one/stress.csv", "time, value\n0, 2000\n0.2, 2001\n");
  auto resume = to_run(run_of);
  resume.push_back("--resume");
  expect_error(resume, {"another", "stress.csv", "has changed since"});
}

}  // namespace
}  // namespace moraine
