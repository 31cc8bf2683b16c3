// From a state to a row of the series, and from the series to the table at the end.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "output/files.hpp"
#include "run/stages.hpp"

namespace moraine::run {

// loads: dem/observe.hpp; start: what the row counts from.
output::Row row_of(std::size_t index, const Stage& stage, const dem::State& state, const dem::Loads& loads,
                   const output::StageStart& start);
// What pore water adds to a row.
void add_water(output::Row& row, const Stage& stage, const coupling::PoreWater& water,
               const output::StageStart& start);

// 1 where a stage shears towards +x in the end, -1 towards -x.
double direction_of_shear(const std::vector<output::Row>& stage_rows);

// How the friction curve of a shear stage is read: friction along the direction of its shear, against the
// strain since it began, so that a bed sheared towards -x has the numbers of its mirror image.
//   peak: the largest value, but not the first, when the wall may still be finding its place
//   smoothed_peak: the largest mean over a window of shear strain 0.02
//   ultimate: the mean over the last third of the strain
struct Strength {
  double peak, peak_strain, smoothed_peak, ultimate;
  double dilation_diameters;  // at the end, from H_0
};
Strength strength_of(const std::vector<output::Row>& stage_rows);
// Of the last shear stage with rows; none where there is no such stage.
std::optional<Strength> final_strength(const std::vector<cases::Stage>& stages,
                                       const std::vector<output::Row>& rows);

// J: work of wall and layers, and what the grains fell.
double energy_put_in(const std::vector<output::Row>& stage_rows);

std::string summary(const std::vector<cases::Stage>& stages, const std::vector<output::Row>& rows);

}  // namespace moraine::run
