// What a person sees while a run goes on: one line that refreshes on a terminal, plain lines elsewhere, and
// log.txt.
#pragma once
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

namespace moraine::run {

// Standard error.
class Screen {
 public:
  explicit Screen(bool quiet);
  ~Screen();
  void say(const std::string& line);   // stays
  void warn(const std::string& line);  // stays, even if quiet
  void show(const std::string& line);  // refreshes on a terminal
  bool due() const;                    // for the next `show`

 private:
  void clear_line();

  bool quiet_, terminal_, line_shown_ = false;
  std::chrono::steady_clock::time_point shown_ = std::chrono::steady_clock::now();
};

class Progress {
 public:
  Progress(const std::filesystem::path& log, bool append, bool quiet);

  void say(const std::string& line);   // to the log and, unless quiet, to the terminal
  void warn(const std::string& line);  // to the log, and to the terminal even if quiet
  void log(const std::string& lines);  // to the log only

  void begin(const std::string& stage, std::int64_t step, std::int64_t steps, std::int64_t later_steps);
  struct Now {
    std::int64_t step;
    double time;              // s, of the stage
    double unbalanced_force;  // as last observed
  };
  void show(const Now& now);

 private:
  std::ofstream log_;
  Screen screen_;
  std::string stage_;
  std::int64_t first_step_ = 0, steps_ = 0, later_steps_ = 0;
  std::chrono::steady_clock::time_point began_;
};

double seconds_since(std::chrono::steady_clock::time_point t);

// 3.2 s, 4 min 10 s, 2 h 5 min, 3 d 4 h
std::string readable_time(double seconds);

}  // namespace moraine::run
