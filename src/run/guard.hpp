// Stops a run that goes wrong, with one error that names cause, grain, step, place and remedy. It reads
// states at fixed steps and writes nothing, so the bits of a healthy run are those of a run without it.
//
//   numbers    forces, torques, planes and layers are finite (the engine itself watches x, v and omega), and
//              the top wall is above the floor
//   overlap    of two grains, or of a grain and a wall, over the radius of the smaller: <=
//   guards.max_overlap.
//              Linear springs are meant for hardly deformed spheres; at 0.2 each of two equal grains has lost
//              0.7 % of its volume in the contact
//   energy     |residue| <= guards.max_residue times (energy stored when the stage began + the most that
//   wall,
//              layers and falling grains had put in so far). What sliding and damping have "dissipated" must
//              not be negative either. Without a ledger dissipation is unknown; then only more energy than
//              was stored and put in is an error
#pragma once
#include <vector>

#include "run/record.hpp"

namespace moraine::run {

class Guard {
 public:
  // `rows`: the series so far, with at least the first row of this stage. Stage and start have to outlive it.
  Guard(const cases::Guards& limits, const Stage& stage, const std::vector<output::Row>& rows,
        const output::StageStart& start);

  std::int64_t every() const { return limits_.interval; }  // steps
  // Throws Error. loads: those of the state where they are at hand; null: they are found for it.
  void check(const dem::State& state, const dem::Loads* loads = nullptr);
  // At times of the clock, where a check must not decide how a run ends but a checkpoint should be good.
  bool finds_healthy(const dem::State& state) const;

 private:
  void check_energy(const dem::State& state, const dem::Loads& loads);

  cases::Guards limits_;
  const Stage& stage_;               // whose step may change meanwhile
  output::Row first_;                // of the stage
  const output::StageStart& start_;  // a press moves what rows count from
  double most_put_in_ = 0;           // J
};

// The deepest overlap of a state's contacts, as a fraction of the smaller radius.
struct Overlap {
  double fraction = 0, depth = 0;  // 1, m
  dem::Index i = -1, j = -1;       // memory order; j = -1: a wall
  dem::BodyId wall = dem::BodyId::floor;
};
Overlap deepest_overlap(const dem::Scene& scene, const dem::State& state);
std::string describe(const Overlap& overlap, const dem::State& state);

}  // namespace moraine::run
