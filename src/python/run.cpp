// A run in this process: Runner with its bed as NumPy arrays. python/moraine/run.py has what people call.
#include <nanobind/ndarray.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <limits>

#include "bindings.hpp"
#include "error.hpp"
#include "run/runner.hpp"

namespace nb = nanobind;
using namespace moraine;

namespace {

template <class T>
using Array = nb::ndarray<nb::numpy, T>;

// The grains at one step. Arrays are views of them and keep them.
struct Grains {
  dem::Scene scene;
  dem::State state;
};
using Shared = std::shared_ptr<Grains>;

// With what touches and what fills the pores.
struct Bed : Grains {
  std::optional<coupling::WaterFields> water;
  std::optional<dem::Loads> known_loads;
  std::vector<double> known_pressure;

  const dem::Loads& loads() {
    if (!known_loads) known_loads = dem::loads_of(scene, state);
    return *known_loads;
  }
};
using SharedBed = std::shared_ptr<Bed>;

// Of `of`, whose memory stays as long as any view of it. Read only.
template <class T>
Array<const T> view(const Shared& of, const T* first, std::initializer_list<std::size_t> shape,
                    std::initializer_list<std::int64_t> strides = {}) {
  const nb::capsule owner(new Shared(of), [](void* p) noexcept { delete static_cast<Shared*>(p); });
  return Array<const T>(first, shape, owner, strides);
}
Array<const double> vectors(const Shared& bed, const std::vector<dem::Vec3d>& list) {
  static_assert(sizeof(dem::Vec3d) == 3 * sizeof(double));
  return view(bed, list.empty() ? nullptr : &list[0].x, {list.size(), 3});
}
template <class T>
Array<const T> column(const Shared& bed, const std::vector<T>& list) {
  return view(bed, list.data(), {list.size()});
}
// A member of a list of structs; V: of a vector, its first component.
template <class S, class T>
Array<const T> member(const Shared& bed, const std::vector<S>& list, T S::*which) {
  static_assert(sizeof(S) % sizeof(T) == 0);
  return view<T>(bed, list.empty() ? nullptr : &(list[0].*which), {list.size()}, {sizeof(S) / sizeof(T)});
}
template <class S>
Array<const double> member(const Shared& bed, const std::vector<S>& list, dem::Vec3d S::*which) {
  static_assert(sizeof(S) % sizeof(double) == 0);
  return view<double>(bed, list.empty() ? nullptr : &(list[0].*which).x, {list.size(), 3},
                      {sizeof(S) / sizeof(double), 1});
}

class Run {
  // What was read before the run went on.
  void forget_the_past() {
    const run::Runner& r = runner();
    const std::tuple now(r.stage_index(), r.step_number(), r.events().size());
    if (seen_ != now) grains_.reset(), bed_.reset();
    seen_ = now;
  }

  // Control-C, or what else a signal's handler in Python throws.
  bool interrupted() {
    const nb::gil_scoped_acquire python;
    if (PyErr_CheckSignals() == 0) return false;
    raised_.emplace();  // takes the error
    return true;
  }

  // While it lives no other call gets at the runner: other threads run, and signals' handlers.
  struct Busy {
    bool& busy;
    explicit Busy(bool& b) : busy(b) { busy = true; }
    ~Busy() { busy = false; }
  };

  template <class Action>
  auto guarded(Action&& action) {
    runner();  // or it is closed
    const Busy alone(busy_);
    try {
      const nb::gil_scoped_release other_threads_may_run;
      return action();
    } catch (const run::Interrupted&) {
      if (!raised_) throw;
    }
    nb::python_error raised = std::move(*raised_);
    raised_.reset();
    throw raised;
  }

 public:
  Run(const std::filesystem::path& directory, const std::vector<std::tuple<std::string, std::string>>& set,
      const std::string& backend, int threads, bool resume, bool force, bool drop_events) {
    run::Options options;
    options.directory = directory;
    for (const auto& [key, value] : set) options.overrides.push_back({key, value});
    if (backend != "auto" && backend != "cpu" && backend != "cuda")
      throw error("backend = ", backend, ": expected auto, cpu or cuda");
    if (threads < 0 || threads > 4096) throw error("threads = ", threads, ": expected 0 (all cores) to 4096");
    if (resume && force) throw error("resume and force: expected one of them at most");
    options.backend = backend == "cpu"    ? dem::Backend::cpu
                      : backend == "cuda" ? dem::Backend::cuda
                                          : dem::Backend::automatic;
    options.threads = threads, options.resume = resume, options.force = force, options.quiet = true;
    options.drop_events = drop_events;
    options.stop = [this] { return interrupted(); };
    const nb::gil_scoped_release other_threads_may_run;
    const cases::Case c = cases::load(directory, options.overrides);
    runner_.emplace(options, c);
    if (runner_->stage_ended() && !runner_->finished()) runner_->begin_stage();
  }

  std::int64_t step(std::int64_t most) {
    if (most < 0) throw error("step(", most, "): expected 0 steps or more");
    return guarded([&] {
      const std::int64_t done = runner_->step(most);
      if (runner_->stage_ended() && !runner_->finished()) runner_->begin_stage();
      return done;
    });
  }
  // Where the present one has ended, as after an interruption at its last step.
  void begin_stage() {
    guarded([&] {
      if (runner_->stage_ended()) runner_->begin_stage();
    });
  }
  void checkpoint() {
    guarded([&] { runner_->checkpoint(); });
  }
  void set(const std::string& key, const std::string& value) {
    const double number = run::load_value(key, value);
    guarded([&] { runner_->set(key, number); });
  }
  // The results are closed, without a checkpoint of its own.
  void close() {
    if (runner_) runner();  // or it is busy
    grains_.reset(), bed_.reset(), runner_.reset();
  }

  Shared grains() {
    forget_the_past();
    if (bed_) return bed_;
    if (!grains_) {
      const Busy alone(busy_);
      const nb::gil_scoped_release other_threads_may_run;
      grains_ = std::make_shared<Grains>(Grains{runner_->stage().scene, runner_->grains()});
    }
    return grains_;
  }
  SharedBed bed() {
    forget_the_past();
    if (!bed_) {
      const Busy alone(busy_);
      const nb::gil_scoped_release other_threads_may_run;
      bed_ = std::make_shared<Bed>(Bed{{runner_->stage().scene, runner_->state()}, runner_->water(), {}, {}});
    }
    return bed_;
  }

  nb::dict latest() {
    nb::dict row;
    const auto& columns = output::columns();
    const auto* numbers = reinterpret_cast<const double*>(&runner().rows().back());
    const cases::Case& c = runner().what();
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const bool is_there = k < output::dry_columns ||
                            (k < output::side_columns    ? c.has_water()
                             : k < output::asked_columns ? c.presses()
                                                         : c.has_histories() || !runner().events().empty());
      if (is_there) row[columns[k].name] = numbers[k];
    }
    return row;
  }

  nb::list events() {
    nb::list list;
    for (const run::LoadEvent& e : runner().events())
      list.append(nb::make_tuple(runner().what().stages[static_cast<std::size_t>(e.stage)].name, e.step,
                                 e.key, e.value));
    return list;
  }

  const run::Runner& runner() const {
    if (!runner_) throw error("the run is closed; open it again with resume = True");
    if (busy_)
      throw error(
          "the run is in the middle of another call, of another thread or one that a signal has "
          "interrupted; expected one call at a time");
    return *runner_;
  }

 private:
  run::Runner& runner() { return const_cast<run::Runner&>(std::as_const(*this).runner()); }

  std::optional<run::Runner> runner_;
  bool busy_ = false;  // changed and read with the GIL
  std::optional<nb::python_error> raised_;
  Shared grains_;
  SharedBed bed_;
  std::tuple<std::size_t, std::int64_t, std::size_t> seen_;
};

std::string kind_of(const run::Runner& r) {
  static const char* const names[] = {"settle", "consolidate", "shear", "shear_stress", "uniaxial", "press"};
  return names[static_cast<int>(r.stage().kind)];
}

}  // namespace

void bind_run(nb::module_& m) {
  nb::class_<Grains>(m, "Grains",
                     "The grains at one step. Arrays are read-only views of one copy of them, and stay as "
                     "they are while the\n"
                     "run goes on. They stand in memory order: row k is grain ids[k], and the order may "
                     "change between steps.")
      .def_prop_ro(
          "ids", [](Shared b) { return column(b, b->state.id); }, "row of each grain in the files; n",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "radii", [](Shared b) { return column(b, b->state.r); }, "m; n", nb::rv_policy::automatic)
      .def_prop_ro(
          "positions", [](Shared b) { return vectors(b, b->state.x); },
          "m; n x 3. Grains that have left by a periodic side are not taken back into the box",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "velocities", [](Shared b) { return vectors(b, b->state.v); },
          "m/s; n x 3, half a step earlier than positions", nb::rv_policy::automatic)
      .def_prop_ro(
          "spins", [](Shared b) { return vectors(b, b->state.omega); }, "rad/s; n x 3, half a step earlier",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "rotations", [](Shared b) { return vectors(b, b->state.rotation); },
          "rad; n x 3, gathered since the stage began", nb::rv_policy::automatic)
      .def_prop_ro(
          "forces", [](Shared b) { return vectors(b, b->state.force); },
          "N; n x 3, by contacts, without gravity", nb::rv_policy::automatic)
      .def_prop_ro(
          "starts", [](Shared b) { return vectors(b, b->state.x_start); },
          "m; n x 3, where displacements are counted from", nb::rv_policy::automatic)
      .def_prop_ro(
          "roles",
          [](Shared b) {
            return view(b, reinterpret_cast<const std::uint8_t*>(b->state.part_of.data()),
                        {b->state.part_of.size()});
          },
          "0 free, 1 lower layer, 2 driven layer; n", nb::rv_policy::automatic)
      .def_prop_ro(
          "box", [](Shared b) { return view(b, &b->scene.box.x, {3}); },
          "m; sides along x, y, z; z counts where it is periodic", nb::rv_policy::automatic)
      .def_prop_ro(
          "top_wall", [](Shared b) { return b->state.wall_z(); }, "m, its height; 0: none",
          nb::rv_policy::automatic);

  nb::class_<Bed, Grains>(m, "Bed",
                          "The grains at one step with their contacts and the pore water; see Grains.")
      .def_prop_ro(
          "pressures",
          [](SharedBed b) {
            if (b->known_pressure.empty()) b->known_pressure = dem::grain_pressure(b->state, b->loads());
            return column(b, b->known_pressure);
          },
          "Pa; n, sum of normal forces on a grain over its surface. Computed when first asked for",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "contact_i", [](SharedBed b) { return member(b, b->loads().contacts, &dem::ContactForce::i); },
          "row of the first grain of each contact; m. Forces are on it", nb::rv_policy::automatic)
      .def_prop_ro(
          "contact_j", [](SharedBed b) { return member(b, b->loads().contacts, &dem::ContactForce::j); },
          "row of the second grain; m", nb::rv_policy::automatic)
      .def_prop_ro(
          "contact_points",
          [](SharedBed b) { return member(b, b->loads().contacts, &dem::ContactForce::point); }, "m; m x 3",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "contact_normal_forces",
          [](SharedBed b) { return member(b, b->loads().contacts, &dem::ContactForce::f_n); },
          "N; m x 3. Computed when first asked for, as all of contacts", nb::rv_policy::automatic)
      .def_prop_ro(
          "contact_tangential_forces",
          [](SharedBed b) { return member(b, b->loads().contacts, &dem::ContactForce::f_t); }, "N; m x 3",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "contact_overlaps",
          [](SharedBed b) { return member(b, b->loads().contacts, &dem::ContactForce::overlap); }, "m; m",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "water_pressures",
          [](SharedBed b) -> std::optional<Array<const double>> {
            if (!b->water) return {};
            const auto& n = b->water->grid.n;
            return view(b, b->water->pressure.data(),
                        {static_cast<std::size_t>(n[2]), static_cast<std::size_t>(n[1]),
                         static_cast<std::size_t>(n[0])});
          },
          "Pa over hydrostatic, of the water's cells; n_z x n_y x n_x. None: dry", nb::rv_policy::automatic);

  nb::class_<Run>(m, "Run")
      .def(nb::init<const std::filesystem::path&, const std::vector<std::tuple<std::string, std::string>>&,
                    const std::string&, int, bool, bool, bool>(),
           nb::arg("directory"), nb::arg("set"), nb::arg("backend"), nb::arg("threads"), nb::arg("resume"),
           nb::arg("force"), nb::arg("drop_events"))
      .def("step", &Run::step, nb::arg("most"))
      .def("begin_stage", &Run::begin_stage)
      .def("checkpoint", &Run::checkpoint)
      .def("set", &Run::set, nb::arg("key"), nb::arg("value"))
      .def("close", &Run::close)
      .def("grains", &Run::grains)
      .def("bed", &Run::bed)
      .def("latest", &Run::latest)
      .def("events", &Run::events)
      .def_prop_ro("stage", [](const Run& r) { return r.runner().stage().name; })
      .def_prop_ro("kind", [](const Run& r) { return kind_of(r.runner()); })
      .def_prop_ro("stage_index", [](const Run& r) { return r.runner().stage_index(); })
      .def_prop_ro("stages",
                   [](const Run& r) {
                     std::vector<std::string> names;
                     for (const cases::Stage& s : r.runner().what().stages) names.push_back(s.name);
                     return names;
                   })
      .def_prop_ro("step_number", [](const Run& r) { return r.runner().done(); })
      .def_prop_ro("steps", [](const Run& r) { return r.runner().steps(); })
      .def_prop_ro("dt", [](const Run& r) { return r.runner().stage().scene.dt; })
      .def_prop_ro("stage_time",
                   [](const Run& r) { return r.runner().stage().time(r.runner().step_number()); })
      .def_prop_ro("time", [](const Run& r) { return r.runner().time(); })
      .def_prop_ro("finished", [](const Run& r) { return r.runner().finished(); })
      .def_prop_ro("was_finished", [](const Run& r) { return r.runner().was_finished(); });
}
