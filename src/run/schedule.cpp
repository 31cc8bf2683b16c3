#include "run/schedule.hpp"

#include <algorithm>
#include <cmath>

#include "dem/engine.hpp"
#include "dem/spectrum.hpp"

namespace moraine::run {

namespace {

std::int64_t between_exchanges(const dem::Scene& scene) {
  return std::max<std::int64_t>(1, scene.exchange_interval);
}

std::int64_t step_at(const dem::Scene& scene, double time) {
  const std::int64_t m = between_exchanges(scene);
  return scene.step_0 + m * std::llround((time - scene.time_0) / (static_cast<double>(m) * scene.dt));
}

// The next multiple of the interval that a later step is nearest to.
double next_multiple(const dem::Scene& scene, double interval, std::int64_t step) {
  double k = std::max(1.0, std::floor(scene.time(step) / interval));
  while (step_at(scene, k * interval) <= step) ++k;
  return k * interval;
}

}  // namespace

Event next_event(const Stage& stage, std::int64_t step) {
  const dem::Scene& scene = stage.scene;
  const double series = next_multiple(scene, stage.series_interval, step);
  const double snapshot = next_multiple(scene, stage.snapshot_interval, step);
  const double time = std::min({series, snapshot, stage.end});
  const std::int64_t at = step_at(scene, time);
  const bool end = at >= step_at(scene, stage.end);
  return {end ? stage.end : time, std::max(at, step + between_exchanges(scene)),
          end || at == step_at(scene, series), end || at == step_at(scene, snapshot), end};
}

std::int64_t last_step(const Stage& stage) { return step_at(stage.scene, stage.end); }

std::int64_t at_exchange(const Stage& stage, std::int64_t step) {
  const std::int64_t m = between_exchanges(stage.scene);
  return (step + m - 1) / m * m;
}

bool looks_at_order(const Stage& stage, std::int64_t step, std::int64_t between) {
  return step == at_exchange(stage, step / between * between);
}

std::int64_t next_look_at_order(std::int64_t step, std::int64_t between) {
  return (step / between + 1) * between;
}

double critical_step(const dem::Scene& scene, const dem::State& state) {
  return std::min(dem::critical_step(dem::spectrum(scene, state)), dem::one_contact_step(scene, state));
}

void fit_step(Stage& stage, dem::State& state, double longest) {
  const double left = next_event(stage, state.step).time - stage.scene.time(state.step);
  dem::change_step(stage.scene, state, left / std::ceil(left / longest));
}

}  // namespace moraine::run
