#include "run/run.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <iostream>

#include "error.hpp"
#include "output/files.hpp"
#include "run/guard.hpp"
#include "run/precheck.hpp"
#include "run/progress.hpp"
#include "run/record.hpp"
#include "run/schedule.hpp"
#include "run/stages.hpp"

namespace moraine::run {

namespace fs = std::filesystem;

namespace {

std::atomic<bool> stop_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free);  // so a signal handler may set it

struct Files {
  fs::path output;
  bool left_by_a_run() const { return fs::exists(checkpoint()) || fs::exists(series()); }
  fs::path checkpoint() const { return output / "checkpoint.h5"; }
  fs::path series() const { return output / "series.h5"; }
  fs::path snapshots() const { return output / "snapshots"; }
  fs::path log() const { return output / "log.txt"; }
  fs::path resolved() const { return output / "case.toml"; }
  std::vector<fs::path> all() const { return {checkpoint(), series(), snapshots(), log(), resolved()}; }
};

void make_directories(const fs::path& path) {
  std::error_code failed;
  fs::create_directories(path, failed);
  if (failed) throw error(path.string(), ": cannot be created: ", failed.message());
}

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
    start_ = start_of(case_);  // with the engine, before anything of an earlier run is touched
    engine_ = dem::make_engine(options_.backend, options_.threads);
    warnings_ = precheck(case_, start_, *engine_);
    make_directories(files_.output);
    const output::DirectoryLock lock(files_.output);
    const bool resuming = settle_old_output();
    if (resuming && now_.finished) return {now_.rows, true};
    make_directories(files_.snapshots());
    progress_ = std::make_unique<Progress>(files_.log(), resuming, options_.quiet);
    try {
      run_stages(resuming);
    } catch (const Error& e) {
      const bool kept = fs::exists(files_.checkpoint());
      const std::string after =
          kept ? "; the last good checkpoint stays in " + files_.checkpoint().string() : "";
      progress_->say(std::string("stopped: ") + e.what() + after);
      throw error(e.what(), after);
    }
    return {now_.rows, false};
  }

 private:
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
    if (!fs::exists(files_.checkpoint())) return false;  // cut off before its first checkpoint
    now_ = output::read_checkpoint(files_.checkpoint());
    if (now_.case_text != case_.resolved)
      throw error(files_.checkpoint().string(), ": belongs to another version of this case (see ",
                  files_.resolved().string(), "); undo the change, or use --force to run anew");
    return true;
  }

  void run_stages(bool resuming) {
    if (!resuming) {
      now_.case_text = case_.resolved;
      now_.state = start_.state, now_.water = start_.water;
    }
    now_.version = MORAINE_VERSION;
    const std::string header = "# moraine " MORAINE_VERSION ", " + engine_->describe() + ", seed " +
                               std::to_string(case_.grains.seed) + "\n";
    output::write_text(files_.resolved(), header + case_.resolved);
    progress_->say((resuming ? "resumed: " : "") + case_.title + ": " + std::to_string(start_.state.size()) +
                   " grains, " + engine_->describe());
    for (const std::string& w : warnings_) progress_->say("warning: " + w);
    series_ = std::make_unique<output::Series>(files_.series(), now_.rows, case_.has_water());

    for (auto k = static_cast<std::size_t>(now_.stage); k < case_.stages.size(); ++k)
      run_stage(k, resuming), resuming = false;
    now_.finished = true;
    save();
    series_.reset();
    progress_->say("finished: " + files_.output.string());
    progress_->log(summary(case_.stages, now_.rows));
  }

  void run_stage(std::size_t index, bool resuming) {
    now_.stage = static_cast<std::int64_t>(index);
    Stage stage;
    if (resuming) {
      stage = describe(case_, index, now_.scene, now_.height_0, now_.state);
      water_ = fill(stage, now_.state, now_.water, /*restart=*/true);
      engine_->load(stage.scene, now_.state, water_.get());
    } else {
      if (!now_.rows.empty()) now_.stage_start_time = now_.rows.back().time;
      dem::synchronise(now_.scene, now_.state);
      stage = prepare(case_, index, start_, now_.state);
      water_ = fill(stage, now_.state, now_.water, /*restart=*/false);
      engine_->load(stage.scene, now_.state, water_.get());
      take_state();
      now_.scene = stage.scene, now_.height_0 = stage.height_0;
      if (case_.automatic_dt) {
        now_.critical_at = -steps_between_estimates;
        follow_bed(stage);
      }
      now_.energy_0 = dem::observe(stage.scene, now_.state).energy.total();
      loads_ = dem::loads_of(stage.scene, now_.state);
      record(stage);
      snapshot(stage);
      if (index == 0) save();
    }
    char text[200];
    std::int64_t step = now_.state.step;
    const std::int64_t steps = last_step(stage);
    std::snprintf(text, sizeof text, "stage %s: %lld steps of %.3g s%s", stage.name.c_str(),
                  static_cast<long long>(steps), stage.scene.dt,
                  case_.automatic_dt ? ", which follows the bed" : "");
    progress_->say(text);
    if (water_) progress_->say(water_->describe() + "; " + stability_of(*water_, stage.scene.dt));
    said_outside_.clear();
    progress_->begin(stage.name, step, steps, 0);

    Guard guard(case_.guards, stage, now_.rows);
    std::int64_t slice = at_exchange(stage, 64);  // steps between looks at the clock
    for (bool ended = step >= last_step(stage); !ended;) {
      const Event event = next_event(stage, step);
      const std::int64_t look = at_exchange(stage, (step / guard.every() + 1) * guard.every());
      std::int64_t until = std::min({event.step, look, step + slice});
      const std::int64_t estimate = now_.critical_at + steps_between_estimates;
      if (case_.automatic_dt) until = std::min(until, estimate);
      until = at_exchange(stage, until);
      const auto began = std::chrono::steady_clock::now();
      const bool due = until == event.step;
      due ? advance_to_record(stage, until - step) : engine_->advance(until - step);
      const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
      if (took < 0.1 && until == step + slice) slice *= 2;
      step = until;
      ended = due && event.end;
      if (due || step == look) {
        take_state();
        guard.check(now_.state);
      }
      if (due) {
        if (event.series) record(stage);
        if (event.snapshot) snapshot(stage);
      }
      if (case_.automatic_dt && !ended && (due || step == estimate)) follow_bed(stage);
      if (options_.on_progress) options_.on_progress(index, step, std::max<std::int64_t>(step, steps));
      progress_->show({step, stage.scene.time(step), now_.rows.back().unbalanced_force});
      if (water_ && (due || step == look)) say_outside(ended);
      if (ended && water_) progress_->say("water, " + water_->solver());
      const bool stop = stop_requested;
      if (stop || ended || seconds_since_save() > case_.output.checkpoint_interval) {
        if (!due) take_state();
        if (due || guard.finds_healthy(now_.state)) save();
      }
      if (stop)
        throw error("interrupted at step ", step, " of stage ", stage.name, "; --resume goes on from here");
    }
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

  // The last interval between exchanges step by step, for the mean loads over it. Same bits as in one go.
  void advance_to_record(const Stage& stage, std::int64_t steps) {
    const std::int64_t m = std::max<std::int64_t>(1, stage.scene.exchange_interval);
    std::vector<dem::Loads> last;
    if (m > 1) {
      engine_->advance(steps - m);
      steps = 1;
      for (std::int64_t k = 1; k < m; ++k) {
        engine_->advance(1);
        last.push_back(dem::loads_of(stage.scene, engine_->state()));
      }
    }
    engine_->advance(steps);
    last.push_back(dem::loads_of(stage.scene, engine_->state()));
    loads_ = dem::mean(last);
  }

  // When the first grains leave, and how many have at the end.
  void say_outside(bool ended) {
    const std::string outside = water_->outside();
    if (outside.empty() || outside == said_outside_ || !(said_outside_.empty() || ended)) return;
    progress_->say("warning: outside the water: " + outside);
    said_outside_ = outside;
  }

  void record(const Stage& stage) {
    now_.rows.push_back(row_of(static_cast<std::size_t>(now_.stage), stage, now_.state, loads_,
                               now_.stage_start_time, now_.energy_0));
    if (water_) add_water(now_.rows.back(), stage, *water_);
    if (!water_ && case_.has_water()) now_.rows.back().total_friction = now_.rows.back().shear_friction;
    series_->append(now_.rows.back());
  }

  void snapshot(const Stage& stage) {
    char name[80];
    std::snprintf(name, sizeof name, "%02d-%s-%06lld", static_cast<int>(now_.stage) + 1, stage.name.c_str(),
                  static_cast<long long>(std::ceil(
                      (stage.scene.time(now_.state.step) - 0.5 * stage.scene.dt) / stage.snapshot_interval)));
    now_.snapshots.push_back(
        output::write_snapshot(files_.snapshots(), name, now_.rows.back().time, stage.scene, now_.state,
                               water_ ? std::optional(water_->fields()) : std::nullopt, &loads_));
    output::write_xdmf(files_.snapshots(), now_.snapshots);
  }

  void take_state() {
    now_.state = engine_->state();
    now_.water = water_ ? water_->state() : coupling::WaterState{};
  }

  void save() {
    output::write_checkpoint(files_.checkpoint(), now_);
    saved_ = std::chrono::steady_clock::now();
  }
  double seconds_since_save() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - saved_).count();
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
  std::vector<std::string> warnings_;
  std::string said_outside_;  // in this stage
  std::unique_ptr<output::Series> series_;
  std::chrono::steady_clock::time_point saved_ = std::chrono::steady_clock::now();
};

}  // namespace

void catch_signals() {
  std::signal(SIGINT, [](int) { stop_requested = true; });
  std::signal(SIGTERM, [](int) { stop_requested = true; });
}
bool stopping() { return stop_requested; }

void expect_no_results(const Options& options) {
  const Files files{options.directory / "output"};
  if (!options.resume && !options.force && files.left_by_a_run())
    throw error(files.output.string(),
                ": holds the results of an earlier run; use --resume to go on from its checkpoint, or "
                "--force to replace it");
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
