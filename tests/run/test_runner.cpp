// A run that is stepped, read and steered from outside: the bits of one that goes to its end in one go, and
// loads that change on the way, which come again after a break and in a replay.
#include <functional>

#include "error.hpp"
#include "program.hpp"
#include "run/runner.hpp"

namespace moraine {
namespace {

class Steered : public Program {
 protected:
  static run::Options options(const fs::path& which) {
    run::Options o;
    o.directory = which, o.backend = dem::Backend::cpu, o.threads = 1, o.quiet = true;
    return o;
  }
  static run::Options resumed(const fs::path& which) {
    run::Options o = options(which);
    o.resume = true;
    return o;
  }
  // A bed that shears in pore water between a drained top and a bottom at a pressure.
  static std::string wet_case() {
    std::string text = small_case();
    const std::string shear = "kind = \"shear\"";
    text.insert(text.find(shear) + shear.size(),
                "\nfluid = true\nfluid_top = \"drained\"\nfluid_bottom = \"pressure\"");
    return "[fluid]\npermeability_factor = 1e-8\nexchange_interval = 3\n" +
           replaced(text, "f = 0.2", "f = 0.03");
  }
  static std::string replaced(std::string text, const std::string& old, const std::string& now) {
    return text.replace(text.find(old), old.size(), now);
  }
  // Shear at a velocity for a while, which may change; and checkpoints when they are asked for.
  static std::string by_velocity(const std::string& text) {
    return replaced(replaced(text, "strain = 0.2", "duration = 0.8"), "0.02 s", "1000 s");
  }
  static std::string with_auto_dt(const std::string& text) {
    return replaced(text, "f = 0.2", "dt = \"auto\"");
  }
};

std::string error_of(auto&& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}
void expect_says(const std::string& text, std::initializer_list<const char*> words) {
  for (const char* word : words)
    EXPECT_NE(text.find(word), std::string::npos) << "no \"" << word << "\" in: " << text;
}

TEST_F(Steered, StepsGiveTheBitsOfOneGo) {
  for (const std::string& text : {small_case(), wet_case(), with_auto_dt(small_case())}) {
    const fs::path whole = make("whole", text), stepped = make("stepped", text);
    run(whole, {}, {"--threads", "1"});
    {
      run::Runner runner(options(stepped), cases::load(stepped));
      for (std::int64_t k = 1; !runner.finished(); ++k) {
        const std::size_t stage = runner.stage_index();
        const std::int64_t before = runner.done(), done = runner.step(k % 700);
        if (runner.stage_index() == stage) {
          EXPECT_EQ(runner.done(), before + done);
        }
        EXPECT_EQ(runner.state().step, runner.step_number());
      }
      EXPECT_EQ(runner.step(10), 0) << "beyond the end";
    }
    expect_same_results(whole, stepped);
    fs::remove_all(whole), fs::remove_all(stepped);
  }
}

// Without contacts, the same grains.
TEST_F(Steered, GrainsAreThoseOfTheState) {
  for (const dem::Backend backend : {dem::Backend::cpu, dem::Backend::reference}) {
    const fs::path bed = make("bed", small_case());
    run::Options o = options(bed);
    o.backend = backend;
    o.force = true;
    run::Runner runner(o, cases::load(bed));
    while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
    runner.step(321);
    dem::State all = runner.state();
    const dem::State grains = runner.grains();
    EXPECT_FALSE(all.contacts.empty());
    EXPECT_TRUE(grains.contacts.empty() && grains.wall_contacts.empty());
    EXPECT_TRUE(grains.id == all.id && grains.r == all.r && grains.part_of == all.part_of);
    EXPECT_TRUE(grains.x == all.x && grains.v == all.v && grains.omega == all.omega &&
                grains.force == all.force);
    EXPECT_EQ(grains.wall_z(), all.wall_z());
    EXPECT_EQ(grains.ledger.slip, all.ledger.slip);
  }
}

// The normal stress and the velocity of a bed that shears, twice each.
void steer(run::Runner& runner) {
  const std::size_t shear = 2;
  const std::pair<std::int64_t, std::function<void()>> changes[] = {
      {500, [&] { runner.set("normal_stress", 4000); }},
      {1300, [&] { runner.set("velocity", 0.02); }},
      {2100, [&] { runner.set("normal_stress", 1000); }},
      {2100, [&] { runner.set("velocity", -0.03); }},
  };
  while (runner.stage_index() < shear || (runner.stage_index() == shear && runner.stage_ended()))
    runner.step(100000), runner.begin_stage();
  for (const auto& [at, change] : changes)
    if (runner.done() <= at) {
      runner.step(at - runner.done());
      change();
    }
}

TEST_F(Steered, ALoadThatIsChangedDrivesTheBedFromThere) {
  const fs::path bed = make("bed", by_velocity(small_case()));
  run::Runner runner(options(bed), cases::load(bed));
  steer(runner);
  runner.finish();
  double stress = 0, count = 0;
  for (const output::Row& row : runner.rows())
    if (row.stage == 2 && row.step > 3000) {
      stress += row.normal_stress, ++count;
      EXPECT_EQ(row.asked_normal_stress, 1000);
      EXPECT_EQ(row.asked_velocity, -0.03);
    }
  ASSERT_GT(count, 3);
  EXPECT_NEAR(stress / count, 1000, 400);
  EXPECT_EQ(runner.events().size(), 4u);
  // The rows in the file, too, with columns for what was asked.
  EXPECT_EQ(output::read_series(series_of(bed)).back().asked_normal_stress, 1000);
  const std::string lines = contents(bed / "output/events.csv");
  EXPECT_EQ(lines,
            "stage,step,key,value\n3,500,normal_stress,4000.0\n3,1300,velocity,0.02\n"
            "3,2100,normal_stress,1000.0\n3,2100,velocity,-0.03\n");
  expect_says(contents(bed / "output/log.txt"), {"event: stage shear, step 500: normal_stress = 4000.0 Pa"});
}

// Cut off wherever it may be, also between a checkpoint and a change that came after it.
TEST_F(Steered, EventsComeAgainAfterABreakAndInAReplay) {
  for (const bool auto_dt : {false, true}) {
    const std::string text = by_velocity(auto_dt ? with_auto_dt(small_case()) : small_case());
    const fs::path whole = make("whole", text), cut = make("cut", text);
    {
      run::Runner runner(options(whole), cases::load(whole));
      steer(runner);
      runner.finish();
    }
    {
      run::Runner runner(options(cut), cases::load(cut));
      while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
      runner.checkpoint();
      steer(runner);  // goes on without a further checkpoint, and is lost
    }
    EXPECT_EQ(output::read_checkpoint(checkpoint_of(cut)).events.size(), 0u);
    {
      run::Runner runner(resumed(cut), cases::load(cut));
      while (runner.done() < 1700) runner.step(60);
      runner.checkpoint();
      runner.step(600);  // beyond the last two events
    }
    EXPECT_EQ(output::read_checkpoint(checkpoint_of(cut)).events.size(), 2u);
    std::ofstream(cut / "output/events.csv", std::ios::app) << "3,22";  // as a kill may leave it
    run(cut, {}, {"--resume", "--threads", "1"});
    expect_same_results(whole, cut);
    const Outcome replay = moraine({"replay", cut.string(), "--quiet", "--threads", "2"});
    EXPECT_EQ(replay.status, 0) << replay.err;
    expect_says(replay.out, {"the same bits", "4 events"});
    expect_same_results(whole, cut / "replay");
    fs::remove_all(whole), fs::remove_all(cut);
  }
}

// A checkpoint of the very step at which a load then changes, as the clock may ask for one.
TEST_F(Steered, ACheckpointJustBeforeAChange) {
  for (const std::string& text : {by_velocity(small_case()), by_velocity(wet_case())}) {
    const fs::path whole = make("whole", text), cut = make("cut", text);
    {
      run::Runner runner(options(whole), cases::load(whole));
      while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
      runner.step(600), runner.set("normal_stress", 5000);
      runner.step(600), runner.set("velocity", 0.05);
      runner.finish();
    }
    {
      run::Runner runner(options(cut), cases::load(cut));
      while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
      runner.step(600), runner.checkpoint(), runner.set("normal_stress", 5000);
      runner.step(100);
    }
    {
      run::Runner runner(resumed(cut), cases::load(cut));
      runner.step(1200 - runner.done()), runner.checkpoint(), runner.set("velocity", 0.05);
    }
    run(cut, {}, {"--resume", "--threads", "1"});
    expect_same_results(whole, cut);
    fs::remove_all(whole), fs::remove_all(cut);
  }
}

TEST_F(Steered, WaterToo) {
  const fs::path whole = make("whole", wet_case()), cut = make("cut", wet_case());
  const auto change = [](run::Runner& runner) {
    while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
    runner.step(500);
    EXPECT_EQ(runner.done() % 3, 0) << "not at an exchange";
    runner.set("top_pressure", 300);
    runner.step(500);
    runner.set("bottom_pressure", 500), runner.set("normal_stress", 3000);
  };
  {
    run::Runner runner(options(whole), cases::load(whole));
    change(runner);
    const auto pressure = [&] { return runner.water()->pressure.front(); };
    const double before = pressure();
    runner.step(200);
    EXPECT_GT(pressure(), before + 50);
    runner.finish();
  }
  {
    run::Runner runner(options(cut), cases::load(cut));
    change(runner);
    runner.step(90);
    runner.checkpoint();
  }
  run(cut, {}, {"--resume", "--threads", "1"});
  expect_same_results(whole, cut);
  EXPECT_EQ(moraine({"replay", cut.string(), "--quiet"}).status, 0);
}

TEST_F(Steered, WhatIsNotFinishedIsReplayedAsFarAsItCame) {
  const fs::path bed = make("bed", by_velocity(small_case()));
  {
    run::Runner runner(options(bed), cases::load(bed));
    steer(runner);
    runner.step(77);
    runner.checkpoint();
  }
  expect_says(moraine({"replay", bed.string(), "--quiet"}).out, {"the same bits", "4 events"});
  expect_error({"replay", bed.string(), "--quiet"}, {"replay/output", "--force"});
  // Not the same: a line of the events was changed.
  output::Checkpoint c = output::read_checkpoint(checkpoint_of(bed));
  c.events[1].value *= 1.001;
  output::write_checkpoint(checkpoint_of(bed), c);
  expect_error({"replay", bed.string(), "--quiet", "--force"}, {"differ", "from stage 3", "same bits"});
}

// Less far than the stages before it are long.
TEST_F(Steered, SoIsAStageThatHasJustBegun) {
  const fs::path bed = make("bed", by_velocity(small_case()));
  {
    run::Runner runner(options(bed), cases::load(bed));
    while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
    runner.step(100), runner.set("normal_stress", 3000), runner.step(200);
    runner.checkpoint();
  }
  const Outcome replay = moraine({"replay", bed.string(), "--quiet"});
  EXPECT_EQ(replay.status, 0) << replay.err;
}

TEST_F(Steered, WhatHasFinishedIsThereToBeRead) {
  for (const std::string& text : {small_case(), wet_case()}) {
    const fs::path bed = make("bed", text);
    run::Runner first(options(bed), cases::load(bed));
    first.finish();
    const fs::path copy = bed.parent_path() / "copy";
    fs::copy(bed, copy, fs::copy_options::recursive);
    const run::Runner again(resumed(copy), cases::load(copy));
    EXPECT_TRUE(again.was_finished() && again.stage_ended());
    EXPECT_EQ(again.stage().name, "shear");
    EXPECT_EQ(again.done(), first.done());
    EXPECT_EQ(again.steps(), first.steps());
    EXPECT_EQ(dem::loads_of(again.stage().scene, again.state()).contacts.size(),
              dem::loads_of(first.stage().scene, first.state()).contacts.size());
    ASSERT_EQ(again.water().has_value(), first.water().has_value());
    if (first.water()) {
      EXPECT_EQ(again.water()->pressure, first.water()->pressure);
    }
    fs::remove_all(bed), fs::remove_all(copy);
  }
}

// A run that has lost its checkpoints begins anew, with its events.
TEST_F(Steered, EventsOfARunWithoutCheckpoints) {
  const fs::path bed = make("bed", by_velocity(small_case()));
  {
    run::Runner runner(options(bed), cases::load(bed));
    steer(runner);
  }
  const std::string events = contents(bed / "output/events.csv");
  for (const char* name : {"checkpoint.h5", "checkpoint.previous.h5", "series.h5"})
    fs::remove(bed / "output" / name);
  expect_says(error_of([&] { run::Runner(options(bed), cases::load(bed)); }), {"holds the results"});
  run::Runner again(resumed(bed), cases::load(bed));
  again.finish();
  EXPECT_EQ(again.events().size(), 4u);
  EXPECT_EQ(contents(bed / "output/events.csv"), events);
}

TEST_F(Steered, EventsThatAreDroppedDoNotCome) {
  const std::string text = by_velocity(small_case());
  const fs::path whole = make("whole", text), cut = make("cut", text);
  run(whole, {}, {"--threads", "1"});
  {
    run::Runner runner(options(cut), cases::load(cut));
    while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
    runner.checkpoint();
    steer(runner);
  }
  run::Options o = resumed(cut);
  o.drop_events = true;
  run::Runner(o, cases::load(cut)).finish();
  expect_same_results(whole, cut);
  EXPECT_EQ(contents(cut / "output/events.csv"), "stage,step,key,value\n");
}

TEST_F(Steered, NothingThatIsTheSameIsAnEvent) {
  const fs::path bed = make("bed", by_velocity(small_case()));
  run::Runner runner(options(bed), cases::load(bed));
  while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
  runner.set("normal_stress", 2000);
  EXPECT_TRUE(runner.events().empty());
  for (int k = 0; k < 3; ++k) runner.step(10), runner.set("normal_stress", 2500);
  EXPECT_EQ(runner.events().size(), 1u);
}

TEST_F(Steered, ErrorsThatNameTheirRemedy) {
  const fs::path bed = make("bed", small_case());
  run::Runner runner(options(bed), cases::load(bed));
  expect_says(error_of([&] { runner.set("velocity", 1); }),
              {"velocity: does not drive stage settle", "shear"});
  expect_says(error_of([&] { runner.set("normal_stress", 1); }), {"no top wall"});
  expect_says(error_of([&] { run::Runner(options(bed), cases::load(bed)); }),
              {"another run is writing here"});
  while (runner.stage_index() < 2) runner.step(1 << 20), runner.begin_stage();
  expect_says(error_of([&] { runner.set("velocity", 1); }), {"stage shear", "strain", "duration"});
  expect_says(error_of([&] { runner.set("shear_stress", 1); }), {"shear_stress"});
  expect_says(error_of([&] { runner.set("top_pressure", 1); }), {"dry", "fluid = true"});
  EXPECT_EQ(runner.events().size(), 0u);
  expect_says(error_of([&] { run::load_value("normal_stres", "1"); }), {"did you mean normal_stress?"});
  expect_says(error_of([&] { run::load_value("normal_stress", "1 m"); }), {"normal_stress = 1 m", "Pa"});
  expect_says(error_of([&] { run::load_value("normal_stress", "-1 Pa"); }), {">= 0"});
  expect_says(error_of([&] { run::load_value("mu_s", "0.1"); }),
              {"stays as it is", "normal_stress, velocity"});
  runner.finish();
  expect_says(error_of([&] { runner.set("normal_stress", 1); }), {"end"});
  expect_error({"replay", bed.string(), "--set", "f=0.1"}, {"--set f", "replay"});
  expect_error({"replay", (bed / "nothing").string()}, {"checkpoint.h5"});
  directory.write("bed/output/events.csv", "stage,step,key,value\n3,1,normal_stress,x\n");
  expect_says(error_of([&] { run::read_events(bed / "output/events.csv"); }),
              {"events.csv:2", "3,1200,normal_stress"});
}

}  // namespace
}  // namespace moraine
