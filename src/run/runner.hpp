// A case that is run: its stages one after the other, with all the output that is due, checkpoints and
// restart. `moraine run` goes to its end in one go; from Python it is stepped, read and steered on the way
// (src/python/run.cpp), with the same bits.
#pragma once
#include <chrono>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "error.hpp"
#include "output/files.hpp"
#include "run/events.hpp"
#include "run/guard.hpp"
#include "run/progress.hpp"
#include "run/run.hpp"
#include "run/stages.hpp"

namespace moraine::run {

// A stop that was asked for. There is a checkpoint of this step, and the runner may go on.
class Interrupted : public Error {
 public:
  using Error::Error;
};

// What a run leaves in its folder.
struct Files {
  std::filesystem::path output;
  bool left_by_a_run() const {
    return holds(checkpoint()) || holds(checkpoint_before()) || holds(series()) || holds(events());
  }
  std::filesystem::path checkpoint() const { return output / "checkpoint.h5"; }
  std::filesystem::path checkpoint_before() const { return output / "checkpoint.previous.h5"; }
  std::filesystem::path series() const { return output / "series.h5"; }
  std::filesystem::path snapshots() const { return output / "snapshots"; }
  std::filesystem::path log() const { return output / "log.txt"; }
  std::filesystem::path resolved() const { return output / "case.toml"; }
  std::filesystem::path events() const { return output / "events.csv"; }
  std::vector<std::filesystem::path> all() const {
    return {checkpoint(), checkpoint_before(), series(), snapshots(), log(), resolved(), events()};
  }
  static bool holds(const std::filesystem::path& path);  // anything, also what cannot be opened
};

class Runner {
 public:
  // Judges the case, takes the output folder for itself, and begins the first stage, or goes on from the
  // checkpoint that an earlier run has left. Throws Error; then nothing of an earlier run is lost.
  Runner(const Options& options, const cases::Case& c);
  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;

  // At most so many steps (to the next exchange where there is pore water), and none beyond the end of the
  // stage; where that has been reached, the next stage begins first. Returns how many. Throws Interrupted, or
  // an Error with which the run is over.
  std::int64_t step(std::int64_t most);
  void finish();       // to the end of the case
  void begin_stage();  // the next one, where the present one has ended; of the last nothing
  void checkpoint();   // now; throws Error, and the run goes on, where the bed is not fit for it

  // From this step on a load is another number (events.hpp). It is recorded, and part of the checkpoint.
  // Throws Error where it is no load of this stage.
  void set(const std::string& load, double value);

  bool finished() const { return now_.finished; }      // the whole case
  bool was_finished() const { return was_finished_; }  // by an earlier run
  bool stage_ended() const { return stage_ended_; }    // the present one
  const Stage& stage() const { return stage_; }
  std::size_t stage_index() const { return static_cast<std::size_t>(now_.stage); }
  std::int64_t step_number() const { return step_; }               // of the scene's clock
  std::int64_t done() const { return step_ - stage_.first_step; }  // steps since the stage began
  std::int64_t steps() const;                                      // of the whole stage, as dt is now
  double time() const;                                             // s, since the case began
  const std::vector<output::Row>& rows() const { return now_.rows; }
  const std::vector<LoadEvent>& events() const { return now_.events; }
  const cases::Case& what() const { return case_; }
  const Files& files() const { return files_; }

  dem::State grains() const;                           // as Engine::grains()
  dem::State state() const;                            // as Engine::state()
  std::optional<coupling::WaterFields> water() const;  // none: dry

 private:
  // What fails ends the run, with one error that names the checkpoint that is left.
  template <class Action>
  void guarded(Action&& action);

  void open();
  std::unique_ptr<dem::Engine> make_engine() const;
  bool settle_old_output();
  void accept(const std::filesystem::path& checkpoint);
  void remove_later_snapshots();
  void take_events(bool resuming);
  void begin(bool resuming);
  void begin_next_stage();
  void begin_present_stage(bool resuming);
  std::int64_t go_on(std::int64_t most);
  void apply_events();
  std::vector<LoadEvent> all_events() const;  // those to come, too
  void apply(const LoadEvent& event);
  void open_series();
  void end();

  void count_from_here();
  void say_stress();
  void warn(const std::string& words);
  void follow_bed();
  void press();
  void renew_order();
  void refill();
  void advance(std::int64_t step, std::int64_t until);
  void advance_to_record(std::int64_t step, std::int64_t until);
  void say_outside();
  void record();
  void snapshot();
  void list_snapshots();
  void take_state();
  void save();

  using Clock = std::chrono::steady_clock;
  Options options_;
  cases::Case case_;
  Files files_;
  std::optional<output::DirectoryLock> lock_;
  Start start_;
  output::Checkpoint now_;
  Stage stage_;              // the present one
  std::int64_t step_ = 0;    // of its clock
  std::int64_t slice_ = 64;  // steps between looks at the clock
  bool stage_ended_ = false, was_finished_ = false, failed_ = false;
  std::optional<Guard> guard_;
  dem::Loads loads_;  // of the step, or with pore water over the interval, that led to the present record
  std::unique_ptr<coupling::PoreWater> water_;  // of the present stage
  std::unique_ptr<dem::Engine> engine_;
  std::unique_ptr<Progress> progress_;
  std::deque<LoadEvent> to_come_;  // that were made when this was run before
  std::vector<std::string> warnings_, changes_;
  std::string describes_;     // the engine
  std::string damage_;        // of the checkpoint that was to be resumed from
  std::string said_outside_;  // in this stage
  std::unique_ptr<output::Series> series_;
  Clock::time_point saved_ = Clock::now(), next_list_ = saved_;
  bool all_listed_ = true;
};

}  // namespace moraine::run
