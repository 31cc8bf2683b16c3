// From a checked case to what the engine needs: the grains at the start, and for each stage its scene, its
// duration, and the state made ready (Damsgaard et al. 2013, par. 26).
#pragma once
#include <string>

#include "case/case.hpp"
#include "coupling/pore_water.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"

namespace moraine::run {

struct Start {
  dem::State state;            // velocities at the step, not staggered
  double box_x, box_y, box_z;  // m
  double wall_mass;            // kg
  coupling::WaterState water;  // that the case before has left; empty where it was dry
};
// Draws the grains, or reads them from case.start.
Start start_of(const cases::Case& c);

struct Stage {
  std::string name;
  cases::Stage::Kind kind;
  dem::Scene scene;
  coupling::Water water;
  double duration;                            // s
  double series_interval, snapshot_interval;  // s
  double height_0;                            // m
  double diameter;                            // m, mean of the grains
  double strain_rate;                         // 1/s, nominal: u/H_0, or axial
};

// Makes `state` ready for stage `index` of the case and returns what drives it. `start` gives box and wall
// mass.
Stage prepare(const cases::Case& c, std::size_t index, const Start& start, dem::State& state);
// The same without touching a state that is under way already (after a restart).
Stage describe(const cases::Case& c, std::size_t index, const dem::Scene& scene, double height_0,
               const dem::State& state);

// The pore water of a stage, null where it is dry; and the exchange interval that it sets. restart: go on
// with the same bits. Throws Error where that is impossible (coupling/pore_water.hpp).
std::unique_ptr<coupling::PoreWater> fill(Stage& stage, const dem::State& grains,
                                          const coupling::WaterState& before, bool restart);

double mean_diameter(const dem::State& s);  // m
// m, sum of d^3 over sum of d^2: of equal grains that have the same surface in the same volume. It is this
// diameter that Kozeny and Carman's permeability has.
double sauter_diameter(const dem::State& s);
double step_by_eq_9(const dem::Scene& scene, const dem::State& s, double f);  // s

}  // namespace moraine::run
