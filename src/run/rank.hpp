// What a rank does that is not the first, and the first for the others.
#pragma once
#include "ranks/ranks.hpp"

namespace moraine::run {

// Serves rank 0 until it is over; returns the exit status. Signals are for rank 0.
int serve(Ranks& ranks);

// While there is one, the other ranks serve. Throws Error where they run another build. ranks: null where
// there are no others.
class Served {
 public:
  explicit Served(Ranks* ranks);
  ~Served();
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;

 private:
  Ranks* ranks_;
};

}  // namespace moraine::run
