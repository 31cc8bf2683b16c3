// Stages that press: how the sides of the box move. Every so many steps they jump to where they should be
// (dem/deform.hpp); between two jumps they stand.
#pragma once
#include "dem/deform.hpp"
#include "run/stages.hpp"

namespace moraine::run {

constexpr std::int64_t steps_between_presses = 50;  // of the scene's clock, jumps are at multiples of this

bool presses(const Stage& stage);

// s, until a box that shrinks at strain_rate has this porosity. Throws Error naming the stage where it
// is denser already, or would become too narrow for its grains.
double pressing_time(const std::string& stage, const dem::Scene& scene, const dem::State& state,
                     double porosity, double strain_rate);

// The same under a top wall that comes down by strain_rate times height_0.
double squeezing_time(const std::string& stage, const dem::Scene& scene, const dem::State& state,
                      double height_0, double porosity, double strain_rate);

// Throws Error naming the stage where a side would shorten by too much in one jump.
void expect_small_jumps(const Stage& stage);

// What the sides are to be multiplied by now, for the steps up to the next jump.
dem::Vec3d next_press(const Stage& stage, const dem::State& state);

}  // namespace moraine::run
