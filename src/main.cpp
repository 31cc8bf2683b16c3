// moraine: grain-scale till mechanics. Each command reads a case directory; see docs/manual.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <memory>
#include <string_view>

#include "case/case.hpp"
#include "case/import_sphere.hpp"
#include "case/keys.hpp"
#include "error.hpp"
#include "memory.hpp"
#include "ranks/ranks.hpp"
#include "run/grain_table.hpp"
#include "run/rank.hpp"
#include "run/run.hpp"
#include "run/sweep.hpp"

using namespace moraine;

namespace {

constexpr std::string_view overview_text =
#include "overview.inc"
    ;
constexpr std::string_view overview = overview_text.substr(1);  // without the first end of line

// Those of the script ./moraine, see there.
const std::vector<std::string> launcher_commands = {"watch",     "figures", "report",
                                                    "reproduce", "docs",    "test"};

std::string did_you_mean(const std::string& word, const std::vector<std::string>& known) {
  std::string near = cases::nearest(word, known);
  for (const std::string& k : known)
    if (k.starts_with(word)) near = k;
  return near.empty() ? "" : "; did you mean " + near + "?";
}

// What is wrong with the words typed; the parser's own words where it knows better.
Error wrong_words(CLI::App& app, const std::string& first, const CLI::ParseError& e) {
  const auto chosen = app.get_subcommands();
  std::vector<std::string> commands = launcher_commands;
  for (const CLI::App* command : app.get_subcommands(nullptr)) commands.push_back(command->get_name());
  if (chosen.empty() && !first.starts_with('-')) {
    const bool launchers = std::count(launcher_commands.begin(), launcher_commands.end(), first) > 0;
    if (launchers)
      return error(first, ": a command of the launcher, ./moraine ", first, ", in the folder of the sources");
    const std::string near = did_you_mean(first, commands);
    return error(first, ": unknown command", near.empty() ? "; known: " + cases::join(commands, ", ") : near);
  }
  CLI::App& where = chosen.empty() ? app : *chosen[0];
  const std::string of = chosen.empty() ? "" : " of " + where.get_name();
  const auto left = where.remaining();
  for (const std::string& word : left) {
    if (!word.starts_with('-')) continue;
    if (word.starts_with("--ranks"))
      return error(
          "--ranks: an option of the launcher, ./moraine, in the folder of the sources; else start it by "
          "mpirun: "
          "mpirun -n 8 moraine run CASE");
    std::vector<std::string> options;
    if (chosen.empty()) options.push_back("--cuda");  // of the launcher
    for (const CLI::Option* option : where.get_options())
      for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
    const std::string near = did_you_mean(word, options);
    return error(word, ": unknown option", of,
                 near.empty() ? "; known: " + cases::join(options, ", ") : near);
  }
  if (!left.empty()) return error(left[0], ": one word too many for ", where.get_name());
  std::string words = e.what();
  while (words.ends_with('\n')) words.pop_back();
  return error(words, "; see moraine ", chosen.empty() ? "" : where.get_name() + " ", "--help");
}

}  // namespace

int main(int argc, char** argv) {
  // What a thread of a team throws comes to no catch.
  std::set_terminate([] {
    try {
      if (const auto thrown = std::current_exception()) std::rethrow_exception(thrown);
    } catch (const std::exception& e) {
      std::cerr << "moraine: " << in_words(e) << std::endl;
    }
    std::_Exit(1);
  });
#if defined(__AVX2__)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) {
    std::fputs(
        "moraine was built for processors with AVX2 and FMA, and this one lacks them: rebuild it here, with "
        "-DMORAINE_ARCH=x86-64\n",
        stderr);
    return 1;
  }
#endif
  CLI::App app{"Grain-scale till mechanics: shears beds of grains under a stress-controlled wall.",
               "moraine"};
  app.set_version_flag("--version", "moraine " MORAINE_VERSION);
  app.require_subcommand(1);

  // 1. What the commands have in common: a case, overrides, a processor.
  run::Options options;
  std::vector<std::string> sets;
  std::string backend = "auto";
  const auto takes_case = [&](CLI::App* command) {
    command->add_option("CASE", options.directory, "directory that holds a case.toml")->required();
    command
        ->add_option("--set", sets,
                     "override a key: --set model.f=0.05 --set \"stage.shear.normal_stress=40 kPa\"")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    command->add_option("--backend", backend, "processor")
        ->check(CLI::IsMember({"cpu", "cuda", "auto"}))
        ->capture_default_str();
    command->add_option("--threads", options.threads, "CPU threads; 0: all cores")
        ->check(CLI::Range(0, 4096))
        ->capture_default_str();
  };

  // 2. The commands.
  const auto writes_results = [&](CLI::App* command) {
    command->add_flag("--resume", options.resume, "go on from the last checkpoint");
    command->add_flag("--force", options.force, "replace the results of an earlier run")
        ->excludes("--resume");
    command->add_flag("--quiet", options.quiet, "no progress");
  };
  CLI::App* run = app.add_subcommand("run", "run a case; results go to CASE/output");
  takes_case(run);
  writes_results(run);

  CLI::App* sweep = app.add_subcommand("sweep",
                                       "run a case with each value of a list, several at once: --set "
                                       "normal_stress=10,20,40kPa; results go to CASE/sweep");
  takes_case(sweep);
  writes_results(sweep);
  int at_once = 0;
  sweep->add_option("--at-once", at_once, "cases at once; 0: one for each CPU thread, or all on a GPU")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str();

  CLI::App* replay = app.add_subcommand(
      "replay",
      "run a case anew with the loads that were changed from outside, in CASE/replay, and compare all bits");
  takes_case(replay);
  writes_results(replay);

  CLI::App* check = app.add_subcommand("check", "check a case and print what would run");
  takes_case(check);

  CLI::App* keys = app.add_subcommand("keys", "list all keys of case.toml, or those about something");
  std::vector<std::string> about;
  keys->add_option("WORD", about, "what the key has in its name or meaning; of several words all");
  std::string keys_format = "text";
  keys->add_option("--format", keys_format,
                   "text; or json: all keys and the columns of series.h5, for programs")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();

  CLI::App* bench =
      app.add_subcommand("bench", "time some steps of a case without output; prints one line of JSON");
  takes_case(bench);
  std::int64_t steps = 1000;
  std::string stage;
  bench->add_option("--steps", steps, "steps to time")->check(CLI::PositiveNumber)->capture_default_str();
  bench->add_option("--stage", stage, "stage to time; default: the first");

  CLI::App* import =
      app.add_subcommand("import-sphere", "make a case from a binary file of the program sphere");
  std::string file, directory;
  import->add_option("FILE", file, "binary file, version 1.03 to 2.15")->required();
  import->add_option("CASE", directory, "directory to create")->required();

  CLI::App* exporting = app.add_subcommand("export", "write the grains of a case as others read them");
  std::string format = "csv", target;
  exporting->add_option("CASE", options.directory, "directory that holds results")->required();
  exporting
      ->add_option("--format", format, "csv: a table, also to start a case with; lammps: a data file; vtk")
      ->check(CLI::IsMember({"csv", "lammps", "vtk"}))
      ->capture_default_str();
  exporting->add_option("--output", target, "file to write; without it the screen");

  // 3. Do it, or say in one line why not. Of several ranks the first does it, and the others serve it.
  if (argc == 1) {
    std::cout << overview;
    return 0;
  }
  try {
    const std::unique_ptr<Ranks> ranks = connect_ranks();
    if (ranks && ranks->rank() > 0) return run::serve(*ranks);
    const run::Served served(ranks.get());
    options.ranks = ranks.get();
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
      if (e.get_exit_code() == 0) return app.exit(e);  // --help, --version
      throw wrong_words(app, argv[1], e);
    }
    for (const std::string& set : sets) {
      const auto equals = set.find('=');
      if (equals == std::string::npos) throw error("--set ", set, ": expected KEY=VALUE");
      options.overrides.push_back({set.substr(0, equals), set.substr(equals + 1)});
    }
    options.backend = backend == "cpu"    ? dem::Backend::cpu
                      : backend == "cuda" ? dem::Backend::cuda
                                          : dem::Backend::automatic;
    if (*run) run::run_case(options);
    if (*sweep && ranks)
      throw error(
          "sweep: runs whole cases side by side in one process; start it without mpirun, or run one case on ",
          ranks->size(), " ranks");
    if (*sweep) run::sweep_case(options, at_once);
    if (*replay) run::replay_case(options);
    if (*check) run::check_case(options);
    if (*keys) {
      if (keys_format == "json" && !about.empty())
        throw error("keys ", about[0], " --format json: json has all keys; leave out the word");
      std::cout << (keys_format == "json" ? cases::reference_as_json() : cases::reference(about));
    }
    if (*bench) run::bench_case(options, stage, steps);
    if (*exporting) run::export_grains(options.directory, format, target);
    if (*import) cases::import_sphere(file, directory);
  } catch (const std::exception& e) {
    std::cerr << "moraine: " << in_words(e) << "\n";
    return 1;
  }
  return 0;
}
