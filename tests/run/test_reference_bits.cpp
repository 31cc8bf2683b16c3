// Results have the very bits of the version that made the table, reference_bits.txt, on any number of
// threads and ranks, with any neighbour list, on the GPU's loop and after a restart. To be renewed only with
// a change of physics; then this writes it:
//   MORAINE_WRITE_REFERENCE_BITS=tests/run/reference_bits.txt test_run --gtest_filter=*ReferenceBits*
#include "reference_bits.hpp"

#include <cstdlib>
#include <map>
#include <sstream>

#include "backends.hpp"
#include "case/case.hpp"
#include "coupling/pore_water.hpp"
#include "program.hpp"
#include "reference_scenes.hpp"
#include "run/run.hpp"
#include "thread_ranks.hpp"

namespace moraine {

void PrintTo(const ReferenceScene& scene, std::ostream* out) { *out << scene.name; }

namespace {

const fs::path imported_bed = fs::path(MORAINE_SHARED_DIR) / "data/sphere-init-1e4.bin";

std::string output_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::array<char, 256> line{};
  if (!pipe || !fgets(line.data(), line.size(), pipe.get())) return "";
  const std::string text = line.data();
  return text.substr(0, text.find('\n'));
}

std::string version() {
  const std::string git = "git -C '" MORAINE_SOURCE_DIR "' ";
  return output_of(git + "rev-parse --short HEAD") +
         (output_of(git + "status --porcelain -- src CMakeLists.txt").empty() ? "" : ", src changed since");
}

struct Table {
  std::string made_with;
  std::map<std::string, Digests> digests;
};

Table read_table() {
  Table table;
  std::ifstream file(fs::path(MORAINE_SOURCE_DIR) / "tests/run/reference_bits.txt");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("# Made with ")) table.made_with = line.substr(12);
    if (line.empty() || line.starts_with("#")) continue;
    std::istringstream words(line);
    std::string scene;
    words >> scene;
    for (std::string& digits : table.digests[scene]) words >> digits;
  }
  return table;
}

class ReferenceBits : public Program, public testing::WithParamInterface<ReferenceScene> {
 protected:
  static void SetUpTestSuite() { shared_ = new TemporaryDirectory; }
  static void TearDownTestSuite() {
    if (const char* path = std::getenv(write)) write_table(path);
    delete shared_, shared_ = nullptr;
  }

  void SetUp() override {
    if (GetParam().wet() && !coupling::water_built()) GTEST_SKIP() << "this build has no pore water in it";
    if (GetParam().start == std::string("imported") && !fs::exists(imported_bed))
      GTEST_SKIP() << "no " << imported_bed;
  }

  // One for all scenes.
  fs::path start() const {
    const fs::path path = shared_->path() / GetParam().start;
    if (fs::exists(path)) return path;
    if (GetParam().start == std::string("imported")) {
      EXPECT_EQ(moraine({"import-sphere", imported_bed.string(), path.string()}).status, 0);
    } else {
      shared_->write("bed/case.toml", "stages = [\"settle\", \"consolidate\"]\n" + small_case());
      run(path, {}, {"--threads", "1"});
    }
    return path;
  }

  fs::path make_scene(const std::string& name) const {
    const ReferenceScene& scene = GetParam();
    if (!scene.starts())
      return make(name, contents(fs::path(MORAINE_SOURCE_DIR) / scene.start / "case.toml"));
    const std::string from = start().string();
    return make(name, "extends = \"" + from + "\"\nstages = [\"s\"]\n" +
                          (scene.start == std::string("bed") ? "start = \"" + from + "\"\n" : "") +
                          "[[stage]]\nname = \"s\"\nkind = \"settle\"\n");
  }

  run::Options options(const std::string& name, int threads, const std::string& more = {}) const {
    run::Options options;
    options.directory = make_scene(name), options.threads = threads;
    options.backend = dem::Backend::cpu, options.quiet = true;
    auto sets = GetParam().keys;
    if (!more.empty()) sets.push_back(more);
    for (const std::string& set : sets)
      options.overrides.push_back({set.substr(0, set.find('=')), set.substr(set.find('=') + 1)});
    return options;
  }

  static Digests computed(const run::Options& options) {
    run::run_one(options, cases::load(options.directory, options.overrides));
    return digests_of(options.directory);
  }

  // Interrupted after more and more looks at the clock, each of which leaves a checkpoint, until it ends.
  Digests computed_in_pieces() const {
    struct Interrupted {};
    run::Options options = this->options("pieces", 1, "checkpoint_interval=1e-9");
    for (int pieces = 1;; ++pieces) {
      int looks = 0;
      options.on_progress = [&](auto...) {
        if (++looks == 1 + 2 * pieces) throw Interrupted();
      };
      try {
        const Digests digests = computed(options);
        EXPECT_GT(pieces, 1) << "never interrupted";
        return digests;
      } catch (const Interrupted&) {
        options.resume = true;
      }
    }
  }

  static constexpr const char* write = "MORAINE_WRITE_REFERENCE_BITS";
  static inline std::map<std::string, Digests> made_;

 private:
  static void write_table(const char* path) {
    for (const ReferenceScene& scene : reference_scenes())
      if (!made_.count(scene.name)) {
        ADD_FAILURE() << path << ": not written: scene " << scene.name << " was not computed";
        return;
      }
    std::ofstream file(path);
    file
        << "# What scenes of reference_scenes.hpp compute, by part: the first 64 bits of a SHA-256\n"
           "# (reference_bits.hpp). The bits are those of processors with FMA, of the library that gives\n"
           "# logarithms, sines and roots and, with water, of SuiteSparse and SUNDIALS. Renewed only with a\n"
           "# change of physics, by the command in test_reference_bits.cpp; docs/decisions.md then says\n"
           "# which change it was.\n"
        << "# Made by version " << version() << "\n# Made with " << made_with() << "\n# Made on "
        << output_of("sed -n 's/^model name[^:]*: //p' /proc/cpuinfo") << "\n# scene";
    for (const std::string& part : parts) file << " " << part;
    file << "\n";
    for (const ReferenceScene& scene : reference_scenes()) {
      file << scene.name;
      for (const std::string& digits : made_[scene.name]) file << " " << digits;
      file << "\n";
    }
  }

  static inline TemporaryDirectory* shared_ = nullptr;
};

// Fails with the parts that differ.
void expect_same(const Digests& expected, const Digests& found, const std::string& what) {
  std::string others;
  for (std::size_t k = 0; k < parts.size(); ++k)
    if (expected[k] != found[k])
      others += (others.empty() ? "" : ", ") + parts[k] + " (" + found[k] + ", was " + expected[k] + ")";
  EXPECT_EQ(others, "") << what << ": other bits";
}

TEST_P(ReferenceBits, AreTheSame) {
  const ReferenceScene& scene = GetParam();
  const std::string name = scene.name;
  const Digests one = computed(options("one", 1));
  if (std::getenv(write)) {
    made_[name] = one;
  } else {
    const Table table = read_table();
    ASSERT_TRUE(table.digests.count(name)) << "tests/run/reference_bits.txt has no scene " << name;
    const bool same_tools = table.made_with == made_with();
    expect_same(table.digests.at(name), one,
                "scene " + name + ", against the table" +
                    (same_tools ? "" : " (made with " + table.made_with + ", here: " + made_with() + ")"));
  }

  const auto expect_again = [&](const std::string& how, const Digests& found) {
    expect_same(one, found, "scene " + name + ", " + how + " against one thread");
  };
  const bool on_threads = scene.again & threads;
  if (on_threads)
    for (const int n : {2, 3}) {
      const std::string how = std::to_string(n) + " threads";
      expect_again(how, computed(options(how, n)));
    }
  for (const int n : {2, 3}) {
    if (n > 2 && !on_threads) continue;
    ServingRanks ranks(n);
    run::Options with = options(std::to_string(n) + " ranks", n == 3 ? 2 : 1);
    with.ranks = &ranks.first();
    expect_again(with.directory.filename(), computed(with));
    EXPECT_TRUE(ranks.all_have_come());
    // Of each step some: the ranks have shared the work.
    const auto rows = output::read_series(series_of(with.directory));
    EXPECT_GT(ranks.messages(), 2 * static_cast<std::int64_t>(rows.back().step));
  }
  if (scene.again & pieces) expect_again("interrupted", computed_in_pieces());
  if (scene.again & margins)
    for (const std::string margin : {"0.001", "0.004", "0.012"})
      expect_again("margin " + margin,
                   computed(options("margin " + margin, 1, "neighbour_margin=" + margin)));
  if (scene.again & reference)
    for (const dem::Backend backend : gpu_loops())
      for (const int n : {1, 3}) {
        if (n > 1 && (!on_threads || backend == dem::Backend::cuda)) continue;
        const std::string loop = backend == dem::Backend::cuda ? "cuda" : "reference";
        run::Options with = options(loop + ", threads " + std::to_string(n), n);
        with.backend = backend;
        expect_again(with.directory.filename(), computed(with));
      }
}

INSTANTIATE_TEST_SUITE_P(EveryScene, ReferenceBits, testing::ValuesIn(reference_scenes()),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace moraine
