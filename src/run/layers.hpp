// The layers of grains that a shear stage holds and drives: the lowest and the highest, by grain centres
// (Damsgaard et al. 2013, par. 26), each one largest diameter thick unless the case says otherwise.
#pragma once
#include <string>
#include <vector>

#include "case/case.hpp"
#include "dem/state.hpp"

namespace moraine::run {

double bed_top(const dem::State& s);        // m, of the highest grain
double mean_diameter(const dem::State& s);  // m

// Makes grains part of the layers; returns warnings, of a bed that is thin between the layers. Throws Error
// where a layer swallows all of it.
std::vector<std::string> choose_layers(const cases::Stage& stage, dem::State& s);

// The layers that the grains came with, by id; returns a warning where the stage asks for others. Throws
// Error where no grain is driven or none is free.
std::vector<std::string> take_layers(const cases::Stage& stage, const std::vector<dem::BodyId>& roles,
                                     dem::State& s);

// The same judgement of loose grains that have yet to become a bed, by their volume. area: m2, of the box.
std::vector<std::string> foresee_layers(const cases::Stage& stage, const dem::State& s, double area);

}  // namespace moraine::run
