// From a checked case to what the engine needs: the grains at the start, and for each stage its scene, its
// duration, and the state made ready (Damsgaard et al. 2013, par. 26).
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "case/case.hpp"
#include "coupling/pore_water.hpp"
#include "dem/scene.hpp"
#include "dem/state.hpp"
#include "output/files.hpp"
#include "run/histories.hpp"
#include "run/layers.hpp"

namespace moraine::run {

struct Start {
  output::Checkpoint
      before;  // the grains, and how an earlier case has left them (scene.dt = 0: there was none)
  double box_x, box_y, box_z;        // m, of the first stage; the later ones have what it leaves
  double wall_mass;                  // kg
  std::vector<dem::BodyId> roles{};  // by id: the layers of stages that shear; empty: by height
  std::string note{};                // for the log, about the grains
  std::string inputs{};              // files that grains and loads come from, with their digests
};
// Draws the grains, or reads them from case.start.
Start start_of(const cases::Case& c);

struct Stage {
  std::string name;
  cases::Stage::Kind kind;
  dem::Scene scene;
  coupling::Water water;
  bool goes_on;                               // as the stage before: nothing changes, not even a bit
  std::int64_t first_step;                    // of the scene's clock, as the next one
  double first_time, end;                     // s
  double duration;                            // s, end - first_time but for the rounding to steps
  double series_interval, snapshot_interval;  // s
  double height_0;                            // m, H_0 of strain and dilation
  double diameter;                            // m, mean of the grains
  double strain_rate;                         // 1/s, nominal: u/H_0, axial, or of each side
  Histories histories;                        // that bodies follow; the scene has the present pieces
  double porosity, pressure;                  // 1, Pa: what the grains are pressed to; 0: not
  std::vector<std::string> warnings;

  double time(std::int64_t step) const { return scene.time(step) - first_time; }  // s, since it began
};

// Whether the kind of stage drives a layer of grains along x.
bool shears(cases::Stage::Kind kind);
// m/s, given to the top layer; 0 where none is given. Of one that changes the largest there is to come.
double layer_velocity(const cases::Stage& stage, const dem::Scene& scene);
// Files besides the case that it reads: grains, then loads.
std::vector<std::filesystem::path> input_files(const cases::Case& c);
std::string input(const std::filesystem::path& file);  // its name and digest, as they are now
void take_layers_away(dem::Scene& scene);

// Makes the grains of `now` ready for stage `index` of the case and returns what drives them; scene,
// water_settings, height_0 and the beginning of the clock of `now` become those of the stage. `start` gives
// box and wall mass.
//
// A stage that asks for just what drives the grains already, and does not set them to zero, goes on as the
// one before, clock and sinusoids included: a stage that is cut in two ends with the same bits. Else the
// clock begins at 0. Stages that shear one after another keep their layers, and with them H_0 and what
// displacement and shear strain are counted from. Throws Error where no grain is left between the layers.
Stage prepare(const cases::Case& c, std::size_t index, const Start& start, output::Checkpoint& now);
// What the stage would find if the grains stayed where the start has them: to judge a case before it is run.
output::Checkpoint foreseen(const cases::Case& c, std::size_t index, const Start& start);
// The stage that is under way already (after a restart).
Stage describe(const cases::Case& c, std::size_t index, const output::Checkpoint& now);

// The pore water of a stage, null where it is dry; and the exchange interval that it sets. under_way: go on
// with the same bits. Throws Error where that is impossible (coupling/pore_water.hpp).
std::unique_ptr<coupling::PoreWater> fill(Stage& stage, const dem::State& grains,
                                          const coupling::WaterState& before, bool under_way);

// m, sum of d^3 over sum of d^2: of equal grains that have the same surface in the same volume. It is this
// diameter that Kozeny and Carman's permeability has.
double sauter_diameter(const dem::State& s);
double step_by_eq_9(const dem::Scene& scene, const dem::State& s, double f);  // s

}  // namespace moraine::run
