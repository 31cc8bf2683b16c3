// The CPU's engine: each pair of near grains once, as many at a time as there are SIMD lanes. Its rooms:
//
//   bed.hpp              rows of grains, chunks, links
//   neighbour_lists.hpp  candidates and near pairs; pair_list.hpp
//   tasks.hpp            the tasks of a step: pair_forces.cpp, body_forces.cpp, motion.cpp
//   water_exchange.hpp   meeting the pore water
//   schedule.hpp         which thread does what, when
//   search_margin.hpp, thread_count.hpp  what follows the clock, and changes no bit
#include "dem/cpu/pair_engine.hpp"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>

#include "backend/team.hpp"
#include "dem/scene_check.hpp"
#include "dem/state_rows.hpp"

namespace moraine::dem::cpu {

namespace {

// Ranks that may use just the cores that this one may.
int sharing_cores(Ranks& ranks) {
  struct Cores {
    char host[64] = {};
    cpu_set_t set;
  } own;
  gethostname(own.host, sizeof own.host - 1);
  CPU_ZERO(&own.set);
  sched_getaffinity(0, sizeof own.set, &own.set);
  int same = 0;
  for (const Cores& c : of_all(ranks, own))
    same += std::ranges::equal(c.host, own.host) && CPU_EQUAL(&c.set, &own.set);
  return same;
}

// All ranks together.
int default_threads(const Part& part, Index grains) {
  // Below some 1,500 grains a thread waits longer at barriers than it works.
  const int beside = part.ranks ? sharing_cores(*part.ranks) : 1;
  return std::clamp(grains / 1500, 1, std::max(1, available_cores() / beside));
}

}  // namespace

void PairEngine::load(const Scene& scene, const State& s, FluidCoupling* fluid) {
  check_scene(scene, s);
  load_part(scene, s, Part::whole(scene, s), motion_of(scene, s), {fluid, {}});
  if (s.staggered || !bed_.uses.damping()) return;
  State begun = state();
  remember_velocities(scene, begun);
  load(scene, begun, fluid);
}

void PairEngine::load_part(const Scene& scene, const State& s, const Part& part, const BodyMotion& bodies,
                           Water water) {
  kept_ = {};
  kept_.id = s.id, kept_.x_start = s.x_start, kept_.material = s.material, kept_.bodies = s.bodies;
  threads_ = threads_wanted_ > 0 ? threads_wanted_ : default_threads(part, s.size());
  if (!kept_.material.empty()) kept_.material.resize(s.size());  // without those of ghosts
  control_ = {};
  control_.bodies = bodies;
  control_.water = s.water;
  bed_ = {};
  bed_.load_state(scene, s, part, control_.bodies);
  traffic_ = part.ranks ? std::make_unique<Traffic>(*part.ranks) : nullptr;
  if (traffic_) traffic_->share_tallies(bed_, bodies, bodies.step - 1);  // the largest speeds
  tasks_ = tasks_for(scene);
  exchange_ =
      std::make_unique<Exchange>(bed_.uses.water ? water.fluid : nullptr, s.water, std::move(water.whole));
  count_.emplace(threads_);
  deal(threads_);
  margin_.emplace(bed_.margin, scene.neighbour_margin > 0 ? bed_.margin : 0.2 * bed_.margin,
                  std::max(bed_.margin, part.widest_margin));
  searches_ = 0;
  search();
  if (!s.staggered) start(scene);
}

// First forces, and velocities half a step back.
void PairEngine::start(const Scene& scene) {
  BodyMotion& bodies = control_.bodies;
  schedule_->evaluate(tasks_, bodies, 0.0);
  if (traffic_) traffic_->share_tallies(bed_, bodies, bodies.step);
  const Reaction reaction = sum_reactions(bed_, bodies);
  if (bed_.uses.water) {
    on_all_ranks(bed_.part.ranks, [&] { exchange_->alone(bed_, bodies); });
    control_.water = exchange_->reaction();
  }
  start_half_a_step_back(scene, reaction, reaction_at(scene, control_.water, bodies.step), bodies);
  for (Index i = 0; i < bed_.n; ++i) {
    LoadRow& load = bed_.load.data()[i];
    const LoadRow whole =
        bed_.uses.water ? with_water(scene, bodies.step, load, bed_.water.data()[i].f) : load;
    half_step_back(scene, bed_.grain.data()[i], bed_.material_of(i), whole);
    load.slip = load.viscous = 0;
  }
}

// Chunks to so many threads.
void PairEngine::deal(int threads) {
  space_.threads = threads;
  schedule_ = std::make_unique<Schedule>(bed_, traffic_.get(), threads);
}

void PairEngine::search() {
  const auto began = std::chrono::steady_clock::now();
  double times_drawn = 0;
  for (const Chunk& chunk : bed_.chunks)
    times_drawn += static_cast<double>(chunk.times_drawn) / static_cast<double>(bed_.chunks.size());
  // Never so narrow that grains cross it in a step or two: what has just opened must still be a candidate.
  const double closing = 2 * fastest(bed_, control_.bodies) * bed_.scene.dt;
  const double margin = of_rank_0(bed_.part.ranks, margin_->margin());
  bed_.margin = std::min(std::max(margin, 4 * closing), margin_->most());
  control_.travelled = 0;
  const double drawing = find_candidates(space_, bed_, grains_, control_, traffic_.get());
  if (traffic_) traffic_->count_work(bed_);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  margin_->searched(seconds, drawing, times_drawn);
  ++searches_;
  control_.moved = 0;
}

void PairEngine::advance(std::int64_t steps) {
  while (steps > 0) {
    const std::int64_t together = of_rank_0(bed_.part.ranks, std::min(steps, count_->steps_together()));
    std::int64_t left = together;
    const auto began = std::chrono::steady_clock::now();
    const Schedule::Pause pause = schedule_->run(tasks_, *exchange_, control_, left);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    steps -= together - left;
    count_->ran(together - left, seconds, schedule_->interruptions());
    if (count_->now() != schedule_->threads()) deal(count_->now());
    if (pause == Schedule::Pause::done) continue;
    on_all_ranks(bed_.part.ranks, [&] {
      check_lost(bed_, control_.bodies, kept_.id);  // of which the other pauses may come, too
      if (pause == Schedule::Pause::failed) exchange_->rethrow();
    });
    search();
  }
}

State PairEngine::read(bool contacts) const {
  State s = kept_;
  BodyMotion bodies = control_.bodies;
  if (!control_.closed) {
    if (traffic_) traffic_->share_tallies(bed_, bodies, bodies.step);
    bodies.close(bed_.scene, sum_reactions(bed_, bodies),
                 reaction_at(bed_.scene, exchange_->reaction(), bodies.step));
    bodies.ledger.add(pending_dissipation(bed_));
  }
  const GrainRow* const grain = bed_.grain.data();
  reserve(s, bed_.n, bed_.water.size());
  for (std::int64_t i = 0; i < bed_.water.size(); ++i) s.water_force.push_back(bed_.water.data()[i].f);
  for (Index i = 0; i < bed_.n; ++i) append_grain(s, grain[i], bed_.load.data()[i], bed_.part_of.data()[i]);
  if (contacts) append_contacts(s, bodies);
  finish_state(s, bodies);
  return s;
}

void PairEngine::append_contacts(State& s, const BodyMotion& bodies) const {
  const GrainRow* const grain = bed_.grain.data();
  std::size_t near = 0, at_planes = 0;  // contacts at most
  for (const Chunk& chunk : bed_.chunks) {
    for (const auto& candidates : chunk.candidates)
      near += static_cast<std::size_t>(std::ranges::count_if(candidates, [&](const Candidate& c) {
        return c.place != not_near && touch(bed_.sides, grain[c.i], grain[c.j]);
      }));
    at_planes += chunk.planes.size();
  }
  s.contacts.reserve(near), s.wall_contacts.reserve(at_planes);
  for (const Chunk& chunk : bed_.chunks) {
    for (int part = 0; part < 2; ++part)
      for (const Candidate& c : chunk.candidates[part])
        if (c.place != not_near)
          append_contact(s, bed_.scene, bed_.scene.between(bed_.material_of(c.i), bed_.material_of(c.j)),
                         bed_.sides, grain[c.i], grain[c.j], c.i, bed_.number(c.j),
                         chunk.near[part].spring(c.place));
    for (const PlanePair& p : chunk.planes)
      append_wall_contact(s, bed_.scene, bodies.plane[p.plane], grain[p.i], p.i, p.spring);
  }
}

Engine::Counts PairEngine::counts() const {
  Counts c{.rebuilds = searches_, .search_seconds = margin_ ? margin_->search_seconds() : 0};
  for (const Chunk& chunk : bed_.chunks)
    for (int part = 0; part < 2; ++part) {
      c.near += chunk.near[part].count;
      c.candidates += static_cast<std::int64_t>(chunk.candidates[part].size());
    }
  c.ghosts = bed_.ghosts();
  if (traffic_) c.bytes_sent = static_cast<std::int64_t>(traffic_->bytes_sent());
  return c;
}

std::string PairEngine::describe() const {
#if defined(__AVX2__)
  const char* set = has_wide_lanes() ? "AVX-512" : "AVX2";
#elif defined(__x86_64__)
  const char* set = "SSE2";
#elif defined(__aarch64__)
  const char* set = "NEON";
#else
  const char* set = "portable SIMD";
#endif
  return "cpu, " + std::to_string(threads_) + (threads_ == 1 ? " thread, " : " threads, ") + set;
}

}  // namespace moraine::dem::cpu

namespace moraine::dem {

std::unique_ptr<Engine> make_pair_engine(int threads) { return std::make_unique<cpu::PairEngine>(threads); }

}  // namespace moraine::dem
