#include "run/runner.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>
#include <utility>

#include "case/keys.hpp"
#include "case/materials.hpp"
#include "dem/memory_order.hpp"
#include "error.hpp"
#include "memory.hpp"
#include "output/sealed.hpp"
#include "run/needs.hpp"
#include "run/precheck.hpp"
#include "run/press.hpp"
#include "run/record.hpp"
#include "run/schedule.hpp"

namespace moraine::run {

namespace fs = std::filesystem;

namespace {

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

}  // namespace

bool Files::holds(const fs::path& path) {
  std::error_code failed;
  return fs::symlink_status(path, failed).type() != fs::file_type::not_found;
}

void expect_no_results(const Options& options) {
  const Files files{options.output.empty() ? options.directory / "output" : options.output};
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

Runner::Runner(const Options& options, const cases::Case& c)
    : options_(options),
      case_(c),
      files_{options.output.empty() ? case_.directory / "output" : options.output} {
  if (options_.ranks) expect_room(case_, 1, options_.ranks);
  start_ = start_of(case_);  // with the engine, before anything of an earlier run is touched
  engine_ = make_engine();
  warnings_ = precheck(case_, start_, *engine_);
  describes_ = engine_->describe();  // with the threads that such a bed has
  engine_ = make_engine();           // lets go of the bed that was checked
  make_directories(files_.output);
  lock_.emplace(files_.output);
  const bool resuming = settle_old_output();
  was_finished_ = resuming && now_.finished;
  if (was_finished_) {  // what it came to is there to be read
    stage_ = describe(case_, stage_index(), now_);
    step_ = now_.state.step, stage_ended_ = true;
    return;
  }
  make_directories(files_.snapshots());
  progress_ = std::make_unique<Progress>(files_.log(), resuming, options_.quiet);
  if (!damage_.empty()) progress_->warn("warning: " + damage_);
  guarded([&] { begin(resuming); });
}

template <class Action>
void Runner::guarded(Action&& action) {
  if (failed_)
    throw error("the run has stopped with an error; open it again with resume to go on from its checkpoint");
  try {
    action();
  } catch (const std::exception& e) {
    const bool asked_for = dynamic_cast<const Interrupted*>(&e);
    failed_ = !asked_for;
    try {
      list_snapshots();
    } catch (const Error&) {  // of a full disk, say: the first error counts
    }
    std::string words = moraine::in_words(e), after;
    for (const fs::path& kept : {files_.checkpoint_before(), files_.checkpoint()})
      if (Files::holds(kept)) after = "; the last good checkpoint stays in " + kept.string();
    words += after;
    progress_->say("stopped: " + words);
    if (asked_for) throw Interrupted(words);
    throw Error(words);
  }
}

std::int64_t Runner::step(std::int64_t most) {
  std::int64_t done = 0;
  if (!finished()) guarded([&] { begin_next_stage(), done = go_on(most); });
  return done;
}

void Runner::finish() {
  while (!finished()) step(std::numeric_limits<std::int64_t>::max());
}

void Runner::begin_stage() {
  if (!finished()) guarded([&] { begin_next_stage(); });
}

void Runner::begin_next_stage() {
  if (!stage_ended_ || stage_index() + 1 >= case_.stages.size()) return;
  ++now_.stage;
  begin_present_stage(/*resuming=*/false);
}

void Runner::checkpoint() {
  if (finished()) return;
  guarded([&] { take_state(); });
  if (!guard_->finds_healthy(now_.state))
    throw error("no checkpoint at step ", done(), " of stage ", stage_.name,
                ": the guards would stop the run here; the checkpoint before it stays");
  guarded([&] { save(); });
}

std::int64_t Runner::steps() const { return last_step(stage_) - stage_.first_step; }

double Runner::time() const {
  return was_finished_ ? now_.rows.back().time : now_.start.time + stage_.time(step_);
}

dem::State Runner::grains() const { return was_finished_ ? now_.state : engine_->grains(); }
dem::State Runner::state() const { return was_finished_ ? now_.state : engine_->state(); }

std::optional<coupling::WaterFields> Runner::water() const {
  if (was_finished_ && stage_.water.present) {
    Stage stage = stage_;
    return fill(stage, now_.state, now_.water, /*under_way=*/true)->fields();
  }
  return water_ ? std::optional(water_->fields()) : std::nullopt;
}

// 1. Beginning.

std::unique_ptr<dem::Engine> Runner::make_engine() const {
  return dem::make_engine(options_.backend, options_.threads, options_.ranks);
}

// Resumes, refuses or clears what an earlier run has left. True if the run goes on from a checkpoint.
bool Runner::settle_old_output() {
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

void Runner::accept(const fs::path& checkpoint) {
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
void Runner::remove_later_snapshots() {
  std::set<std::string> kept;
  for (const output::SnapshotInfo& s : now_.snapshots) kept.insert(s.file);
  for (const auto& entry : fs::directory_iterator(files_.snapshots()))
    if (entry.path().extension() == ".h5" && !kept.contains(entry.path().filename().string()))
      fs::remove(entry.path());
}

// Those after the checkpoint are met again at their steps; so are all of a run that has lost its checkpoints.
void Runner::take_events(bool resuming) {
  if (!resuming) {
    const std::vector<LoadEvent> all =
        options_.events.empty() && !options_.drop_events ? read_events(files_.events()) : options_.events;
    to_come_.assign(all.begin(), all.end());
    if (!all.empty() || Files::holds(files_.events())) write_events(files_.events(), all);
    return;
  }
  const std::vector<LoadEvent> all = read_events(files_.events());
  const auto known = static_cast<std::ptrdiff_t>(std::min(now_.events.size(), all.size()));
  if (!std::equal(all.begin(), all.begin() + known, now_.events.begin()))
    throw error(
        files_.events().string(), ": does not begin with the ", now_.events.size(),
        " events of the checkpoint; undo the change, or remove the file to go on without those after it");
  if (!options_.drop_events) to_come_.assign(all.begin() + known, all.end());
  if (!to_come_.empty())
    progress_->say(
        text("events after the checkpoint, which are met again at their steps: ", to_come_.size()));
  if (Files::holds(files_.events()) || !now_.events.empty()) write_events(files_.events(), all_events());
}

void Runner::begin(bool resuming) {
  take_events(resuming);
  if (!resuming) now_ = std::exchange(start_.before, {}), now_.events.clear();
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
  open_series();
  begin_present_stage(resuming);
}

void Runner::open_series() {
  series_.reset();
  series_ = std::make_unique<output::Series>(files_.series(), now_.rows, case_.has_water(), case_.presses(),
                                             case_.has_histories() || !now_.events.empty());
}

void Runner::begin_present_stage(bool resuming) {
  const std::size_t index = stage_index();
  stage_ = resuming ? describe(case_, index, now_) : prepare(case_, index, start_, now_);
  stage_ended_ = false;
  water_ = fill(stage_, now_.state, now_.water, /*under_way=*/stage_.goes_on);
  engine_->load(stage_.scene, now_.state, water_.get());
  if (!resuming) {
    for (const std::string& w : stage_.warnings) warn(w);
    take_state();
    now_.scene = stage_.scene;
    if (case_.automatic_dt && !stage_.goes_on) {
      now_.critical_at = -steps_between_estimates;
      follow_bed();
    }
    loads_ = dem::loads_of(stage_.scene, now_.state);
    count_from_here();
    record();
    snapshot();
    loads_ = {};
    if (presses(stage_) && now_.state.step % steps_between_presses == 0) press();
    if (stage_.goes_on && looks_at_order(stage_, now_.state.step, options_.ordering.steps)) renew_order();
    if (case_.automatic_dt && stage_.goes_on) follow_bed();  // as after any record
    if (index == 0) save();
  }
  step_ = now_.state.step;
  char text[200];
  std::snprintf(text, sizeof text, "stage %s: %lld steps of %.3g s%s%s", stage_.name.c_str(),
                static_cast<long long>(steps()), stage_.scene.dt,
                case_.automatic_dt ? ", which follows the bed" : "",
                stage_.goes_on && !resuming ? "; goes on as the one before" : "");
  progress_->say(text);
  if (water_) progress_->say(water_->describe() + "; " + stability_of(*water_, stage_.scene.dt));
  said_outside_.clear();
  progress_->begin(stage_.name, done(), steps(), 0);
  guard_.emplace(case_.guards, stage_, now_.rows, now_.start);
  slice_ = at_exchange(stage_, 64);
  stage_ended_ = step_ >= last_step(stage_);
  apply_events();
}

// 2. Steps.

std::int64_t Runner::go_on(std::int64_t most) {
  const std::int64_t first = step_;
  constexpr auto all = std::numeric_limits<std::int64_t>::max();
  const std::int64_t target = most < all - first ? first + most : all;
  if (stage_ended_) end();  // a resumed one
  while (!stage_ended_ && step_ < target) {
    const Event event = next_event(stage_, step_);
    const std::int64_t look = at_exchange(stage_, (step_ / guard_->every() + 1) * guard_->every());
    std::int64_t until = std::min({event.step, look, step_ + slice_});
    const std::int64_t estimate = now_.critical_at + steps_between_estimates;
    if (case_.automatic_dt) until = std::min(until, estimate);
    const std::int64_t jump = (step_ / steps_between_presses + 1) * steps_between_presses;
    if (presses(stage_)) until = std::min(until, jump);
    until = std::min(until, next_look_at_order(step_, options_.ordering.steps));
    until = std::min(until, target);
    if (!to_come_.empty() && to_come_.front().stage == now_.stage)
      until = std::min(until, std::max(to_come_.front().step, step_ + 1));
    until = at_exchange(stage_, until);
    const auto began = Clock::now();
    const bool due = until == event.step;
    due ? advance_to_record(step_, until) : advance(step_, until);
    if (seconds_since(began) < 0.1 && until == step_ + slice_) slice_ *= 2;
    step_ = until;
    stage_ended_ = due && event.end;
    if (step_ == look && !due) take_state();
    if (due || step_ == look) guard_->check(now_.state, due ? &loads_ : nullptr);
    if (due) {
      if (event.series) record();
      if (event.snapshot) snapshot();
      loads_ = {};
    }
    if (Clock::now() >= next_list_) list_snapshots();
    if (presses(stage_) && !stage_ended_ && step_ == jump) press();
    if (!stage_ended_ && looks_at_order(stage_, step_, options_.ordering.steps)) renew_order();
    if (case_.automatic_dt && !stage_ended_ && (due || step_ == estimate)) follow_bed();
    if (options_.on_progress) options_.on_progress(stage_index(), done(), std::max(done(), steps()));
    progress_->show({done(), stage_.time(step_), now_.rows.back().unbalanced_force});
    if (water_ && (due || step_ == look)) say_outside();
    if (stage_ended_ && water_) progress_->say("water, " + water_->solver());
    if (stage_ended_ && stage_.pressure > 0) say_stress();
    apply_events();
    const bool stop = stopping() || (options_.stop && options_.stop());
    if (stop || stage_ended_ || seconds_since(saved_) > case_.output.checkpoint_interval) {
      if (!due) take_state();
      if (due || guard_->finds_healthy(now_.state)) save();
    }
    if (stop)
      throw Interrupted(
          text("interrupted at step ", done(), " of stage ", stage_.name, "; --resume goes on from here"));
    if (stage_ended_) end();
  }
  return step_ - first;
}

// Of the case, where its last stage has ended.
void Runner::end() {
  if (stage_index() + 1 < case_.stages.size()) return;
  list_snapshots();
  now_.finished = true;
  save();
  series_.reset();
  progress_->say("finished: " + files_.output.string());
  progress_->log(summary(case_.stages, now_.rows));
}

// From one step to another.
void Runner::advance(std::int64_t step, std::int64_t until) {
  run::advance(*engine_, stage_.scene, stage_.histories, step, until);
  now_.scene.bodies = stage_.scene.bodies;
}

// With pore water the last interval between exchanges step by step, for the mean loads over it. Same bits
// as in one go.
void Runner::advance_to_record(std::int64_t step, std::int64_t until) {
  const std::int64_t m = std::max<std::int64_t>(1, stage_.scene.exchange_interval);
  advance(step, until - (m - 1));
  take_state();
  loads_ = dem::loads_of(stage_.scene, now_.state);
  for (std::int64_t k = 1; k < m; ++k) {
    advance(until - m + k, until - m + k + 1);
    take_state();
    dem::add(loads_, dem::loads_of(stage_.scene, now_.state));
  }
  loads_ = dem::mean(std::move(loads_), m);
}

// The time step from here on.
void Runner::follow_bed() {
  take_state();
  if (now_.state.step == now_.critical_at + steps_between_estimates) {
    now_.critical_step = critical_step(stage_.scene, now_.state);
    now_.critical_at = now_.state.step;
  }
  fit_step(stage_, now_.state, case_.safety * now_.critical_step);
  engine_->load(stage_.scene, now_.state);
  now_.scene = stage_.scene;
}

// The sides jump. Their work is what the springs then hold more, and slip what these let go at once; what
// rows count from moves by that, as the engine's ledger begins anew.
void Runner::press() {
  take_state();
  dem::State& s = now_.state;
  const dem::Vec3d factor = next_press(stage_, s);
  const dem::Ledger before = s.ledger;
  const double kinetic = dem::kinetic_energy(stage_.scene, s);
  const dem::SpringEnergy springs = dem::spring_energy(stage_.scene, s);
  dem::deform(stage_.scene, s, factor);
  const double carried = dem::spring_energy(stage_.scene, s).tangential;
  engine_->load(stage_.scene, s);
  take_state();
  now_.scene = stage_.scene;
  const dem::SpringEnergy after = dem::spring_energy(stage_.scene, s);
  const double slip = carried - after.tangential;
  const double work = after.normal + carried - springs.normal - springs.tangential +
                      dem::kinetic_energy(stage_.scene, s) - kinetic;
  dem::Ledger& from = now_.start.ledger;
  from.slip += s.ledger.slip - before.slip - slip;
  from.viscous += s.ledger.viscous - before.viscous;
  from.planes += s.ledger.planes - before.planes - work;
}

// Grains that have sheared past one another are sorted in memory anew.
void Runner::renew_order() {
  take_state();
  std::vector<dem::Vec3d>* const map = water_ ? &now_.water.x_map : nullptr;
  if (dem::renew_order(stage_.scene, now_.state, options_.ordering.lost, map)) refill();
}

// The water goes on as on a restart.
void Runner::refill() {
  auto water = fill(stage_, now_.state, now_.water, /*under_way=*/true);
  engine_->load(stage_.scene, now_.state, water.get());
  water_ = std::move(water);
}

// 3. Events.

void Runner::set(const std::string& load, double value) {
  if (finished()) throw error(load, ": the case has come to its end, and nothing changes any more");
  if (stage_ended_)
    throw error(load, ": stage ", stage_.name, " has come to its end; begin the next one first");
  if (has_load(case_.stages[stage_index()], stage_, load, value)) return;
  const LoadEvent event{now_.stage, step_, load, value};
  guarded([&] {
    apply(event);
    to_come_.empty() ? append_event(files_.events(), event) : write_events(files_.events(), all_events());
  });
}

std::vector<LoadEvent> Runner::all_events() const {
  std::vector<LoadEvent> all = now_.events;
  all.insert(all.end(), to_come_.begin(), to_come_.end());
  return all;
}

// Those of this step that were made before.
void Runner::apply_events() {
  while (!to_come_.empty() && !stage_ended_) {
    const LoadEvent event = to_come_.front();
    const auto place = [](std::int64_t stage, std::int64_t step) { return std::pair(stage, step); };
    if (place(event.stage, event.step) > place(now_.stage, step_)) return;
    if (place(event.stage, event.step) < place(now_.stage, step_))
      throw error(files_.events().string(), ": ", event.key, " at step ", event.step, " of stage ",
                  event.stage + 1, ": there was no such step; correct the line, or remove it");
    to_come_.pop_front();
    apply(event);
  }
}

void Runner::apply(const LoadEvent& event) {
  // Loaded anew, as on a restart from a checkpoint of this step: the account of energy up to here is closed
  // with the load as it was.
  take_state();
  run::apply(event, stage_);
  if (water_)
    refill();
  else
    engine_->load(stage_.scene, now_.state);
  now_.scene.bodies = stage_.scene.bodies;
  now_.histories = stage_.histories, now_.water_settings.sides = stage_.water.sides;
  now_.events.push_back(event);
  if (now_.events.size() == 1 && !case_.has_histories()) open_series();  // with columns of what is asked for
  progress_->say(describe(event, stage_.name));
}

// 4. Output.

// What the rows of the stage count from.
void Runner::count_from_here() {
  output::StageStart& start = now_.start;
  start.time = now_.rows.empty() ? 0 : now_.rows.back().time;
  start.energy = dem::observe(stage_.scene, now_.state, loads_).energy.total();
  start.ledger = now_.state.ledger;
  start.drained_top = now_.water.drained_top, start.drained_bottom = now_.water.drained_bottom;
  start.water_dissipated = now_.water.dissipated;
}

// Of a press that has not come to its pressure.
void Runner::say_stress() {
  const output::Row& row = now_.rows.back();
  for (const double stress : {row.stress_x, row.stress_y, row.stress_z})
    if (std::abs(stress - stage_.pressure) > 0.05 * stage_.pressure) {
      progress_->say(text("warning: stage ", stage_.name, " ends with ", row.stress_x, ", ", row.stress_y,
                          " and ", row.stress_z,
                          " Pa along x, y and z, not with pressure = ", stage_.pressure,
                          " Pa; a longer duration or a larger strain_rate would get nearer"));
      return;
    }
}

void Runner::warn(const std::string& words) {
  if (std::find(warnings_.begin(), warnings_.end(), words) == warnings_.end())
    progress_->say("warning: " + words);
}

// When the first grains leave, and how many have at the end.
void Runner::say_outside() {
  const std::string outside = water_->outside();
  if (outside.empty() || outside == said_outside_ || !(said_outside_.empty() || stage_ended_)) return;
  progress_->say("warning: outside the water: " + outside);
  said_outside_ = outside;
}

void Runner::record() {
  now_.rows.push_back(row_of(stage_index(), stage_, now_.state, loads_, now_.start));
  if (water_) add_water(now_.rows.back(), stage_, *water_, now_.start);
  if (!water_ && case_.has_water()) now_.rows.back().total_friction = now_.rows.back().shear_friction;
  series_->append(now_.rows.back());
}

void Runner::snapshot() {
  // By number within the stage; the interval may have changed on the way.
  char place[32], number[32];
  std::snprintf(place, sizeof place, "%02d-", static_cast<int>(now_.stage) + 1);
  const std::string name = place + stage_.name + "-";
  const auto count = std::count_if(now_.snapshots.begin(), now_.snapshots.end(),
                                   [&](const auto& s) { return s.file.starts_with(name); });
  std::snprintf(number, sizeof number, "%06lld", static_cast<long long>(count));
  now_.snapshots.push_back(output::write_snapshot(files_.snapshots(), name + number, now_.rows.back().time,
                                                  stage_.scene, now_.state, water(), &loads_, now_.start));
  all_listed_ = false;
}

// For ParaView. The lists are written whole, so that no reader meets half of one; the more snapshots, the
// longer that takes. So it waits until it has taken but a fiftieth of the time.
void Runner::list_snapshots() {
  if (all_listed_) return;
  const auto began = Clock::now();
  output::write_xdmf(files_.snapshots(), now_.snapshots);
  all_listed_ = true;
  next_list_ = Clock::now() + 50 * (Clock::now() - began);
}

void Runner::take_state() {
  now_.state = {};  // gone before the next one comes
  now_.state = engine_->state();
  now_.water = water_ ? water_->state() : coupling::WaterState{};
}

void Runner::save() {
  output::write_checkpoint(files_.checkpoint(), now_, files_.checkpoint_before());
  saved_ = Clock::now();
}

}  // namespace moraine::run
