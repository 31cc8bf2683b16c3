// How many threads a run goes on with. Where other programs want the cores, too, a thread that is not
// scheduled holds up all others at every step, and fewer threads are faster. That is tried out when threads
// are seen to be interrupted, and more threads again every few seconds. No bit depends on it.
#pragma once
#include <algorithm>
#include <cstdint>

namespace moraine::dem::cpu {

class ThreadCount {
 public:
  explicit ThreadCount(int most) : most_(most), now_(most) {}
  int now() const { return now_; }
  // So many steps should be timed together.
  std::int64_t steps_together() const {
    return s_per_step_ > 0 ? std::max<std::int64_t>(1, static_cast<std::int64_t>(together / s_per_step_))
                           : 100;
  }

  // What steps with now() threads took, and how often a thread was interrupted while it worked.
  void ran(std::int64_t steps, double seconds, std::int64_t interruptions) {
    if (most_ == 1 || steps == 0) return;
    timed_steps_ += steps, timed_ += seconds, interruptions_ += interruptions;
    if (timed_ < 0.5 * together) return;
    const double before = s_per_step_;
    s_per_step_ = timed_ / static_cast<double>(timed_steps_);
    const bool interrupted = static_cast<double>(interruptions_) > often * timed_;
    until_next_ -= timed_;
    timed_ = 0, timed_steps_ = 0, interruptions_ = 0;
    if (trying_) {
      trying_ = false, until_next_ = between_trials;
      if (s_per_step_ > 0.95 * before) now_ = before_trial_, s_per_step_ = before;
    } else if (until_next_ <= 0) {
      const bool fewer = interrupted && now_ > 1, more = now_ < most_;
      if (!fewer && !more) return;
      direction_ = fewer && !(more && direction_ < 0) ? -1 : 1;  // in turns where both may help
      trying_ = true, before_trial_ = now_, now_ += direction_;
    }
  }

 private:
  static constexpr double together = 0.1;      // s
  static constexpr double between_trials = 3;  // s
  static constexpr double often = 20;          // 1/s
  const int most_;
  int now_, before_trial_ = 0, direction_ = 1;
  bool trying_ = false;
  double s_per_step_ = 0, until_next_ = 0;
  double timed_ = 0;
  std::int64_t timed_steps_ = 0, interruptions_ = 0;
};

}  // namespace moraine::dem::cpu
