// What a person sees while a run goes on: one line that refreshes on a terminal, plain lines elsewhere, and
// log.txt.
#pragma once
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

namespace moraine::run {

class Progress {
 public:
  Progress(const std::filesystem::path& log, bool append, bool quiet);
  ~Progress();

  void say(const std::string& line);   // to the log and, unless quiet, to the terminal
  void log(const std::string& lines);  // to the log only

  void begin(const std::string& stage, std::int64_t step, std::int64_t steps, std::int64_t later_steps);
  struct Now {
    std::int64_t step;
    double time;              // s, of the stage
    double unbalanced_force;  // as last observed
  };
  void show(const Now& now);

 private:
  using Clock = std::chrono::steady_clock;
  void clear_line();

  std::ofstream log_;
  bool quiet_, terminal_, line_shown_ = false;
  std::string stage_;
  std::int64_t first_step_ = 0, steps_ = 0, later_steps_ = 0;
  Clock::time_point began_, shown_;
};

// 3.2 s, 4 min 10 s, 2 h 5 min, 3 d 4 h
std::string readable_time(double seconds);

}  // namespace moraine::run
