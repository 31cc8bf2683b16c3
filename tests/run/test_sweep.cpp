// A sweep gives each case what it gets when it runs alone, whatever becomes of the others.
#include "run/sweep_plan.hpp"

#include <chrono>
#include <thread>

#include "error.hpp"
#include "program.hpp"

namespace moraine {
namespace {

using run::plan_sweep;

std::vector<std::string> names(const run::Plan& plan) {
  std::vector<std::string> list;
  for (const auto& c : plan.cases) list.push_back(c.name);
  return list;
}

std::string fault(const std::vector<cases::Override>& sets) {
  try {
    plan_sweep(sets);
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(SweepPlan, AUnitBehindTheLastValueIsThatOfAll) {
  const run::Plan plan = plan_sweep({{"contact.mu_s", "0.5"}, {"normal_stress", "10, 20,40 kPa"}});
  EXPECT_EQ(names(plan),
            (std::vector<std::string>{"normal_stress-10kPa", "normal_stress-20kPa", "normal_stress-40kPa"}));
  EXPECT_EQ(plan.columns, std::vector<std::string>{"normal_stress (kPa)"});
  EXPECT_EQ(plan.cases[1].values, std::vector<std::string>{"20"});
  ASSERT_EQ(plan.cases[1].overrides.size(), 2u);
  EXPECT_EQ(plan.cases[1].overrides[0].value, "0.5");
  EXPECT_EQ(plan.cases[1].overrides[1].value, "20 kPa");
}

TEST(SweepPlan, ValuesMayHaveUnitsOfTheirOwn) {
  const run::Plan plan = plan_sweep({{"stage.shear.strain_rate", "0.5 1/min,2e-2 1/s"}});
  EXPECT_EQ(names(plan), (std::vector<std::string>{"strain_rate-0.5_1_min", "strain_rate-2e-2_1_s"}));
  EXPECT_EQ(plan.columns, std::vector<std::string>{"strain_rate"});
  EXPECT_EQ(plan.cases[0].values, std::vector<std::string>{"0.5 1/min"});
}

TEST(SweepPlan, ListsGiveTheirProduct) {
  EXPECT_EQ(names(plan_sweep({{"grains.seed", "1,2"}, {"box.periodic", "x,xy"}})),
            (std::vector<std::string>{"periodic-x+seed-1", "periodic-xy+seed-1", "periodic-x+seed-2",
                                      "periodic-xy+seed-2"}));
  EXPECT_EQ(names(plan_sweep({{"stage.a.mu_s", "1,2"}, {"stage.b.mu_s", "3,4"}}))[0], "a.mu_s-1+b.mu_s-3");
}

TEST(SweepPlan, CommasInQuotesAndBracketsAreNoLists) {
  const run::Plan plan =
      plan_sweep({{"title", "\"dense, dry\""}, {"stages", "[\"settle\", \"shear\"]"}, {"seed", "1,2"}});
  EXPECT_EQ(names(plan), (std::vector<std::string>{"seed-1", "seed-2"}));
  EXPECT_EQ(plan.cases[0].overrides[0].value, "\"dense, dry\"");
  const run::Plan loads = plan_sweep({{"stage.a.normal_stress", "{ ramp = [1e3, 2e3], over = 1 }, 4000"}});
  ASSERT_EQ(loads.cases.size(), 2u);
  EXPECT_EQ(loads.cases[0].overrides[0].value, "{ ramp = [1e3, 2e3], over = 1 }");
}

TEST(SweepPlan, ACommaMakesAListOfOne) {
  const auto plan = plan_sweep({{"normal_stress", "80 kPa,"}, {"wall.mass", "6 kg"}});
  EXPECT_EQ(names(plan), (std::vector<std::string>{"normal_stress-80kPa"}));
}

TEST(SweepPlan, SaysWhatIsWrong) {
  EXPECT_NE(fault({{"seed", "1"}}).find("nothing to sweep"), std::string::npos);
  EXPECT_NE(fault({{"seed", "1,,2"}}).find("--set seed=1,,2: a value of the list is empty"),
            std::string::npos);
  EXPECT_NE(fault({{"seed", "1,2,1"}}).find("seed-1; expected every value once"), std::string::npos);
}

// The order of the lists is that of the cases, not of the words in a name.
TEST(SweepPlan, NamesDoNotDependOnTheOrderOfLists) {
  const cases::Override seeds{"seed", "1,2"}, stresses{"normal_stress", "10,20 kPa"}, fixed{"model.f", "0.1"};
  const auto sorted = [](const std::vector<cases::Override>& sets) {
    auto list = names(plan_sweep(sets));
    std::sort(list.begin(), list.end());
    return list;
  };
  EXPECT_EQ(names(plan_sweep({stresses, seeds}))[1], "normal_stress-10kPa+seed-2");
  EXPECT_EQ(sorted({stresses, seeds}), sorted({seeds, fixed, stresses}));
  EXPECT_NE(names(plan_sweep({stresses, seeds})), names(plan_sweep({seeds, stresses})));
}

TEST(SweepPlan, AKeyIsSetOnce) {
  for (const auto& sets : std::vector<std::vector<cases::Override>>{{{"seed", "1,2"}, {"seed", "3,4"}},
                                                                    {{"seed", "5"}, {"seed", "1,2"}},
                                                                    {{"seed", "1,2"}, {"seed", "5"}}})
    EXPECT_NE(fault(sets).find(": expected each key once"), std::string::npos) << fault(sets);
}

// Each value is what it would be in case.toml: none with another's digits.
TEST(SweepPlan, NumbersInLists) {
  const auto set_to = [](const std::string& list) {
    std::vector<std::string> values;
    for (const auto& c : plan_sweep({{"normal_stress", list}}).cases) values.push_back(c.overrides[0].value);
    return values;
  };
  using List = std::vector<std::string>;
  EXPECT_EQ(set_to("12 500, 15 000 Pa"), (List{"12 500 Pa", "15 000 Pa"}));
  EXPECT_EQ(set_to("12,500 Pa"), (List{"12 Pa", "500 Pa"}));
  EXPECT_EQ(set_to("4.5e-10,1e-9 1/Pa"), (List{"4.5e-10 1/Pa", "1e-9 1/Pa"}));
  EXPECT_EQ(set_to("1,2 N s/m"), (List{"1 N s/m", "2 N s/m"}));
  EXPECT_EQ(set_to("1,2 m s-2"), (List{"1 m s-2", "2 m s-2"}));
  EXPECT_EQ(set_to("1,2 10 kPa"), (List{"1 10 kPa", "2 10 kPa"}));  // refused where it is read
  EXPECT_EQ(set_to("0.1,0.2 ms,auto"), (List{"0.1 ms", "0.2 ms", "auto"}));
  EXPECT_EQ(names(plan_sweep({{"normal_stress", "12 500 Pa,"}})), List{"normal_stress-12500Pa"});
  for (const char* parts_of_one : {"12,000 Pa", "1,160,000,000", "1,05 kPa", "10,00 kPa"})
    EXPECT_NE(fault({{"k_n", parts_of_one}}).find("without a comma"), std::string::npos) << parts_of_one;
  for (const char* some : {"10 kPa,20", "10 kPa, 20, 30", "10 kPa,20,auto"})
    EXPECT_NE(fault({{"normal_stress", some}}).find("has a unit and"), std::string::npos) << some;
  EXPECT_EQ(plan_sweep({{"normal_stress", "12,500 Pa"}, {"seed", "1,2"}}).understood,
            "normal_stress = 12 Pa, 500 Pa; seed = 1, 2");
}

class Sweep : public Program {
 protected:
  static std::vector<std::string> to_sweep(const fs::path& which, const std::string& set,
                                           const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{"sweep", which.string(), "--backend", "cpu", "--set", set};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  // What each value gives alone.
  void expect_as_alone(const fs::path& sweep, const std::vector<std::string>& values) {
    for (const std::string& value : values) {
      SCOPED_TRACE(value);
      const fs::path alone = directory.path() / ("alone-" + value);
      if (!fs::exists(alone)) {
        make(alone.filename().string(), small_case());
        ASSERT_NO_FATAL_FAILURE(run(alone, {"normal_stress=" + value + " kPa"}));
      }
      expect_same_results(alone, sweep / "sweep" / ("normal_stress-" + value + "kPa"));
    }
  }
};

TEST_F(Sweep, SameBitsAsAlone) {
  const fs::path small = make("small", small_case());
  for (const char* threads : {"2", "6"}) {
    SCOPED_TRACE(threads);
    const Outcome o =
        moraine(to_sweep(small, "normal_stress=1,2,3 kPa", {"--threads", threads, "--quiet", "--force"}));
    ASSERT_EQ(o.status, 0) << o.err;
    EXPECT_EQ(o.err, "");
    EXPECT_NE(o.out.find("normal_stress-3kPa"), std::string::npos) << o.out;
    expect_as_alone(small, {"1", "2", "3"});
  }
  EXPECT_TRUE(fs::exists(small / "sweep/normal_stress-1kPa/output/log.txt"));

  std::ifstream csv(small / "sweep/summary.csv");
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line,
            "case,normal_stress (kPa),state,peak,peak_strain,smoothed_peak,ultimate,dilation_diameters");
  int lines = 0;
  for (; std::getline(csv, line); ++lines) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 7) << line;
    EXPECT_NE(line.find(",finished,"), std::string::npos) << line;
  }
  EXPECT_EQ(lines, 3);
}

// Each of them is a case like any other.
TEST_F(Sweep, ItsCasesRunOnTheirOwn) {
  const fs::path small = make("small", small_case());
  const Outcome o = moraine(to_sweep(small, "seed=1,3"));
  ASSERT_EQ(o.status, 0) << o.err;
  const fs::path swept = small / "sweep/seed-1", copy = small / "sweep/copy";
  fs::create_directories(copy);
  fs::copy_file(swept / "case.toml", copy / "case.toml");
  ASSERT_NO_FATAL_FAILURE(run(copy));
  expect_same_results(swept, copy);
}

TEST_F(Sweep, InterruptedAndResumed) {
  const fs::path small = make("small", small_case());
  const auto process = start(to_sweep(small, "normal_stress=1,2,3 kPa", {"--threads", "2"}));
  const fs::path second = small / "sweep/normal_stress-2kPa/output/log.txt";
  for (int k = 0; k < 10000 && !fs::exists(second); ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  process->send(SIGINT);
  ASSERT_EQ(process->wait(), 1) << "over too soon to be interrupted";
  const std::string said = contents(directory.path() / "err");
  for (const char* word : {"interrupted at step", "normal_stress-3kPa: not begun", "--resume"})
    EXPECT_NE(said.find(word), std::string::npos) << said;

  const Outcome o = moraine(to_sweep(small, "normal_stress=1,2,3 kPa", {"--resume"}));
  ASSERT_EQ(o.status, 0) << o.err;
  expect_as_alone(small, {"1", "2", "3"});
  const Outcome again = moraine(to_sweep(small, "normal_stress=1,2,3 kPa", {"--resume"}));
  EXPECT_EQ(again.status, 0) << again.err;
  EXPECT_NE(again.err.find("finished already: normal_stress-1kPa"), std::string::npos) << again.err;
  EXPECT_EQ(again.out, o.out);
}

// A step 25 times as long throws the grains out of the box.
TEST_F(Sweep, OneFailureStopsNoOther) {
  const fs::path small = make("small", small_case());
  const Outcome o = moraine(to_sweep(small, "model.f=5,0.2"));
  EXPECT_EQ(o.status, 1);
  for (const char* word : {"1 of 2 cases", "stopped: f-5: ", "finished: f-0.2"})
    EXPECT_NE(o.err.find(word), std::string::npos) << o.err;
  const fs::path alone = make("alone", small_case());
  ASSERT_NO_FATAL_FAILURE(run(alone));
  expect_same_results(alone, small / "sweep/f-0.2");
  EXPECT_NE(contents(small / "sweep/summary.csv").find("f-5,5,stopped,"), std::string::npos);
}

TEST_F(Sweep, SaysWhatIsWrongBeforeAnythingRuns) {
  const fs::path small = make("small", small_case());
  const auto expect_fault = [&](const std::string& set, const std::vector<const char*>& words) {
    const Outcome o = moraine(to_sweep(small, set));
    EXPECT_EQ(o.status, 1);
    for (const char* word : words) EXPECT_NE(o.err.find(word), std::string::npos) << o.err;
  };
  expect_fault("normal_stress=1,2 m", {"--set normal_stress=1 m", "unit convertible to Pa"});
  expect_fault("normal_stres=1,2 kPa", {"--set normal_stres=1 kPa", "unknown key"});
  expect_fault("mu_s=0.3,0.4", {"contact.mu_s", "stage.mu_s"});
  expect_fault("seed=1,-1", {"--set seed=-1", "expected >= 0"});
  // By what stands in case.toml, by its grains, by its stages, and by the machine.
  expect_fault("normal_stress=1 kPa,12 50 Pa", {"understood the number 12 and the unit \"50 Pa\""});
  expect_fault("box.x=0,0.1", {"x-0.1: the grains overlap at the start"});
  expect_fault("stage.settle.wall_gamma_n=1,1e4",
               {"wall_gamma_n-1e4: stage settle: wall_gamma_n = 10000", "unstable"});
  expect_fault("count=100,2e9", {"grains.count = 2000000000", "GB", "expected at most"});
  EXPECT_FALSE(fs::exists(small / "sweep"));

  ASSERT_EQ(moraine(to_sweep(small, "seed=1,3")).status, 0);
  const std::string written = contents(small / "sweep/seed-1/case.toml");
  for (const char* seeds : {"seed=1,3", "seed=1,4"}) {
    const Outcome o = moraine(to_sweep(small, seeds, {"--resume", "--set", "contact.mu_s=0.4"}));
    EXPECT_EQ(o.status, 1);
    EXPECT_NE(
        o.err.find(
            "sweep/seed-1: holds results of another version of this case: contact.mu_d was 0.5 and is now "
            "0.4; contact.mu_s was 0.5 and is now 0.4"),
        std::string::npos)
        << o.err;
    EXPECT_EQ(contents(small / "sweep/seed-1/case.toml"), written);
    EXPECT_FALSE(fs::exists(small / "sweep/seed-4"));
  }
  expect_fault("seed=1,2", {"sweep/seed-1/output", "--resume", "--force"});
  EXPECT_FALSE(fs::exists(small / "sweep/seed-2"));
}

}  // namespace
}  // namespace moraine
