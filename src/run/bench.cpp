#include <chrono>
#include <cstdio>

#include "error.hpp"
#include "ranks/ranks.hpp"
#include "run/run.hpp"
#include "run/schedule.hpp"
#include "run/stages.hpp"

namespace moraine::run {

void bench_case(const Options& options, const std::string& stage_name, std::int64_t steps) {
  const cases::Case c = cases::load(options.directory, options.overrides);
  std::size_t index = 0;
  if (!stage_name.empty()) {
    while (index < c.stages.size() && c.stages[index].name != stage_name) ++index;
    if (index == c.stages.size()) throw error("--stage ", stage_name, ": the case has no such stage");
  }
  const Start start = start_of(c);
  output::Checkpoint now = foreseen(c, index, start);
  Stage stage = prepare(c, index, start, now);
  const auto water = fill(stage, now.state, now.water, stage.goes_on);
  const auto engine = dem::make_engine(options.backend, options.threads, options.ranks);
  engine->load(stage.scene, now.state, water.get());
  steps = at_exchange(stage, steps);
  engine->advance(at_exchange(stage, std::min<std::int64_t>(100, steps)));  // warm caches and lists
  const dem::Engine::Counts before = engine->counts();
  const auto began = std::chrono::steady_clock::now();
  engine->advance(steps);
  const double ms =
      1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count() / steps;
  const auto counts = engine->counts();
  const dem::State end = engine->state();
  std::string of_ranks;
  if (options.ranks)
    of_ranks = text(", \"ranks\": ", options.ranks->size(), ", \"ghosts\": ", counts.ghosts,
                    ", \"bytes_per_step\": ", (counts.bytes_sent - before.bytes_sent) / steps,
                    ", \"most_work\": ", counts.most_work);
  std::printf(
      "{\"program\": \"moraine %s\", \"backend\": \"%s\", \"threads\": %d, \"stage\": \"%s\", \"steps\": "
      "%lld, "
      "\"grains\": %d, \"contacts\": %zu, \"pairs\": %lld, \"near_pairs\": %lld, \"ms_per_step\": %.6g, "
      "\"searches\": %lld, \"search_share\": %.3g, \"particle_steps_per_s\": %.6g%s%s}\n",
      MORAINE_VERSION, engine->describe().c_str(), engine->threads(), stage.name.c_str(),
      static_cast<long long>(steps), end.size(), end.contacts.size(),
      static_cast<long long>(counts.candidates), static_cast<long long>(counts.near), ms,
      static_cast<long long>(counts.rebuilds),
      (counts.search_seconds - before.search_seconds) / (1e-3 * ms * steps), end.size() / ms * 1e3,
      (water ? ", \"water\": \"" + water->solver() + "\"" : std::string()).c_str(), of_ranks.c_str());
}

}  // namespace moraine::run
