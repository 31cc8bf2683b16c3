// Cases that Python builds: values and texts judged as those of a case.toml, `moraine check`, sweeps.
#include <nanobind/nanobind.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstdlib>
#include <exception>
#include <memory>
#include <utility>

#include "bindings.hpp"
#include "case/read.hpp"
#include "error.hpp"
#include "run/run.hpp"
#include "run/sweep.hpp"

namespace nb = nanobind;
using namespace moraine;
using std::string;
using Sets = std::vector<std::pair<string, string>>;

namespace {

run::Options options_of(const string& directory, const Sets& sets, int threads, const string& backend) {
  run::Options options;
  options.directory = directory, options.threads = threads;
  for (const auto& [key, value] : sets) options.overrides.push_back({key, value});
  if (threads < 0 || threads > 4096) throw error("threads = ", threads, ": expected 0 (all) .. 4096");
  if (backend != "cpu" && backend != "cuda" && backend != "auto")
    throw error("backend = \"", backend, "\": expected cpu | cuda | auto");
  options.backend = backend == "cpu"    ? dem::Backend::cpu
                    : backend == "cuda" ? dem::Backend::cuda
                                        : dem::Backend::automatic;
  return options;
}

string check_value(const string& name, const string& toml, const string& kind) {
  return cases::to_toml(cases::read_value(name, toml, kind));
}

// What would go to the screen goes to memory.
string check_case(const string& directory, const Sets& sets, int threads, const string& backend) {
  const run::Options options = options_of(directory, sets, threads, backend);
  char* text = nullptr;
  std::size_t size = 0;
  std::FILE* const out = open_memstream(&text, &size);
  if (!out) throw error("check: there is no memory for its text");
  const auto taken = [&] {
    std::fclose(out);
    const std::unique_ptr<char, void (*)(void*)> owner(text, std::free);
    return string(text, size);
  };
  const nb::gil_scoped_release others;
  try {
    run::check_case(options, out);
  } catch (...) {
    taken();
    throw;
  }
  return taken();
}

string resolve(const string& directory, const Sets& sets) {
  return cases::load(directory, options_of(directory, sets, 0, "auto").overrides).resolved;
}

// An exception of a listener, Ctrl-C for one, stops the sweep, and is thrown when its cases have stopped.
nb::list sweep(const string& directory, const Sets& sets, int threads, const string& backend, bool resume,
               bool force, int at_once, const nb::callable& say, const nb::callable& show) {
  run::Options options = options_of(directory, sets, threads, backend);
  options.resume = resume, options.force = force;
  if (resume && force) throw error("resume and force: expected one of the two");
  std::exception_ptr failure;
  const auto heard = [&](auto&& tell) {
    const nb::gil_scoped_acquire held;
    if (failure) return;
    try {
      tell();
    } catch (...) {
      failure = std::current_exception();
    }
  };
  run::SweepListener listener;
  listener.say = [&](const string& line) { heard([&] { say(line); }); };
  listener.show = [&](double done, const string& line) { heard([&] { show(done, line); }); };
  listener.stop = [&] {
    heard([] {
      if (PyErr_CheckSignals() != 0) throw nb::python_error();
    });
    return bool(failure);
  };
  std::vector<run::SweptCase> cases;
  {
    const nb::gil_scoped_release others;
    cases = run::sweep(options, at_once, listener);
  }
  if (failure) std::rethrow_exception(failure);
  nb::list rows;
  for (const run::SweptCase& one : cases) {
    nb::dict row;
    row["name"] = one.name, row["directory"] = one.directory.string(), row["values"] = one.values;
    row["state"] = one.state, row["message"] = in_python(one.message);
    rows.append(row);
  }
  return rows;
}

}  // namespace

void bind_cases(nb::module_& m) {
  using namespace nb::literals;
  m.def(
      "check_value", &check_value, "name"_a, "toml"_a, "kind"_a = "",
      "A value of a key as TOML, judged as in a case.toml; returns it in SI, as TOML. name: \"contact.k_n\", "
      "\"stage.shear.strain\"; kind: of that stage. Raises Error.");
  m.def("fill", &cases::filled, "directory"_a, "text"_a,
        "The case.toml `text` of that directory with what it extends, its preset and all defaults, in SI; it "
        "may be "
        "unfinished. Raises Error.");
  m.def("resolve", &resolve, "directory"_a, "sets"_a = Sets{},
        "The case in a directory, with these (key, value) set, as a case.toml with all keys in SI. Raises "
        "Error.");
  m.def("check_case", &check_case, "directory"_a, "sets"_a = Sets{}, "threads"_a = 0, "backend"_a = "auto",
        "What `moraine check` prints. Raises Error.");
  m.def("sweep", &sweep, "directory"_a, "sets"_a, "threads"_a, "backend"_a, "resume"_a, "force"_a,
        "at_once"_a, "say"_a, "show"_a,
        "Runs the case with each of the values, as `moraine sweep` does; say(line) and show(done, line) hear "
        "of it. A "
        "dict for each case: name, directory, values, state, message.");
}
