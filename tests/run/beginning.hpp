// The grains of a case with the forces of its first step.
#pragma once
#include "case/case.hpp"
#include "dem/engine.hpp"
#include "output/files.hpp"
#include "run/stages.hpp"

namespace moraine {

inline dem::State state_at_step_0(const std::filesystem::path& directory) {
  const cases::Case c = cases::load(directory);
  const run::Start start = run::start_of(c);
  output::Checkpoint now = start.before;
  const run::Stage stage = run::prepare(c, 0, start, now);
  const auto engine = dem::make_engine(dem::Backend::cpu, 1);
  engine->load(stage.scene, now.state);
  return engine->state();
}

}  // namespace moraine
