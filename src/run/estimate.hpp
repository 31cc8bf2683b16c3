// How long a run will take: the engine is timed on beds like those to come, not on the grains of the start,
// which cost less than a bed while they fall and more where they are fast.
//
// A bed is made to be timed: the grains of the case, packed at random and pressed until they touch often
// enough, then shrunk a little so that they have the number of contacts that such a stage comes to. Its
// grains do not move by their forces while it is timed (the step is shortened, velocities lengthened by the
// same factor, so that displacements per step, and with them how often neighbours are searched for, are those
// of the run while a force does next to nothing): a bed made in a moment has not the forces of one at rest.
//
// Loose grains settle in three parts: until T = sqrt(2 D/g), D the way down of the highest grain, they fall
// and land, a share (t/T)^2 of them; for as long again they bounce; then they lie.
//
// Sizes of more than 1:4 are scattered unevenly, small grains within large ones. As many grains of one size,
// of the same volume together, are timed in their place, in a bed from the first step on.
#pragma once
#include "case/case.hpp"
#include "dem/engine.hpp"
#include "run/stages.hpp"

namespace moraine::run {

class Estimate {
 public:
  Estimate(const cases::Case& c, const Start& start, dem::Engine& engine);

  struct Time {
    double steps;    // of the stage
    double seconds;  // of the clock
    double ms() const { return 1e3 * seconds / steps; }
  };
  // duration: s of model time; dt: s, of the stage's grains.
  Time stage(std::size_t index, double duration, double dt);
  bool of_one_size() const { return one_size_; }  // whether grains of one size are timed

 private:
  void pack();
  dem::State with_contacts(double each) const;
  double per_step(const Stage& stage, dem::State bed, double speed);
  double falling(const Stage& stage, const dem::State& bed, double way, double duration);
  double processor_time() const;
  double rows(const Stage& stage, const dem::State& bed, double duration);

  const cases::Case& case_;
  bool loose_;  // whether grains start apart; else the bed of the start is timed
  bool one_size_;
  Start start_;  // of fewer grains where there are many
  dem::Engine& engine_;
  double scale_;  // grains of the case over those timed
  dem::State packed_;
};

}  // namespace moraine::run
