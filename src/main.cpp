// moraine: grain-scale till mechanics. Each command reads a case directory; see README.md.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>

#include "case/case.hpp"
#include "case/import_sphere.hpp"
#include "error.hpp"
#include "run/run.hpp"
#include "run/sweep.hpp"

using namespace moraine;

int main(int argc, char** argv) {
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

  CLI::App* check = app.add_subcommand("check", "check a case and print what would run");
  takes_case(check);

  CLI::App* keys = app.add_subcommand("keys", "list all keys of case.toml");

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

  CLI11_PARSE(app, argc, argv);

  // 3. Do it, or say in one line why not.
  try {
    for (const std::string& set : sets) {
      const auto equals = set.find('=');
      if (equals == std::string::npos) throw error("--set ", set, ": expected KEY=VALUE");
      options.overrides.push_back({set.substr(0, equals), set.substr(equals + 1)});
    }
    options.backend = backend == "cpu"    ? dem::Backend::cpu
                      : backend == "cuda" ? dem::Backend::cuda
                                          : dem::Backend::automatic;
    if (*run) run::run_case(options);
    if (*sweep) run::sweep_case(options, at_once);
    if (*check) run::check_case(options);
    if (*keys) std::cout << cases::reference();
    if (*bench) run::bench_case(options, stage, steps);
    if (*import) cases::import_sphere(file, directory);
  } catch (const std::exception& e) {
    std::cerr << "moraine: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
