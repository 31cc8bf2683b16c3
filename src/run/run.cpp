#include "run/run.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <set>
#include <utility>

#include "case/keys.hpp"
#include "case/materials.hpp"
#include "dem/memory_order.hpp"
#include "error.hpp"
#include "memory.hpp"
#include "output/files.hpp"
#include "output/sealed.hpp"
#include "run/guard.hpp"
#include "run/needs.hpp"
#include "run/precheck.hpp"
#include "run/press.hpp"
#include "run/progress.hpp"
#include "run/record.hpp"
#include "run/schedule.hpp"
#include "run/stages.hpp"

namespace moraine::run {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

namespace {

std::atomic<bool> stop_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free);  // so a signal handler may set it

struct Files {
  fs::path output;
  bool left_by_a_run() const { return holds(checkpoint()) || holds(checkpoint_before()) || holds(series()); }
  fs::path checkpoint() const { return output / "checkpoint.h5"; }
  fs::path checkpoint_before() const { return output / "checkpoint.previous.h5"; }
  fs::path series() const { return output / "series.h5"; }
  fs::path snapshots() const { return output / "snapshots"; }
  fs::path log() const { return output / "log.txt"; }
  fs::path resolved() const { return output / "case.toml"; }
  std::vector<fs::path> all() const {
    return {checkpoint(), checkpoint_before(), series(), snapshots(), log(), resolved()};
  }
  // Anything, also what cannot be opened.
  static bool holds(const fs::path& path) {
    std::error_code failed;
    return fs::symlink_status(path, failed).type() != fs::file_type::not_found;
  }
};

void make_directories(const fs::path& path) {
  std::error_code failed;
  fs::create_directories(path, failed);
  if (failed) throw error(path.string(), ": cannot be created: ", failed.message());
}

std::string in_words(const cases::Change& c) { return c.key + " was " + c.before + " and is now " + c.now; }

std::string stability_of(const coupling::PoreWater& water, double dt) {
  const coupling::Stability s = water.stability();
  char text[160];
  std::snprintf(text, sizeof text,
                "stable up to %.3g s, %.3g of it taken (contacts %.3g rad/s, water %.3g rad/s)", s.longest_dt,
                static_cast<double>(water.interval()) * dt / s.longest_dt, s.w_sk, s.w_f);
  return text;
}

class Runner {
 public:
  Runner(const Options& options, const cases::Case& c)
      : options_(options), case_(c), files_{case_.directory / "output"} {}

  Result run() {
    if (options_.ranks) expect_room(case_, 1, options_.ranks);
    start_ = start_of(case_);  // with the engine, before anything of an earlier run is touched
    engine_ = make_engine();
    warnings_ = precheck(case_, start_, *engine_);
    describes_ = engine_->describe();  // with the threads that such a bed has
    engine_ = make_engine();           // lets go of the bed that was checked
    make_directories(files_.output);
    const output::DirectoryLock lock(files_.output);
    const bool resuming = settle_old_output();
    if (resuming && now_.finished) return {now_.rows, true};
    make_directories(files_.snapshots());
    progress_ = std::make_unique<Progress>(files_.log(), resuming, options_.quiet);
    if (!damage_.empty()) progress_->warn("warning: " + damage_);
    try {
      run_stages(resuming);
    } catch (const std::exception& e) {
      try {
        list_snapshots();
      } catch (const Error&) {  // of a full disk, say: the first error counts
      }
      std::string after;
      for (const fs::path& kept : {files_.checkpoint_before(), files_.checkpoint()})
        if (Files::holds(kept)) after = "; the last good checkpoint stays in " + kept.string();
      progress_->say("stopped: " + moraine::in_words(e) + after);
      throw error(moraine::in_words(e), after);
    }
    return {now_.rows, false};
  }

 private:
  std::unique_ptr<dem::Engine> make_engine() const {
    return dem::make_engine(options_.backend, options_.threads, options_.ranks);
  }

  // Resumes, refuses or clears what an earlier run has left. True if the run goes on from a checkpoint.
  bool settle_old_output() {
    if (options_.force) {
      for (const fs::path& p : files_.all()) {
        std::error_code failed;
        fs::remove_all(p, failed);
        if (failed && failed != std::errc::not_a_directory)
          throw error(p.string(), ": cannot be removed: ", failed.message());
      }
      return false;
    }
    expect_no_results(options_);
    const fs::path newest = files_.checkpoint(), before = files_.checkpoint_before();
    if (!Files::holds(newest) && !Files::holds(before)) return false;  // cut off before its first checkpoint
    try {
      accept(newest);
    } catch (const output::Damaged& e) {
      damage_ = e.what();
      if (!Files::holds(before))
        throw error(damage_, "; there is no checkpoint before it: use --force to run anew");
      try {
        accept(before);
      } catch (const output::Damaged& also) {
        throw error(damage_, "; ", also.what(), "; use --force to run anew");
      }
      damage_ += "; going on from the checkpoint before it, " + before.string();
      std::error_code failed;
      fs::rename(before, newest, failed);  // or the next one would push the good one out
      if (failed)
        throw error(newest.string(), ": cannot be replaced by ", before.string(), ": ", failed.message());
    }
    return true;
  }

  void accept(const fs::path& checkpoint) {
    start_.before = {};  // the grains are those of the checkpoint
    now_ = output::read_checkpoint(checkpoint);
    const std::string refused = changed_physics(now_.case_text, case_);
    if (!refused.empty())
      throw error(checkpoint.string(), ": belongs to another version of this case: ", refused,
                  "; undo the change, or use --force to run anew");
    for (const fs::path& file : input_files(case_))
      if (now_.inputs.find(input(file)) == now_.inputs.npos)
        throw error(checkpoint.string(), ": the run began with another ", file.string(),
                    ", which has changed since; undo the change, or use --force to run anew");
    const auto stages = static_cast<std::int64_t>(case_.stages.size());
    if (now_.stage < 0 || now_.stage >= stages || now_.rows.empty())
      throw error(checkpoint.string(), ": stands in stage ", now_.stage, " of ", stages,
                  " (counted from 0) with ", now_.rows.size(),
                  " rows; expected one of the stages and a row; use --force to run anew");
    // What is no physics may be another since the checkpoint was written.
    for (const cases::Change& c : cases::changes(now_.case_text, case_)) changes_.push_back(in_words(c));
    now_.scene.neighbour_margin = case_.neighbour_margin;
    now_.water_settings.solver = coupling::Solver(int(case_.fluid.solver));
    now_.water_settings.tolerance = case_.fluid.tolerance;
  }

  // Snapshots later than the checkpoint are taken again, maybe at other times.
  void remove_later_snapshots() {
    std::set<std::string> kept;
    for (const output::SnapshotInfo& s : now_.snapshots) kept.insert(s.file);
    for (const auto& entry : fs::directory_iterator(files_.snapshots()))
      if (entry.path().extension() == ".h5" && !kept.contains(entry.path().filename().string()))
        fs::remove(entry.path());
  }

  void run_stages(bool resuming) {
    if (!resuming) now_ = std::exchange(start_.before, {});
    now_.case_text = case_.resolved, now_.inputs = start_.inputs;
    now_.materials = cases::join(cases::material_names(case_), ", ");
    if (resuming) remove_later_snapshots(), all_listed_ = false;  // lists lag behind the snapshots
    now_.version = MORAINE_VERSION;
    const std::string header =
        "# moraine " MORAINE_VERSION ", " + describes_ + ", seed " + std::to_string(case_.grains.seed) + "\n";
    output::write_text(files_.resolved(), header + case_.resolved);
    progress_->say((resuming ? "resumed: " : "") +
                   (case_.title.empty() ? case_.directory.string() : case_.title) + ": " +
                   std::to_string(now_.state.size()) + " grains, " + describes_);
    if (!resuming && !start_.note.empty()) progress_->say(start_.note);
    for (const std::string& c : changes_) progress_->say("changed: " + c);
    for (const std::string& w : warnings_) progress_->say("warning: " + w);
    series_ = std::make_unique<output::Series>(files_.series(), now_.rows, case_.has_water(), case_.presses(),
                                               case_.has_histories());

    for (auto k = static_cast<std::size_t>(now_.stage); k < case_.stages.size(); ++k)
      run_stage(k, resuming), resuming = false;
    list_snapshots();
    now_.finished = true;
    save();
    series_.reset();
    progress_->say("finished: " + files_.output.string());
    progress_->log(summary(case_.stages, now_.rows));
  }

  void run_stage(std::size_t index, bool resuming) {
    now_.stage = static_cast<std::int64_t>(index);
    Stage stage = resuming ? describe(case_, index, now_) : prepare(case_, index, start_, now_);
    water_ = fill(stage, now_.state, now_.water, /*under_way=*/stage.goes_on);
    engine_->load(stage.scene, now_.state, water_.get());
    if (!resuming) {
      for (const std::string& w : stage.warnings) warn(w);
      take_state();
      now_.scene = stage.scene;
      if (case_.automatic_dt && !stage.goes_on) {
        now_.critical_at = -steps_between_estimates;
        follow_bed(stage);
      }
      loads_ = dem::loads_of(stage.scene, now_.state);
      begin(stage);
      record(stage);
      snapshot(stage);
      loads_ = {};
      if (presses(stage) && now_.state.step % steps_between_presses == 0) press(stage);
      if (stage.goes_on && looks_at_order(stage, now_.state.step, options_.ordering.steps))
        renew_order(stage);
      if (case_.automatic_dt && stage.goes_on) follow_bed(stage);  // as after any record
      if (index == 0) save();
    }
    char text[200];
    std::int64_t step = now_.state.step;
    const std::int64_t steps = last_step(stage) - stage.first_step;
    std::snprintf(text, sizeof text, "stage %s: %lld steps of %.3g s%s%s", stage.name.c_str(),
                  static_cast<long long>(steps), stage.scene.dt,
                  case_.automatic_dt ? ", which follows the bed" : "",
                  stage.goes_on && !resuming ? "; goes on as the one before" : "");
    progress_->say(text);
    if (water_) progress_->say(water_->describe() + "; " + stability_of(*water_, stage.scene.dt));
    said_outside_.clear();
    progress_->begin(stage.name, step - stage.first_step, steps, 0);

    Guard guard(case_.guards, stage, now_.rows, now_.start);
    std::int64_t slice = at_exchange(stage, 64);  // steps between looks at the clock
    for (bool ended = step >= last_step(stage); !ended;) {
      const Event event = next_event(stage, step);
      const std::int64_t look = at_exchange(stage, (step / guard.every() + 1) * guard.every());
      std::int64_t until = std::min({event.step, look, step + slice});
      const std::int64_t estimate = now_.critical_at + steps_between_estimates;
      if (case_.automatic_dt) until = std::min(until, estimate);
      const std::int64_t jump = (step / steps_between_presses + 1) * steps_between_presses;
      if (presses(stage)) until = std::min(until, jump);
      until = std::min(until, next_look_at_order(step, options_.ordering.steps));
      until = at_exchange(stage, until);
      const auto began = Clock::now();
      const bool due = until == event.step;
      due ? advance_to_record(stage, step, until) : advance(stage, step, until);
      if (seconds_since(began) < 0.1 && until == step + slice) slice *= 2;
      step = until;
      ended = due && event.end;
      if (step == look && !due) take_state();
      if (due || step == look) guard.check(now_.state, due ? &loads_ : nullptr);
      if (due) {
        if (event.series) record(stage);
        if (event.snapshot) snapshot(stage);
        loads_ = {};
      }
      if (Clock::now() >= next_list_) list_snapshots();
      if (presses(stage) && !ended && step == jump) press(stage);
      if (!ended && looks_at_order(stage, step, options_.ordering.steps)) renew_order(stage);
      if (case_.automatic_dt && !ended && (due || step == estimate)) follow_bed(stage);
      const std::int64_t done = step - stage.first_step;
      if (options_.on_progress) options_.on_progress(index, done, std::max<std::int64_t>(done, steps));
      progress_->show({done, stage.time(step), now_.rows.back().unbalanced_force});
      if (water_ && (due || step == look)) say_outside(ended);
      if (ended && water_) progress_->say("water, " + water_->solver());
      if (ended && stage.pressure > 0) say_stress(stage);
      const bool stop = stop_requested;
      if (stop || ended || seconds_since(saved_) > case_.output.checkpoint_interval) {
        if (!due) take_state();
        if (due || guard.finds_healthy(now_.state)) save();
      }
      if (stop)
        throw error("interrupted at step ", done, " of stage ", stage.name, "; --resume goes on from here");
    }
  }

  // Of a press that has not come to its pressure.
  void say_stress(const Stage& stage) {
    const output::Row& row = now_.rows.back();
    for (const double stress : {row.stress_x, row.stress_y, row.stress_z})
      if (std::abs(stress - stage.pressure) > 0.05 * stage.pressure) {
        progress_->say(text("warning: stage ", stage.name, " ends with ", row.stress_x, ", ", row.stress_y,
                            " and ", row.stress_z,
                            " Pa along x, y and z, not with pressure = ", stage.pressure,
                            " Pa; a longer duration or a larger strain_rate would get nearer"));
        return;
      }
  }

  void warn(const std::string& words) {
    if (std::find(warnings_.begin(), warnings_.end(), words) == warnings_.end())
      progress_->say("warning: " + words);
  }

  // What the rows of the stage count from.
  void begin(const Stage& stage) {
    output::StageStart& start = now_.start;
    start.time = now_.rows.empty() ? 0 : now_.rows.back().time;
    start.energy = dem::observe(stage.scene, now_.state, loads_).energy.total();
    start.ledger = now_.state.ledger;
    start.drained_top = now_.water.drained_top, start.drained_bottom = now_.water.drained_bottom;
    start.water_dissipated = now_.water.dissipated;
  }

  // The time step from here on.
  void follow_bed(Stage& stage) {
    take_state();
    if (now_.state.step == now_.critical_at + steps_between_estimates) {
      now_.critical_step = critical_step(stage.scene, now_.state);
      now_.critical_at = now_.state.step;
    }
    fit_step(stage, now_.state, case_.safety * now_.critical_step);
    engine_->load(stage.scene, now_.state);
    now_.scene = stage.scene;
  }

  // The sides jump. Their work is what the springs then hold more, and slip what these let go at once; what
  // rows count from moves by that, as the engine's ledger begins anew.
  void press(Stage& stage) {
    take_state();
    dem::State& s = now_.state;
    const dem::Vec3d factor = next_press(stage, s);
    const dem::Ledger before = s.ledger;
    const double kinetic = dem::kinetic_energy(stage.scene, s);
    const dem::SpringEnergy springs = dem::spring_energy(stage.scene, s);
    dem::deform(stage.scene, s, factor);
    const double carried = dem::spring_energy(stage.scene, s).tangential;
    engine_->load(stage.scene, s);
    take_state();
    now_.scene = stage.scene;
    const dem::SpringEnergy after = dem::spring_energy(stage.scene, s);
    const double slip = carried - after.tangential;
    const double work = after.normal + carried - springs.normal - springs.tangential +
                        dem::kinetic_energy(stage.scene, s) - kinetic;
    dem::Ledger& from = now_.start.ledger;
    from.slip += s.ledger.slip - before.slip - slip;
    from.viscous += s.ledger.viscous - before.viscous;
    from.planes += s.ledger.planes - before.planes - work;
  }

  // Grains that have sheared past one another are sorted in memory anew. The water goes on as on a restart.
  void renew_order(Stage& stage) {
    take_state();
    std::vector<dem::Vec3d>* const map = water_ ? &now_.water.x_map : nullptr;
    if (!dem::renew_order(stage.scene, now_.state, options_.ordering.lost, map)) return;
    auto water = fill(stage, now_.state, now_.water, /*under_way=*/true);
    engine_->load(stage.scene, now_.state, water.get());
    water_ = std::move(water);
  }

  // From one step to another.
  void advance(Stage& stage, std::int64_t step, std::int64_t until) {
    run::advance(*engine_, stage.scene, stage.histories, step, until);
    now_.scene.bodies = stage.scene.bodies;
  }

  // With pore water the last interval between exchanges step by step, for the mean loads over it. Same bits
  // as in one go.
  void advance_to_record(Stage& stage, std::int64_t step, std::int64_t until) {
    const std::int64_t m = std::max<std::int64_t>(1, stage.scene.exchange_interval);
    advance(stage, step, until - (m - 1));
    take_state();
    loads_ = dem::loads_of(stage.scene, now_.state);
    for (std::int64_t k = 1; k < m; ++k) {
      advance(stage, until - m + k, until - m + k + 1);
      take_state();
      dem::add(loads_, dem::loads_of(stage.scene, now_.state));
    }
    loads_ = dem::mean(std::move(loads_), m);
  }

  // When the first grains leave, and how many have at the end.
  void say_outside(bool ended) {
    const std::string outside = water_->outside();
    if (outside.empty() || outside == said_outside_ || !(said_outside_.empty() || ended)) return;
    progress_->say("warning: outside the water: " + outside);
    said_outside_ = outside;
  }

  void record(const Stage& stage) {
    now_.rows.push_back(row_of(static_cast<std::size_t>(now_.stage), stage, now_.state, loads_, now_.start));
    if (water_) add_water(now_.rows.back(), stage, *water_, now_.start);
    if (!water_ && case_.has_water()) now_.rows.back().total_friction = now_.rows.back().shear_friction;
    series_->append(now_.rows.back());
  }

  void snapshot(const Stage& stage) {
    // By number within the stage; the interval may have changed on the way.
    char place[32], number[32];
    std::snprintf(place, sizeof place, "%02d-", static_cast<int>(now_.stage) + 1);
    const std::string name = place + stage.name + "-";
    const auto count = std::count_if(now_.snapshots.begin(), now_.snapshots.end(),
                                     [&](const auto& s) { return s.file.starts_with(name); });
    std::snprintf(number, sizeof number, "%06lld", static_cast<long long>(count));
    now_.snapshots.push_back(output::write_snapshot(
        files_.snapshots(), name + number, now_.rows.back().time, stage.scene, now_.state,
        water_ ? std::optional(water_->fields()) : std::nullopt, &loads_, now_.start));
    all_listed_ = false;
  }

  // For ParaView. The lists are written whole, so that no reader meets half of one; the more snapshots, the
  // longer that takes. So it waits until it has taken but a fiftieth of the time.
  void list_snapshots() {
    if (all_listed_) return;
    const auto began = Clock::now();
    output::write_xdmf(files_.snapshots(), now_.snapshots);
    all_listed_ = true;
    next_list_ = Clock::now() + 50 * (Clock::now() - began);
  }

  void take_state() {
    now_.state = {};  // gone before the next one comes
    now_.state = engine_->state();
    now_.water = water_ ? water_->state() : coupling::WaterState{};
  }

  void save() {
    output::write_checkpoint(files_.checkpoint(), now_, files_.checkpoint_before());
    saved_ = Clock::now();
  }

  Options options_;
  cases::Case case_;
  Files files_;
  Start start_;
  output::Checkpoint now_;
  dem::Loads loads_;  // of the step, or with pore water over the interval, that led to the present record
  std::unique_ptr<coupling::PoreWater> water_;  // of the present stage
  std::unique_ptr<dem::Engine> engine_;
  std::unique_ptr<Progress> progress_;
  std::vector<std::string> warnings_, changes_;
  std::string describes_;     // the engine
  std::string damage_;        // of the checkpoint that was to be resumed from
  std::string said_outside_;  // in this stage
  std::unique_ptr<output::Series> series_;
  Clock::time_point saved_ = Clock::now(), next_list_ = saved_;
  bool all_listed_ = true;
};

}  // namespace

void catch_signals() {
  std::signal(SIGINT, [](int) { stop_requested = true; });
  std::signal(SIGTERM, [](int) { stop_requested = true; });
  std::signal(SIGUSR1, [](int) { stop_requested = true; });  // mpirun passes this one on
}
bool stopping() { return stop_requested; }

void expect_no_results(const Options& options) {
  const Files files{options.directory / "output"};
  if (!options.resume && !options.force && files.left_by_a_run())
    throw error(files.output.string(),
                ": holds the results of an earlier run; use --resume to go on from its checkpoint, or "
                "--force to replace it");
}

std::string changed_physics(const std::string& resolved_before, const cases::Case& now) {
  std::string words;
  for (const cases::Change& c : cases::changes(resolved_before, now))
    if (c.physics) words += (words.empty() ? "" : "; ") + in_words(c);
  return words;
}

Result run_one(const Options& options, const cases::Case& c) { return Runner(options, c).run(); }

void run_case(const Options& options) {
  catch_signals();
  const cases::Case c = cases::load(options.directory, options.overrides);
  const Result result = run_one(options, c);
  if (result.was_finished)
    std::cerr << Files{c.directory / "output"}.checkpoint().string() << ": the case has finished already\n";
  std::cout << summary(c.stages, result.rows);
}

}  // namespace moraine::run
