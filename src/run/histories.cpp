#include "run/histories.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace moraine::run {

namespace {

using dem::BodyId;

// use(history, drive, the number that the history stands for) for each that is there.
template <class Scene, class Use>
void for_each_history(Scene& scene, const Histories& h, Use&& use) {
  auto &wall = scene.body(BodyId::top_wall).z, &layer = scene.body(BodyId::top_layer).x;
  if (h.normal_stress.is_there()) use(h.normal_stress, wall, &dem::Drive::mean);
  if (h.shear_stress.is_there()) use(h.shear_stress, layer, &dem::Drive::mean);
  if (h.velocity.is_there()) use(h.velocity, layer, &dem::Drive::velocity);
}

}  // namespace

Histories histories_of(const cases::Stage& stage) {
  return {stage.normal_stress_history, stage.shear_stress_history, stage.velocity_history};
}

bool cover(const Histories& h, double end) {
  return h.normal_stress.covers(end) && h.shear_stress.covers(end) && h.velocity.covers(end);
}

void set_pieces(dem::Scene& scene, const Histories& histories, std::int64_t step) {
  for_each_history(scene, histories, [&](const History& h, dem::Drive& drive, double dem::Drive::*number) {
    const History::Piece piece = h.piece_at(scene.time(step));
    drive.*number = piece.value, drive.rate = piece.rate, drive.since = piece.since;
    drive.piecewise = true;
  });
}

std::int64_t next_pieces(const dem::Scene& scene, const Histories& histories, std::int64_t step) {
  auto next = std::numeric_limits<std::int64_t>::max();
  for_each_history(scene, histories, [&](const History& h, const dem::Drive&, double dem::Drive::*) {
    const double time = h.next_time(scene.time(step)), steps = std::ceil((time - scene.time_0) / scene.dt);
    if (!(steps < 1e18)) return;
    // But for rounding: the first step whose time is not before it.
    std::int64_t at = std::max(scene.step_0 + static_cast<std::int64_t>(steps) - 1, step + 1);
    while (scene.time(at) < time) ++at;
    next = std::min(next, at);
  });
  return next;
}

void advance(dem::Engine& engine, dem::Scene& scene, const Histories& histories, std::int64_t step,
             std::int64_t until) {
  while (step < until) {
    const std::int64_t next = next_pieces(scene, histories, step), to = std::min(next, until);
    engine.advance(to - step);
    step = to;
    if (step < next) continue;
    set_pieces(scene, histories, step);
    engine.redrive(scene);
  }
}

}  // namespace moraine::run
