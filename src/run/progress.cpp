#include "run/progress.hpp"

#include <unistd.h>

#include <cstdio>
#include <iostream>

#include "error.hpp"

namespace moraine::run {

double seconds_since(std::chrono::steady_clock::time_point t) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - t).count();
}

std::string readable_time(double s) {
  char text[64];
  const auto whole = [](double x) { return static_cast<long>(x); };
  if (s < 60)
    std::snprintf(text, sizeof text, "%.1f s", s);
  else if (s < 3600)
    std::snprintf(text, sizeof text, "%ld min %ld s", whole(s / 60), whole(s) % 60);
  else if (s < 86400)
    std::snprintf(text, sizeof text, "%ld h %ld min", whole(s / 3600), whole(s / 60) % 60);
  else if (s < 1000.0 * 86400)
    std::snprintf(text, sizeof text, "%ld d %ld h", whole(s / 86400), whole(s / 3600) % 24);
  else
    std::snprintf(text, sizeof text, "%.3g years", s / (365.25 * 86400));
  return text;
}

Screen::Screen(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO)) {}

Screen::~Screen() { clear_line(); }

void Screen::clear_line() {
  if (line_shown_) std::cerr << "\r\033[K" << std::flush;
  line_shown_ = false;
}

void Screen::say(const std::string& line) {
  if (!quiet_) warn(line);
}

void Screen::warn(const std::string& line) {
  clear_line();
  std::cerr << line << std::endl;
}

bool Screen::due() const { return !quiet_ && seconds_since(shown_) > (terminal_ ? 0.5 : 10); }

void Screen::show(const std::string& line) {
  if (quiet_) return;
  if (terminal_)
    std::cerr << "\r\033[K" << line << std::flush;
  else
    std::cerr << line << std::endl;
  line_shown_ = terminal_;
  shown_ = std::chrono::steady_clock::now();
}

Progress::Progress(const std::filesystem::path& log, bool append, bool quiet)
    : log_(log, append ? std::ios::app : std::ios::trunc), screen_(quiet) {
  if (!log_) throw error(log.string(), ": cannot be written");
}

void Progress::say(const std::string& line) {
  log_ << line << std::endl;
  screen_.say(line);
}

void Progress::warn(const std::string& line) {
  log_ << line << std::endl;
  screen_.warn(line);
}

void Progress::log(const std::string& lines) { log_ << lines << std::flush; }

void Progress::begin(const std::string& stage, std::int64_t step, std::int64_t steps,
                     std::int64_t later_steps) {
  stage_ = stage, first_step_ = step, steps_ = steps, later_steps_ = later_steps;
  began_ = std::chrono::steady_clock::now();
}

void Progress::show(const Now& now) {
  if (!screen_.due()) return;
  const double rate = static_cast<double>(now.step - first_step_) / seconds_since(began_);
  const double stage_left = static_cast<double>(steps_ - now.step) / rate;
  const double left = stage_left + static_cast<double>(later_steps_) / rate;
  char text[256];
  std::snprintf(text, sizeof text,
                "%-12s t = %-9.4g s %5.1f %%  %8.0f steps/s  ETA %s (all: %s)  unbalanced force %.2g",
                stage_.c_str(), now.time, 100.0 * static_cast<double>(now.step) / static_cast<double>(steps_),
                rate, readable_time(stage_left).c_str(), readable_time(left).c_str(), now.unbalanced_force);
  screen_.show(text);
}

}  // namespace moraine::run
