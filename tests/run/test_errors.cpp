// What a person is told when a case cannot be run: file, key, value, what was expected.
#include <sched.h>
#include <sys/mount.h>

#include "program.hpp"

namespace moraine {
namespace {

class Errors : public Program {
 protected:
  void expect_error_in(const std::string& old, const std::string& now,
                       const std::vector<std::string>& words) const {
    std::string text = small_case();
    text.replace(text.find(old), old.size(), now);
    const fs::path bad = make("bad", text);
    expect_error(to_run(bad), words);
    EXPECT_FALSE(fs::exists(bad / "output"));
  }
};

TEST_F(Errors, UnknownKey) {
  expect_error_in(
      "columns_y", "colums_y",
      {"bad/case.toml:5", "grains.colums_y = 5", "unknown key", "did you mean grains.columns_y?"});
  expect_error_in("mu_s", "mu", {"bad/case.toml:11", "contact.mu = 0.5", "unknown key"});
}

TEST_F(Errors, WrongType) {
  expect_error_in("seed = 3", "seed = \"three\"",
                  {"bad/case.toml:7", "grains.seed", "\"three\"", "expected an integer"});
  expect_error_in("mu_s = 0.5", "mu_s = true",
                  {"bad/case.toml:11", "contact.mu_s = true", "expected a number"});
}

TEST_F(Errors, WrongDimension) {
  expect_error_in("\"2 kPa\"", "\"2 km\"",
                  {"bad/case.toml:", "stage.consolidate.normal_stress", "2 km", "Pa"});
}

TEST_F(Errors, WrongChoice) {
  expect_error_in(
      "\"shear\"\nkind = \"shear\"", "\"shear\"\nkind = \"sheer\"",
      {"bad/case.toml:", "stage.shear.kind", "sheer", "settle | consolidate | shear", "did you mean shear?"});
}

TEST_F(Errors, NegativeRadius) {
  expect_error_in("seed = 3", "radius_mean = -0.02",
                  {"bad/case.toml:7", "grains.radius_mean = -0.02", "expected > 0 m"});
}

// Where the height of the bed decides how long the stage lasts, too, before anything runs.
TEST_F(Errors, ALoadThatEndsBeforeItsStage) {
  const fs::path small = make("small", small_case());
  const std::string ends = "={ times = [0, 0.01], values = [1000, 2000] }";
  expect_error(
      to_run(small, {"stage.shear.normal_stress" + ends}),
      {"stage.shear.normal_stress", "ends at 0.01 s and the stage at 0.2 s", "expected values up to there"});
  expect_error(to_run(small, {"stage.shear.normal_stress" + ends, "stage.shear.strain_rate=0",
                              "stage.shear.velocity=0.1"}),
               {"stage shear: lasts", "longer than one of its loads"});
  EXPECT_FALSE(fs::exists(small / "output"));
}

TEST_F(Errors, NoToml) { expect_error_in("[grains]", "[grains", {"bad/case.toml:2"}); }

TEST_F(Errors, NoCase) {
  expect_error(to_run(directory.path() / "nowhere"), {"nowhere/case.toml: not found", "case.toml"});
}

TEST_F(Errors, SetOnTheCommandLine) {
  const fs::path small = make("small", small_case());
  expect_error(to_run(small, {"contact.kn=5"}),
               {"--set contact.kn=5", "unknown key", "did you mean contact.k_n?"});
  expect_error(to_run(small, {"stage.sheer.strain=1"}),
               {"--set stage.sheer.strain=1", "no stage", "settle, consolidate, shear"});
  expect_error(to_run(small, {"model.f"}), {"--set model.f", "KEY=VALUE"});
}

// No word at all: what the program is and how to begin; from the launcher, too, which need not build for it.
TEST_F(Errors, NoCommand) {
  const Outcome o = moraine({});
  EXPECT_EQ(o.status, 0);
  EXPECT_EQ(o.err, "");
  EXPECT_TRUE(o.out.starts_with("Moraine computes"));
  for (const char* command : {"run", "check", "watch", "figures", "sweep", "keys"})
    EXPECT_NE(o.out.find("\n  " + std::string(command) + " "), std::string::npos) << command;
  Process launcher(MORAINE_SOURCE_DIR "/moraine", {}, directory.path() / "out", directory.path() / "err");
  EXPECT_EQ(launcher.wait(), 0);
  EXPECT_EQ(contents(directory.path() / "out"), o.out);
}

TEST_F(Errors, MisspeltCommandsAndOptions) {
  for (const auto& [typed, meant] :
       std::vector<std::pair<std::string, std::string>>{{"runn", "run"},
                                                        {"rn", "run"},
                                                        {"swep", "sweep"},
                                                        {"chekc", "check"},
                                                        {"kesy", "keys"},
                                                        {"wacth", "watch"},
                                                        {"figure", "figures"},
                                                        {"repor", "report"},
                                                        {"exprot", "export"},
                                                        {"reproduse", "reproduce"},
                                                        {"tset", "test"}})
    expect_error({typed, "cases/quick-shear"}, {typed + ": unknown command; did you mean " + meant + "?"});
  expect_error({"xyzzy"}, {"xyzzy: unknown command; known: ", "watch", "import-sphere"});
  expect_error({"watch", "x"}, {"watch: a command of the launcher, ./moraine watch"});
  for (const auto& [command, typed, meant] :
       std::vector<std::array<std::string, 3>>{{"run", "--resum", "--resume"},
                                               {"run", "--forse", "--force"},
                                               {"sweep", "--atonce", "--at-once"},
                                               {"check", "--thread", "--threads"},
                                               {"bench", "--step", "--steps"},
                                               {"run", "--backnd", "--backend"}})
    for (const std::vector<std::string>& words :
         {std::vector<std::string>{command, typed}, {command, "x", typed, "3"}})
      expect_error(words, {typed + ": unknown option of " + command + "; did you mean " + meant + "?"});
  expect_error({"--versoin"}, {"--versoin: unknown option; did you mean --version?"});
  expect_error({"run"}, {"CASE is required; see moraine run --help"});
  expect_error({"check", "a", "b"}, {"b: one word too many for check"});
}

TEST_F(Errors, KeysAboutSomething) {
  const auto keys = [&](const std::vector<std::string>& words) {
    std::vector<std::string> all{"keys"};
    all.insert(all.end(), words.begin(), words.end());
    return moraine(all).out;
  };
  const std::string wall = keys({"wall"});
  for (const char* key : {"\n[wall]\n", "\n  mass ", "\n  wall_mu ", "\n  normal_stress "})
    EXPECT_NE(wall.find(key), std::string::npos) << key;
  for (const char* key : {"\n[guards]\n", "\n  seed ", "\n  mu_s "})
    EXPECT_EQ(wall.find(key), std::string::npos) << key;
  EXPECT_EQ(keys({"WALL"}), wall);
  EXPECT_EQ(keys({"normal stress", "amplitude"}), keys({"normal_stress_amplitude"}));
  EXPECT_EQ(keys({"stage.shear.hold_layer_height"}), keys({"stage.hold_layer_height"}));
  expect_error({"keys", "gravty"}, {"keys gravty: no key has this word", "did you mean gravity?"});
  expect_error({"keys", "wall", "zzz"},
               {"keys wall zzz: no key has these words", "`moraine keys` lists all"});
}

// Of the machine, or of what `ulimit` leaves.
TEST_F(Errors, TooManyGrains) {
  const fs::path small = make("small", small_case());
  const std::vector<std::string> many{"--set", "count=2e9"};
  for (const std::vector<std::string>& command : {std::vector<std::string>{"run", small.string()},
                                                  {"check", small.string()},
                                                  {"bench", small.string()},
                                                  {"run", small.string(), "--backend", "cuda"},
                                                  {"sweep", small.string(), "--set", "seed=1,2"}}) {
    auto words = command;
    words.insert(words.end(), many.begin(), many.end());
    expect_error(words, {"grains.count = 2000000000 grains need about ", " GB of memory, and there are ",
                         "expected at most "});
  }
  for (const char* set : {"fluid.cells_z=1000000", "fluid.cell=1e-4"})
    expect_error(
        {"check", small.string(), "--set", set, "--set", "stage.shear.fluid=true", "--set",
         "fluid.cells_x=3000", "--set", "fluid.cells_y=3000"},
        {"stage shear: 300 grains and some ", "cells of pore water need about", "larger fluid.cell"});
  EXPECT_FALSE(fs::exists(small / "output"));
  EXPECT_FALSE(fs::exists(small / "sweep"));

  const auto with_less = [&](const std::string& count) {
    Process limited(
        "/bin/sh",
        {"-c", "ulimit -v 400000; exec " MORAINE_PROGRAM " check " + small.string() +
                   " --threads 1 --backend cpu --set columns_x=50 --set columns_y=50 --set count=" + count},
        directory.path() / "out", directory.path() / "err");
    return limited.wait();
  };
  EXPECT_EQ(with_less("1e6"), 1);
  const std::string said = contents(directory.path() / "err");
  EXPECT_NE(said.find("there are 0.41 GB (limit set by ulimit)"), std::string::npos) << said;
  const std::string at_most = "expected at most ";
  const int fit = std::stoi(said.substr(said.find(at_most) + at_most.size()));
  EXPECT_GT(fit, 50'000);
  EXPECT_EQ(with_less(std::to_string(fit)), 0) << contents(directory.path() / "err");
}

TEST_F(Errors, GrainsOverlapAtTheStart) {
  expect_error_in("cell = 1.3", "cell = 0.9", {"bad/case.toml:6", "grains.cell = 0.9", "expected >= 1.05"});
  const fs::path small = make("small", small_case());
  expect_error(to_run(small, {"box.x=0.1"}), {"overlap at the start", "grains.columns_x", "grains.cell"});
}

class Gradings : public Errors {
 protected:
  // 400 grains at random places.
  fs::path graded(const std::string& name, const std::string& grains) const {
    return make(name, "[box]\nx = 0.1\ny = 0.1\n[grains]\ncount = 400\nplacement = \"random\"\n" + grains +
                          "[wall]\ngamma_n = 0\ngamma_t = 0\n[[stage]]\nname = \"settle\"\nkind = "
                          "\"settle\"\nduration = 1\n");
  }
  void expect_refused(const std::string& name, const std::string& grains,
                      const std::vector<std::string>& words) const {
    expect_error({"check", graded(name, grains).string()}, words);
  }
};

TEST_F(Gradings, SieveTables) {
  const auto expect = [&](const std::string& name, const std::string& table,
                          const std::vector<std::string>& words) {
    directory.write(name + "/sieves.csv", table);
    expect_refused(name, "distribution = \"sieves\"\nsieves = \"sieves.csv\"\n", words);
  };
  const std::string head = "size (mm), finer (%)\n";
  expect("coarsest", "# of a till\n" + head + "1, 0\n2, 90\n",
         {"sieves.csv, line 4: the coarsest sieve, 0.002 m, has 90 % finer; expected 100"});
  expect("finest", head + "1, 10\n2, 100\n",
         {"sieves.csv, line 2: the finest sieve, 0.001 m, has 10 % finer"});
  expect("negative", head + "-1, 0\n2, 100\n", {"sieves.csv, line 2: size -0.001 m; expected more than 0"});
  expect("down", head + "1, 0\n2, 60\n3, 50\n4, 100\n", {"sieves.csv, line 4 (0.003 m, 50 %)"});
  expect("turned", head + "2, 100\n1, 0\n", {"sieves.csv, line 3", "from the finest on"});
  expect("share", "size (mm), finer\n1, 0\n2, 100\n", {"line 3: 10000 % finer", "a column \"finer (%)\""});
  expect("metres", "size, finer (%)\n1, 0\n2, 100\n",
         {"does not fit into a box", "those without a unit are in m"});
  expect("one", head + "1, 0\n", {"sieves.csv: has 1 sieve; expected two or more"});
  expect("empty", "", {"sieves.csv: is empty"});
  expect("words", head + "1, 0\n2, all\n", {"sieves.csv, line 3: finer = \"all\"; expected a number"});
}

TEST_F(Gradings, SizesThatAreNone) {
  expect_refused("negative", "distribution = \"fractal\"\nradius_min = -1e-3\nradius_max = 0.01\n",
                 {"case.toml:", "grains.radius_min = -0.001", "expected >= 0 m"});
  expect_refused("zero", "distribution = \"fractal\"\nradius_max = 0.01\n",
                 {"grains.radius_min", "expected > 0 m for fractal radii"});
  expect_refused("crossed", "distribution = \"fractal\"\nradius_min = 0.02\nradius_max = 0.01\n",
                 {"grains.radius_max = 0.01", "expected at least grains.radius_min = 0.02"});
  expect_refused("none", "radius_min = 0.03\n",
                 {"no radius between grains.radius_min = 0.03 m", "expected limits around the mean, 0.02 m"});
}

// What a step of 1e-9 s and less costs, and what would do.
TEST_F(Gradings, WhoseSmallestGrainsTakeTooLong) {
  const auto said = [&](const std::string& name, const std::string& grains) {
    const Outcome o = moraine({"check", graded(name, grains).string(), "--threads", "1", "--backend", "cpu"});
    EXPECT_EQ(o.status, 0) << o.err;
    return o.out;
  };
  const auto expect = [](const std::string& out, const std::vector<std::string>& words) {
    for (const std::string& word : words)
      EXPECT_NE(out.find(word), std::string::npos) << "no \"" << word << "\" in: " << out;
  };
  const std::string fractal = "distribution = \"fractal\"\nradius_max = 0.01\n";
  const std::string tiny = said("tiny", fractal + "radius_min = 1e-5\n");
  expect(tiny, {"step        7.26", "e-12 s", " steps for 1 s", "\n    time        about ", " d ",
                "ms a step", "timed with as many grains of one size, as sizes of 1:11 ",
                "the smallest grain, 2e-05 m wide, and k_n = 1.16e+09 N/m set the step",
                "a tenth of the time with 4.6 times larger ones (grains.radius_min)", "(model.softening)",
                "a day in all with none below ", "; or with model.softening = "});
  EXPECT_EQ(tiny.find("about 0.0 s"), std::string::npos) << tiny;
  directory.write("sieved/sieves.csv", "size (um), finer (%)\n1, 0\n5, 100\n");
  expect(said("sieved", "distribution = \"sieves\"\nsieves = \"sieves.csv\"\n"),
         {"more than a day even with all at D50", "4.6 times larger ones (grains.sieves)"});
  // The usual viscosity of walls is no longer stable there: which grain, how small, and what would be.
  expect_error({"check", graded("damped", fractal + "radius_min = 1e-5\n").string(), "--set",
                "stage.settle.wall_gamma_n=1e4"},
               {"wall_gamma_n = 10000 N s/m", "the smallest, of radius 1.0", "unstable; expected at most "});
}

// Two grains in one place, as a damaged or foreign start file may hold them.
TEST_F(Errors, GrainsOfTheStartInOnePlace) {
  const fs::path bed = make("bed", "stages = [\"settle\"]\n" + small_case());
  run(bed, {"stage.settle.duration=0.01"});
  output::Checkpoint c = output::read_checkpoint(checkpoint_of(bed));
  c.state.x[7] = c.state.x[8];
  const fs::path next = make("next", "start = \"start.h5\"\n" + small_case());
  output::write_checkpoint(next / "start.h5", c);
  expect_error(to_run(next), {"grain"});
}

TEST_F(Errors, StartFiles) {
  const fs::path small = make("small", small_case());
  const auto words = [&](const std::string& start) { return to_run(small, {"start=" + start}); };
  expect_error(words("../nowhere"),
               {"start=../nowhere", "there is no", "a finished case, a checkpoint or a file of grains"});
  make("not-run", small_case());
  expect_error(words("../not-run"), {"start=../not-run", "run that case first"});
  directory.write("text.h5", "no HDF5 file");
  expect_error(words("../text.h5"), {"text.h5", "not a checkpoint of moraine"});

  for (const std::string& text : {graded_case(), small_case()}) {
    const fs::path bed = make("bed", "stages = [\"settle\"]\n" + text);
    run(bed, {"stage.settle.duration=0.01"}, {"--force"});
    const std::string whole = contents(checkpoint_of(bed));
    for (const std::size_t size : {whole.size() / 2, whole.size() - 1}) {
      directory.write("cut.h5", whole.substr(0, size));
      expect_error(words("../cut.h5"), {"cut.h5", "truncated"});
    }
    std::string flipped = whole;  // one bit in what it holds
    flipped[whole.size() / 2] ^= 1;
    directory.write("flipped.h5", flipped);
    expect_error(words("../flipped.h5"), {"flipped.h5"});
  }
  expect_error(words("../bed/output/series.h5"), {"series.h5", "not a checkpoint of moraine"});
  EXPECT_FALSE(fs::exists(small / "output"));
}

TEST_F(Errors, ImportOfWhatIsNoBed) {
  const auto import = [&](const fs::path& file) {
    return std::vector<std::string>{"import-sphere", file.string(), (directory.path() / "imported").string()};
  };
  expect_error(import(directory.path() / "nowhere.bin"), {"nowhere.bin", "cannot be read", "sphere"});
  expect_error(import(directory.write("short.bin", std::string(20, '\0'))), {"short.bin"});
  const fs::path bed = fs::path(MORAINE_SHARED_DIR) / "data/sphere-init-1e4.bin";
  if (fs::exists(bed)) {
    expect_error(import(directory.write("cut.bin", contents(bed).substr(0, 100'000))),
                 {"cut.bin", "truncated", "bytes expected"});
  }
  EXPECT_FALSE(fs::exists(directory.path() / "imported"));
}

// Root may write everywhere, so a file stands where the directory should be.
TEST_F(Errors, OutputNotWritable) {
  const fs::path small = make("small", small_case());
  directory.write("small/output", "");
  expect_error(to_run(small), {"small/output", "cannot be created"});
  auto words = to_run(small);
  words.push_back("--force");
  expect_error(words, {"small/output", "cannot be created"});
}

TEST_F(Errors, TwoRunsOfOneCaseAtOnce) {
  const fs::path c = make("c", small_case());
  fs::create_directories(c / "output");
  {
    const output::DirectoryLock other(c / "output");
    for (const char* how : {"--resume", "--force"}) {
      std::vector<std::string> words = to_run(c);
      words.push_back(how);
      const Outcome o = moraine(words);
      EXPECT_EQ(o.status, 1);
      EXPECT_NE(o.err.find("output: another run is writing here"), std::string::npos) << o.err;
      EXPECT_TRUE(fs::is_empty(c / "output"));
    }
  }
  EXPECT_EQ(moraine(to_run(c, {"stages=[\"settle\"]", "stage.settle.duration=0.01"})).status, 0);
}

TEST_F(Errors, BlowUpNamesGrainAndStep) {
  const fs::path small = make("small", small_case());
  expect_error(to_run(small, {"model.f=30", "stage.settle.wall_gamma_n=0", "stage.settle.wall_gamma_t=0"}),
               {"grain ", " at step ", "position (", "smaller model.f", "the last good checkpoint stays in",
                "small/output/checkpoint.h5"});
  const output::Checkpoint kept = output::read_checkpoint(checkpoint_of(small));
  EXPECT_EQ(kept.stage, 0);
  EXPECT_FALSE(kept.finished);
  for (const dem::Vec3d& x : kept.state.x) EXPECT_GT(x.z, 0);
  EXPECT_NE(contents(small / "output/log.txt").find("stopped: grain "), std::string::npos);
  EXPECT_FALSE(output::read_series(series_of(small)).empty());
}

// Not at the start but on the way: what was good before stays, and is good to go on from.
TEST_F(Errors, BlowUpInALaterStage) {
  const fs::path small = make("small", small_case());
  const Outcome o = moraine(to_run(small, {"stage.shear.f=30"}));
  EXPECT_EQ(o.status, 1);
  for (const char* word : {"grain ", " at step ", "checkpoint.h5"})
    EXPECT_NE(o.err.find(word), std::string::npos) << o.err;
  const output::Checkpoint kept = output::read_checkpoint(checkpoint_of(small));
  EXPECT_GE(kept.stage, 1);  // its end, or the start of the next
  for (const dem::Vec3d& x : kept.state.x) EXPECT_GT(x.z, -0.01);
  EXPECT_GE(kept.rows.size(), 60u);
}

TEST_F(Errors, DiskFull) {
  const fs::path whole = make("whole", small_case()), small = make("small", small_case());
  run(whole);
  fs::create_directory(small / "output");
  const std::string disk = (small / "output").string();
  // A file system of this process only, so that nothing stays mounted.
  if (::unshare(CLONE_NEWNS) != 0 || ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
      ::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=400k") != 0) {
    GTEST_SKIP() << "no permission to mount a small file system";
  }
  const Outcome o = moraine(to_run(small));
  EXPECT_EQ(o.status, 1);
  for (const char* word : {"small/output/", "No space left on device", "the last good checkpoint stays in"})
    EXPECT_NE(o.err.find(word), std::string::npos) << o.err;
  const output::Checkpoint kept = output::read_checkpoint(checkpoint_of(small));
  EXPECT_FALSE(kept.finished);

  // With room made, it goes on.
  ASSERT_EQ(::mount("tmpfs", disk.c_str(), "tmpfs", MS_REMOUNT, "size=20m"), 0);
  run(small, {}, {"--resume"});
  expect_same_results(whole, small);
  ::umount(disk.c_str());
}

}  // namespace
}  // namespace moraine
