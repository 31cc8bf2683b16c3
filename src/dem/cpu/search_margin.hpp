// The margin of the candidates follows what it costs: a wider one makes searches rarer, but has more pairs
// that are looked at for nothing. Both are timed. No bit depends on it.
#pragma once
#include <algorithm>
#include <cmath>

namespace moraine::dem::cpu {

class SearchMargin {
 public:
  // m; least = most: it stays as it is.
  SearchMargin(double first, double least, double most) : margin_(first), least_(least), most_(most) {}
  double margin() const { return margin_; }
  double most() const { return most_; }
  double search_seconds() const { return search_seconds_; }

  // After a search that took so long, of which `drawing` went into drawing all near lists once; they have
  // been drawn so many times since the search before.
  void searched(double seconds, double drawing, double times_drawn) {
    search_seconds_ += seconds;
    if (searches_++ == 0) return;
    // The number of pairs beyond those that nearly touch grows with the margin, that of searches falls with
    // it, so the sum is least where both cost the same.
    const double wasted = share_wasted * drawing * times_drawn, searching = seconds - drawing;
    margin_ *= wasted > 0 ? std::clamp(std::sqrt(searching / wasted), 0.7, 2.0) : 2.0;
    margin_ = std::clamp(margin_, least_, most_);
  }

 private:
  static constexpr double share_wasted = 0.5;  // of drawing, for candidates that the margin brings
  double margin_, least_, most_;
  double search_seconds_ = 0;
  int searches_ = 0;
};

}  // namespace moraine::dem::cpu
