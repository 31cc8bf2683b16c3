// How long `check` says that a run takes, against how long it takes.
#include <sys/resource.h>

#include <regex>

#include "program.hpp"

namespace moraine {
namespace {

class TimeEstimate : public Program {
 protected:
  // s, of the processor, by programs that have been run from here.
  static double spent() {
    rusage use;
    getrusage(RUSAGE_CHILDREN, &use);
    const auto s = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * t.tv_usec; };
    return s(use.ru_utime) + s(use.ru_stime);
  }
  std::string check(const fs::path& which, const std::vector<std::string>& overrides) const {
    std::vector<std::string> words{"check", which.string(), "--threads", "1", "--backend", "cpu"};
    for (const std::string& o : overrides) words.insert(words.end(), {"--set", o});
    const Outcome o = moraine(words);
    EXPECT_EQ(o.status, 0) << o.err;
    return o.out;
  }
  static double seconds(const std::string& out) {
    std::smatch found;
    if (!std::regex_search(out, found, std::regex(R"(all +about (?:(\d+) min )?([0-9.]+) s)"))) return -1;
    return (found[1].matched ? 60 * std::stod(found[1]) : 0) + std::stod(found[2]);
  }
  // Timed on freely falling grains it was a tenth. Within 30 % on a quiet machine (bench/time-estimate);
  // tests run beside each other.
  void expect_close(const std::string& text, const std::vector<std::string>& overrides) const {
    const fs::path which = make("case", text);
    const double expected = seconds(check(which, overrides)), before = spent();
    ASSERT_NO_FATAL_FAILURE(run(which, overrides, {"--threads", "1"}));
    const double took = spent() - before;
    ASSERT_GT(took, 0.2);  // or rounding counts
    EXPECT_GT(expected, took / 1.6);
    EXPECT_LT(expected, took * 1.6);
  }
};

TEST_F(TimeEstimate, OfLooseGrainsThatBecomeABed) {
  expect_close(small_case(), {"model.f=0.004", "output.checkpoint_interval=60"});
}

TEST_F(TimeEstimate, OfABedThatIsThereAlready) {
  const fs::path bed = make("bed", small_case());  // of four layers: one of two is no bed yet
  ASSERT_NO_FATAL_FAILURE(run(bed, {"grains.count=500", "grains.columns_x=5", "grains.columns_y=5"}));
  expect_close("extends = \"../bed\"\nstart = \"../bed\"\nstages = [\"consolidate\", \"shear\"]\n",
               {"model.f=0.004", "output.checkpoint_interval=60"});
}

// Whatever a case asks for, it has a time.
TEST_F(TimeEstimate, OfCasesOfAllKinds) {
  const fs::path small = make("small", small_case());
  const std::vector<std::vector<std::string>> kinds = {
      {"grains.count=30000", "grains.columns_x=10", "grains.columns_y=10"},
      {"grains.distribution=uniform", "grains.radius_min=0.015", "grains.radius_max=0.02",
       "grains.count=900"},
      {"model.gravity=0"},
      {"model.dt=auto"},
      {"box.periodic=x"},
      {"stage.shear.hold_layer_height=true"},
      {"stage.shear.strain_rate=-1"},
      {"stage.consolidate.kind=uniaxial", "stage.consolidate.strain_rate=0.1",
       "stage.consolidate.normal_stress=0"}};
  for (const auto& sets : kinds) EXPECT_GT(seconds(check(small, sets)), 0) << sets.front();
}

}  // namespace
}  // namespace moraine
