// The figures of bench/memory-order, as comma-separated lines on standard output.
//   memory_order_time CASE THREADS ROUNDS STEPS STRAIN_BETWEEN_LOOKS STRAIN...
// Runs the last stage of a case whose stages before it are over (its `start`), twice: as grains stand in
// memory when it begins, and with the order renewed where it is lost, looked at that often. At each strain
// both states, and the first one sorted anew, are advanced by ROUNDS times STEPS steps in turns.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>

#include "dem/memory_order.hpp"
#include "dem/sums.hpp"
#include "run/run.hpp"
#include "run/stages.hpp"

using namespace moraine;
using Clock = std::chrono::steady_clock;

namespace {

// Of one thread its processor time, which others on the machine disturb less.
double seconds(int threads, const std::function<void()>& work) {
  const auto now = [&] {
    if (threads == 1) return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
    return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
  };
  const double began = now();
  work();
  return now() - began;
}

double median(std::vector<double> v, double at = 0.5) {
  std::sort(v.begin(), v.end());
  return v[static_cast<std::size_t>(at * static_cast<double>(v.size() - 1) + 0.5)];
}

// Of the contacts those between grains of different chunks, and the mean way in memory (powers of two).
struct Order {
  double across = 0, apart = 0;
};
Order order_of(const dem::State& s) {
  Order order;
  const dem::Index chunk = dem::chunk_size(s.size());
  for (const dem::Contact& c : s.contacts)
    order.across += c.i / chunk != c.j / chunk, order.apart += std::log2(c.j - c.i);
  const auto n = static_cast<double>(s.contacts.size());
  return {order.across / n, order.apart / n};
}

struct Bed {
  std::unique_ptr<dem::Engine> engine;
  dem::State state;
  int renewed = 0, looks = 0;
  double look_seconds = 0, renewal_seconds = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const cases::Case c = cases::load(argv[1]);
  const int threads = std::atoi(argv[2]), rounds = std::atoi(argv[3]), steps = std::atoi(argv[4]);
  const double strain_between = std::atof(argv[5]);
  const run::Start start = run::start_of(c);
  output::Checkpoint now = start.before;
  const std::size_t last = c.stages.size() - 1;
  const run::Stage stage = run::prepare(c, last, start, now);
  const double strain_a_step = stage.strain_rate * stage.scene.dt;
  const auto every = static_cast<std::int64_t>(strain_between / strain_a_step);
  const auto load = [&](const dem::State& s) {
    auto engine = dem::make_engine(dem::Backend::cpu, threads);
    engine->load(stage.scene, s);
    return engine;
  };
  Bed kept, renewed;
  for (Bed* bed : {&kept, &renewed}) bed->engine = load(now.state);
  std::printf(
      "strain,grains,contacts,threads,across,across_anew,across_renewed,apart,apart_anew,apart_renewed,"
      "ms,ms_anew,ms_renewed,ratio,ratio_low,ratio_high,ratio_renewed,looks,renewals,ms_a_look,"
      "ms_a_renewal\n");
  for (int k = 6; k < argc; ++k) {
    const auto until = static_cast<std::int64_t>(std::atof(argv[k]) / strain_a_step);
    for (Bed* bed : {&kept, &renewed})
      for (std::int64_t step = bed->engine->state().step; step < until;) {
        const std::int64_t next = std::min(until, (step / every + 1) * every);
        bed->engine->advance(next - step), step = next;
        if (bed == &kept || step % every != 0) continue;
        bool did = false;
        const double took = seconds(threads, [&] {
          dem::State s = bed->engine->state();
          did = dem::renew_order(stage.scene, s, run::Ordering{}.lost);
          if (did) bed->engine->load(stage.scene, s);
        });
        ++bed->looks, bed->renewed += did, (did ? bed->renewal_seconds : bed->look_seconds) += took;
      }
    dem::State s[3] = {kept.engine->state(), kept.engine->state(), renewed.engine->state()};
    dem::sort_spatially(stage.scene, s[1]);
    std::unique_ptr<dem::Engine> engine[3];
    std::vector<double> ms[3], ratio, ratio_renewed;
    for (int b = 0; b < 3; ++b) engine[b] = load(s[b]), engine[b]->advance(steps);
    for (int round = 0; round < rounds; ++round) {
      for (int b = 0; b < 3; ++b) {
        const int bed = (b + round) % 3;
        ms[bed].push_back(1e3 * seconds(threads, [&] { engine[bed]->advance(steps); }) / steps);
      }
      ratio.push_back(ms[0].back() / ms[1].back()), ratio_renewed.push_back(ms[2].back() / ms[1].back());
    }
    const Order o[3] = {order_of(s[0]), order_of(s[1]), order_of(s[2])};
    std::printf(
        "%s,%d,%zu,%d,%.3f,%.3f,%.3f,%.2f,%.2f,%.2f,%.4f,%.4f,%.4f,%.3f,%.3f,%.3f,%.3f,%d,%d,%.2f,%.2f\n",
        argv[k], s[0].size(), s[0].contacts.size(), threads, o[0].across, o[1].across, o[2].across,
        o[0].apart, o[1].apart, o[2].apart, median(ms[0]), median(ms[1]), median(ms[2]), median(ratio),
        median(ratio, 0.25), median(ratio, 0.75), median(ratio_renewed), renewed.looks, renewed.renewed,
        1e3 * renewed.look_seconds / std::max(1, renewed.looks - renewed.renewed),
        1e3 * renewed.renewal_seconds / std::max(1, renewed.renewed));
    std::fflush(stdout);
  }
}
