#include "run/sweep.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <fstream>
#include <iostream>
#include <iterator>
#include <mutex>
#include <thread>

#include "backend/team.hpp"
#include "error.hpp"
#include "memory.hpp"
#include "run/needs.hpp"
#include "run/precheck.hpp"
#include "run/progress.hpp"
#include "run/record.hpp"
#include "run/sweep_plan.hpp"

namespace moraine::run {

namespace fs = std::filesystem;

namespace {

// Steps times grains up to a factor that all cases share; only for the time left. Where the height of the bed
// decides how long a stage takes, it is taken for 1 m.
double expected_work(const cases::Case& c, std::size_t stage) {
  const cases::Stage& s = c.stages[stage];
  const double rate = std::abs(s.strain_rate != 0 ? s.strain_rate : s.velocity);
  // A press is taken to shorten the sides by a fifth.
  const double duration = s.duration > 0 ? s.duration : (s.porosity > 0 ? 0.2 : s.strain) / rate;
  return duration / (c.dt > 0 ? c.dt : s.f) * static_cast<double>(c.grains.count);
}

struct Job {
  enum class State { waiting, running, finished, failed };
  PlannedCase plan;
  Options options;
  cases::Case what;
  double work = 0;                                // of all stages
  std::atomic<double> done = 0, done_before = 0;  // before: when this sweep took it up
  State state = State::waiting;                   // this and below under the sweep's mutex
  std::string message;
  Result result{};
};
using State = Job::State;

class Sweep {
 public:
  Sweep(const Options& options, int at_once, SweepListener listener)
      : directory_(options.directory / "sweep"), listener_(std::move(listener)) {
    Plan plan = plan_sweep(options.overrides);
    columns_ = std::move(plan.columns), understood_ = std::move(plan.understood);
    const bool gpu = options.backend == dem::Backend::cuda ||
                     (options.backend == dem::Backend::automatic && dem::cuda_device_present());
    const int count = static_cast<int>(plan.cases.size());
    const int threads = options.threads > 0 ? options.threads : available_cores();
    at_once_ = std::min(count, at_once > 0 ? at_once : gpu ? count : threads);

    // All cases are read and checked before the first one runs.
    for (PlannedCase& planned : plan.cases) {
      Job& job = jobs_.emplace_back();
      job.what = cases::load(options.directory, planned.overrides);
      job.options = options;
      job.options.directory = directory_ / planned.name;
      job.options.overrides.clear();  // they stand in its case.toml
      job.options.threads = std::max(1, threads / at_once_);
      job.options.quiet = true;
      job.options.stop = [this] { return asked_to_stop_.load(); };
      job.plan = std::move(planned);
      expect_no_results(job.options);
    }
    const auto largest = std::max_element(jobs_.begin(), jobs_.end(), [](const Job& a, const Job& b) {
      return a.what.grains.count < b.what.grains.count;
    });
    expect_room(largest->what, at_once_);
    check_all();
    // Those that go on first: they may be refused.
    for (const bool begun : {true, false})
      for (Job& job : jobs_)
        if (fs::exists(job.options.directory / "output/case.toml") == begun) write_case(options, job);
  }

  void run() {
    listener_.say(std::to_string(jobs_.size()) + " cases, " + std::to_string(at_once_) + " at once, in " +
                  directory_.string() + ": " + understood_);
    std::vector<std::thread> workers;
    for (int k = 0; k < at_once_; ++k) workers.emplace_back([this] { work(); });
    watch();
    for (std::thread& worker : workers) worker.join();
    write_summary();
  }

  std::vector<SweptCase> cases() const {
    std::vector<SweptCase> list;
    for (const Job& job : jobs_)
      list.push_back(
          {job.plan.name, job.options.directory, job.plan.values, state_name(job.state), job.message});
    return list;
  }

  // The table of strengths; throws Error where cases are missing.
  void report() const {
    std::cout << table_ << "of the last shear stage; also in " << (directory_ / "summary.csv").string()
              << "\n";
    std::string stopped, not_begun;
    for (const Job& job : jobs_) {
      if (job.state == State::failed) stopped += "\n  " + job.plan.name + ": " + job.message;
      if (job.state == State::waiting) not_begun += "\n  " + job.plan.name + ": not begun";
    }
    if (const int missing = static_cast<int>(jobs_.size()) - count(State::finished))
      throw error(missing, " of ", jobs_.size(),
                  " cases did not finish (--resume goes on with them):", stopped, not_begun);
  }

 private:
  // What would be refused before its first step is refused before any case begins, and leaves nothing behind.
  void check_all() {
    std::vector<std::string> refused(jobs_.size());
    std::atomic<std::size_t> next = 0;
    const auto check = [&] {
      for (std::size_t k; (k = next++) < jobs_.size();) {
        const Job& job = jobs_[k];
        try {
          precheck(job.what, start_of(job.what), *dem::make_engine(job.options.backend, job.options.threads));
        } catch (const std::exception& e) {
          refused[k] = job.plan.name + ": " + in_words(e);
        }
      }
    };
    std::vector<std::thread> workers;
    for (int k = 0; k < at_once_; ++k) workers.emplace_back(check);
    for (std::thread& worker : workers) worker.join();
    for (const std::string& message : refused)
      if (!message.empty()) throw Error(message);
  }

  void write_case(const Options& options, Job& job) {
    const fs::path directory = job.options.directory, file = directory / "case.toml";
    std::error_code failed;
    fs::create_directories(directory, failed);
    if (failed) throw error(directory.string(), ": cannot be created: ", failed.message());
    const auto text_in = [](const fs::path& path) {
      std::ifstream text(path);
      return std::string(std::istreambuf_iterator<char>(text), {});
    };
    const std::string before = text_in(file), resolved_before = text_in(directory / "output/case.toml");
    output::write_text(file, "# Written by `moraine sweep`.\n" +
                                 cases::extension_text(options.directory, job.plan.overrides, "../.."));
    job.what = cases::load(directory);
    for (std::size_t k = 0; k < job.what.stages.size(); ++k) job.work += expected_work(job.what, k);
    const auto has = [&](const char* name) { return fs::exists(directory / "output" / name); };
    if (!options.resume || resolved_before.empty()) return;
    if (!has("checkpoint.h5") && !has("checkpoint.previous.h5")) return;  // cut off before there were results
    if (const std::string changed = changed_physics(resolved_before, job.what); !changed.empty()) {
      output::write_text(file, before);
      throw error(directory.string(), ": holds results of another version of this case: ", changed,
                  "; undo the change, or use --force to run anew");
    }
  }

  void work() {
    while (Job* job = take()) {
      std::string message;
      Result result{};
      try {
        result = run_one(job->options, job->what);
      } catch (const std::exception& e) {
        message = in_words(e);
      }
      const std::lock_guard lock(mutex_);
      job->state = message.empty() ? State::finished : State::failed;
      job->message = message, job->result = std::move(result);
      job->done = job->work;
      news_.push_back(job);
      changed_.notify_one();
    }
  }

  Job* take() {
    const std::lock_guard lock(mutex_);
    if (to_stop()) return nullptr;
    const auto job =
        std::find_if(jobs_.begin(), jobs_.end(), [](const Job& j) { return j.state == State::waiting; });
    if (job == jobs_.end()) return nullptr;
    job->state = State::running;
    job->options.on_progress = [j = &*job, first = true](std::size_t stage, std::int64_t step,
                                                         std::int64_t steps) mutable {
      double done = expected_work(j->what, stage) * static_cast<double>(step) / static_cast<double>(steps);
      for (std::size_t k = 0; k < stage; ++k) done += expected_work(j->what, k);
      if (std::exchange(first, false)) j->done_before = j->options.resume ? done : 0;
      j->done = done;
    };
    return &*job;
  }

  // Until all have ended: the only place that writes to the terminal meanwhile.
  void watch() {
    using namespace std::chrono_literals;
    const auto began = std::chrono::steady_clock::now();
    std::unique_lock lock(mutex_);
    const auto going_on = [&] {
      return count(State::running) > 0 || (count(State::waiting) > 0 && !to_stop());
    };
    while (going_on() || !news_.empty()) {
      changed_.wait_for(lock, 200ms);
      for (; !news_.empty(); news_.pop_front()) {
        const Job& job = *news_.front();
        listener_.say(job.state == State::failed ? "stopped: " + job.plan.name + ": " + job.message
                      : job.result.was_finished  ? "finished already: " + job.plan.name
                                                 : "finished: " + job.plan.name);
      }
      const auto [done, line] = progress(seconds_since(began));
      lock.unlock();  // cases may end meanwhile
      listener_.show(done, line);
      if (listener_.stop && listener_.stop()) asked_to_stop_ = true;
      lock.lock();
    }
  }

  std::pair<double, std::string> progress(double seconds) const {
    double done = 0, before = 0, all = 0;
    for (const Job& job : jobs_) {
      done += job.done, all += job.work;
      before += job.result.was_finished ? job.work : job.done_before.load();
    }
    const double left = done > before ? (all - done) * seconds / (done - before) : 0;
    char text[160];
    std::snprintf(text, sizeof text, "%d running, %d of %zu finished, %d stopped  %5.1f %%  ETA %s",
                  count(State::running), count(State::finished), jobs_.size(), count(State::failed),
                  100 * done / all, left > 0 ? readable_time(left).c_str() : "unknown");
    return {done / all, text};
  }

  bool to_stop() const { return stopping() || asked_to_stop_; }

  static std::string state_name(State state) {
    return state == State::finished ? "finished" : state == State::waiting ? "not begun" : "stopped";
  }

  int count(State state) const {
    return static_cast<int>(
        std::count_if(jobs_.begin(), jobs_.end(), [&](const Job& j) { return j.state == state; }));
  }

  void write_summary() {
    std::size_t width = 4;
    for (const Job& job : jobs_) width = std::max(width, job.plan.name.size());
    const auto in_width = [&](std::string name) { return name.append(width + 2 - name.size(), ' '); };
    table_ = in_width("case") + "friction: peak  smoothed  ultimate  dilation/diameters\n";
    std::string csv = "case,";
    for (const std::string& column : columns_) csv += column + ",";
    csv += "state,peak,peak_strain,smoothed_peak,ultimate,dilation_diameters\n";

    for (const Job& job : jobs_) {
      const bool finished = job.state == State::finished;
      const auto s = finished ? final_strength(job.what.stages, job.result.rows) : std::optional<Strength>{};
      const std::string state = state_name(job.state);
      char line[160] = "", numbers[160] = ",,,,";
      if (s) {
        std::snprintf(line, sizeof line, "%14.4f%10.4f%10.4f%+14.4f", s->peak, s->smoothed_peak, s->ultimate,
                      s->dilation_diameters);
        std::snprintf(numbers, sizeof numbers, "%.9g,%.9g,%.9g,%.9g,%.9g", s->peak, s->peak_strain,
                      s->smoothed_peak, s->ultimate, s->dilation_diameters);
      }
      table_ += in_width(job.plan.name) + (s ? line : finished ? "no shear stage" : state) + "\n";
      csv += job.plan.name + ",";
      for (const std::string& value : job.plan.values) csv += value + ",";
      csv += state + "," + numbers + "\n";
    }
    output::write_text(directory_ / "summary.csv", csv);
  }

  fs::path directory_;
  std::vector<std::string> columns_;
  std::string understood_;
  SweepListener listener_;
  std::string table_;
  std::atomic<bool> asked_to_stop_ = false;
  int at_once_ = 1;
  std::deque<Job> jobs_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<const Job*> news_;
};

}  // namespace

void sweep_case(const Options& options, int at_once) {
  catch_signals();
  Screen screen(options.quiet);
  SweepListener listener;
  listener.say = [&](const std::string& line) { screen.say(line); };
  listener.show = [&](double, const std::string& line) {
    if (screen.due()) screen.show(line);
  };
  Sweep sweep(options, at_once, listener);
  sweep.run();
  sweep.report();
}

std::vector<SweptCase> sweep(const Options& options, int at_once, const SweepListener& listener) {
  Sweep sweep(options, at_once, listener);
  sweep.run();
  return sweep.cases();
}

}  // namespace moraine::run
