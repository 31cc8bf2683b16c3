#include "dem/cpu/schedule.hpp"

#include <sys/resource.h>

#include <algorithm>

#include "dem/body/plane_contact.hpp"
#include "dem/cpu/rows.hpp"

namespace moraine::dem::cpu {

namespace {

// A chunk costs as much to bring into another core's cache as to compute, so it changes hands only where its
// thread is held up for longer than that.
constexpr int turns_before_help = 300;
constexpr int steps_between_checks = 256;

// Of this thread.
std::int64_t interruptions_so_far() {
  rusage used{};
  getrusage(RUSAGE_THREAD, &used);
  return used.ru_nivcsw;
}

void find_lost(const Bed& bed, Chunk& chunk, const BodyMotion& bodies) {
  chunk.lost = -1;
  for (Index i = chunk.begin; i < chunk.end && chunk.lost < 0; ++i)
    if (is_lost(bodies, bed.grain.data()[i])) chunk.lost = i;
}

}  // namespace

// One thread's part in a run.
class Worker {
 public:
  Worker(Schedule& schedule, const StepTasks& tasks, Exchange& exchange, Barrier& barrier, int thread,
         const Control& control, std::int64_t steps)
      : schedule_(schedule),
        bed_(schedule.bed_),
        traffic_(schedule.traffic_),
        tasks_(tasks),
        exchange_(exchange),
        barrier_(barrier),
        buffers_(schedule.buffers_[thread]),
        thread_(thread),
        layer_by_stress_(bed_.scene.body(BodyId::top_layer).x.kind == Drive::Kind::stress),
        control_(control),
        left_(steps),
        closing_(2 * fastest(bed_, control.bodies) * bed_.scene.dt) {
    for (Chunk& c : bed_.chunks)
      if (c.owner == thread) mine_.push_back(&c);
    std::stable_partition(mine_.begin(), mine_.end(), [&](const Chunk* c) { return others_wait_for(*c); });
    std::stable_partition(mine_.begin(), mine_.end(), [](const Chunk* c) { return c->needs_ghosts; });
  }

  Schedule::Pause run() {
    while (left_ > 0) {
      if (control_.stale) {
        control_.stale = false;  // taken up again where the lists had run out
      } else {
        const Schedule::Pause pause = move_on();
        if (pause != Schedule::Pause::done) return pause;
      }
      --left_;
      if (!do_forces()) return Schedule::Pause::failed;
    }
    return Schedule::Pause::done;
  }
  const Control& control() const { return control_; }
  std::int64_t left() const { return left_; }

 private:
  // A chunk whose pairs are done.
  struct Waiting {
    Chunk* chunk;
    LoadRow* load;
  };

  std::int64_t step() const { return control_.bodies.step; }
  double dt() const { return bed_.scene.dt; }
  bool exchanges_now() const { return bed_.uses.water && exchanges(bed_.scene, step()); }

  bool others_wait_for(const Chunk& c) const {
    return std::any_of(c.outgoing.begin(), c.outgoing.end(), [&](const Outgoing& out) {
      return out.to < static_cast<Index>(bed_.chunks.size()) && bed_.chunks[out.to].owner > thread_;
    });
  }

  // Totals of the step over all ranks, which all threads then find in the bed. Whether a grain is lost.
  bool share_tallies(std::int64_t step) {
    if (!traffic_) return false;
    if (thread_ == 0) schedule_.lost_ = traffic_->share_tallies(bed_, control_.bodies, step);
    barrier_.wait();
    return schedule_.lost_;
  }

  // Grains and bodies to the next step, with the forces on them known; whether lists last there.
  Schedule::Pause move_on() {
    const std::int64_t n = step();
    if (layer_by_stress_) {
      barrier_.wait();
      share_tallies(n);
      move_bodies();
    }
    if (!grains_are_ahead_)
      for (Chunk* c : mine_)
        move(*c, {control_.bodies, n, dt(), bed_.load.data(),
                  exchanges(bed_.scene, n) ? bed_.water.data() : nullptr});
    barrier_.wait();
    const bool lost_elsewhere = share_tallies(n);
    if (exchange_.has_failed(n)) return Schedule::Pause::failed;

    if (!layer_by_stress_) move_bodies();
    if (!control_.closed) control_.bodies.ledger.add(sum_dissipation(bed_, n));
    control_.closed = false;
    if (looks_for_lost() &&
        (lost_elsewhere || std::ranges::any_of(bed_.chunks, [](const Chunk& c) { return c.lost >= 0; })))
      return Schedule::Pause::lost;
    return lists_last() ? Schedule::Pause::done : Schedule::Pause::search;
  }
  bool looks_for_lost() const { return left_ == 1 || left_ % steps_between_checks == 0; }
  void move(Chunk& c, const ChunkStep& at) {
    tasks_.motion(bed_, c, at);
    if (measures_) measure_ways(bed_, c, at.step);
    if (looks_for_lost()) find_lost(bed_, c, control_.bodies);
  }
  void move_bodies() {
    control_.water = exchange_.reaction();
    control_.close_and_advance(bed_.scene, sum_reactions(bed_, control_.bodies));
  }

  bool lists_last() {
    closing_ = 2 * fastest(bed_, control_.bodies) * dt();
    control_.moved += closing_, control_.travelled += closing_;
    if (measures_) {
      control_.moved = std::min(control_.moved, approach_since_search(bed_, control_.bodies));
      measured_late_ = control_.moved > 0.7 * bed_.margin;
    }
    // Before the bound runs out it is worth while to measure how far grains have really moved.
    measures_ = !measured_late_ && control_.moved + 4 * closing_ >= bed_.margin;
    // One step must stay in hand: a contact that opens in this step still belongs in the near list, for
    // what its spring gives up.
    control_.stale = !(control_.moved + closing_ < bed_.margin);
    return !control_.stale;
  }

  // Forces of the present step, and with them the grains' way to the next one where that needs no more.
  // False: the water failed.
  bool do_forces() {
    // By the threads that moved them.
    const bool displaced = grains_are_ahead_;
    grains_are_ahead_ = left_ > 0 && !layer_by_stress_;
    if (traffic_ && thread_ == 0) traffic_->begin(bed_, step());
    if (exchanges_now() && !begin_exchange(displaced)) return false;
    take_on_mine();
    finish_waiting();
    return true;
  }

  // Those that need ghosts, which come first in the list, once their rows are here, so that shares are soon
  // under way; the others in the meantime.
  void take_on_mine() {
    const auto ghosts_end =
        std::ranges::partition_point(mine_, [](const Chunk* c) { return c->needs_ghosts; });
    auto with_ghosts = mine_.begin();
    const auto take_on_those = [&] {
      if (with_ghosts == ghosts_end || !traffic_->has_rows(step())) return;
      for (; with_ghosts != ghosts_end; ++with_ghosts) take_on(**with_ghosts), serve_ranks();
    };
    for (auto c = ghosts_end; c != mine_.end(); ++c) serve_ranks(), take_on_those(), take_on(**c);
    for (SpinWait wait; with_ghosts != ghosts_end; wait.once()) serve_ranks(), take_on_those();
  }
  void serve_ranks() {
    if (traffic_ && thread_ == 0) traffic_->progress(bed_, step());
  }

  bool begin_exchange(bool displaced) {
    if (traffic_) {
      if (thread_ == 0) exchange_.meet(bed_, control_.bodies);
      return true;
    }
    if (exchange_.stale()) {
      displaced = false;
      if (!exchange_.remap(bed_, control_.bodies, thread_ == 0, barrier_)) return false;
    }
    if (!displaced)
      for (const Chunk* c : mine_) exchange_.displace(bed_, *c);
    exchange_.arrive(bed_, control_.bodies, schedule_.threads_);
    return true;
  }

  void take_on(Chunk& c) {
    Schedule::Progress& progress = schedule_.progress_[c.number];
    if (!progress.take(step())) return;
    renew_near_pairs(bed_, c, {control_.travelled, closing_});
    // Loads that are asked for after this step go to their own place, all others to a buffer.
    const Waiting w{&c, grains_are_ahead_ ? buffers_.take(bed_.order.chunk) - c.begin : bed_.load.data()};
    for (const ChunkTask task : tasks_.at_once) task(bed_, c, {control_.bodies, step(), dt(), w.load});
    progress.done.store(step(), std::memory_order_release);
    if (c.needs_ghosts) traffic_->pairs_done();
    if (is_ready(c))
      complete(w);
    else
      waiting_.push_back(w);
  }

  // Whether all chunks that read this one's grains or send it shares have done their pairs, and the water is
  // solved.
  bool is_ready(const Chunk& c) const {
    if (exchanges_now() && !exchange_.is_solved(step())) return false;
    if (c.has_ghosts && !traffic_->has_shares(step())) return false;
    return std::all_of(c.incoming.begin(), c.incoming.end(), [&](Index l) {
      const Index from = bed_.links[l].from;
      return from < 0 || schedule_.progress_[from].done.load(std::memory_order_acquire) == step();
    });
  }

  void complete(Waiting w) {
    Chunk& c = *w.chunk;
    ChunkStep at{control_.bodies, step(), dt(), w.load};
    for (const ChunkTask task : tasks_.after_shares) task(bed_, c, at);
    if (exchanges_now()) {
      // To its own place where a later step may ask for it, else to a buffer.
      const bool keep = traffic_ || !grains_are_ahead_ || bed_.scene.exchange_interval > 1;
      WaterRow* const push = keep ? bed_.water.data() : buffers_.push.data() - c.begin;
      if (!traffic_) exchange_.push(bed_, c, push);
      at.push = push;
    }
    if (!grains_are_ahead_) return;
    move(c, at);
    // While they are in cache; the pressure of this step is solved for.
    if (!traffic_ && bed_.uses.water && exchanges(bed_.scene, step() + 1) && !exchange_.stale())
      exchange_.displace(bed_, c);
    buffers_.give_back(w.load + c.begin);
  }

  bool can_begin(const Chunk& c) const { return !c.needs_ghosts || traffic_->has_rows(step()); }

  // Chunks of its own that wait for others, and where that takes long, chunks that nobody has taken on.
  void finish_waiting() {
    std::size_t all_taken_from = bed_.chunks.size();
    for (SpinWait wait;;) {
      serve_ranks();
      const auto ready = std::ranges::find_if(waiting_, [&](const Waiting& w) { return is_ready(*w.chunk); });
      if (ready != waiting_.end()) {
        complete(*ready);
        waiting_.erase(ready);
        continue;
      }
      while (all_taken_from > 0 && schedule_.progress_[all_taken_from - 1].is_taken(step())) --all_taken_from;
      const bool sent = !traffic_ || thread_ > 0 || traffic_->is_over(step());
      if (waiting_.empty() && all_taken_from == 0 && sent) return;
      wait.once();
      if (all_taken_from > 0 && wait.turns() > turns_before_help &&
          can_begin(bed_.chunks[all_taken_from - 1])) {
        take_on(bed_.chunks[all_taken_from - 1]);
        wait.start_anew();
      }
    }
  }

  Schedule& schedule_;
  Bed& bed_;
  Traffic* const traffic_;
  const StepTasks& tasks_;
  Exchange& exchange_;
  Barrier& barrier_;
  Schedule::Buffers& buffers_;
  const int thread_;
  const bool layer_by_stress_;
  Control control_;
  std::int64_t left_;
  double closing_;                                 // m, of any two bodies in a step
  bool measures_ = false, measured_late_ = false;  // how far grains have moved since the search
  bool grains_are_ahead_ = false;                  // they have moved on to the next step, bodies have not
  std::vector<Chunk*> mine_;
  std::vector<Waiting> waiting_;
};

LoadRow* Schedule::Buffers::take(Index rows) {
  if (free_.empty()) {
    all_.emplace_back().resize(rows);
    clear(all_.back());
    free_.push_back(all_.back().data());
  }
  LoadRow* const taken = free_.back();
  free_.pop_back();
  return taken;
}

namespace {

// Stretches of chunks with about as much work each: chunks with large grains have many pairs.
void deal_by_work(std::vector<Chunk>& chunks, int threads) {
  double all = 0, before = 0;
  for (const Chunk& c : chunks) all += work_of(c);
  for (Chunk& c : chunks) {
    c.owner = std::min(threads - 1, static_cast<int>(threads * (before + 0.5 * work_of(c)) / all));
    before += work_of(c);
  }
}

}  // namespace

Schedule::Schedule(Bed& bed, Traffic* traffic, int threads)
    : bed_(bed),
      traffic_(traffic),
      threads_(threads),
      progress_(std::make_unique<Progress[]>(bed.chunks.size())),
      buffers_(threads) {
  deal_by_work(bed.chunks, threads);
  if (bed.uses.water)
    for (Buffers& b : buffers_) b.push.resize(bed.order.chunk);
}

Schedule::Pause Schedule::run(const StepTasks& tasks, Exchange& exchange, Control& control,
                              std::int64_t& steps) {
  Barrier barrier(threads_);
  Pause pause = Pause::done;
  const Control start = control;
  const std::int64_t wanted = steps;
  interruptions_ = 0;
  run_team(threads_, [&](int thread) {
    const std::int64_t before = interruptions_so_far();
    Worker worker(*this, tasks, exchange, barrier, thread, start, wanted);
    const Pause reason = worker.run();
    if (thread == 0) control = worker.control(), steps = worker.left(), pause = reason;
    interruptions_ += interruptions_so_far() - before;
  });
  return exchange.has_failed() ? Pause::failed : pause;
}

void Schedule::evaluate(const StepTasks& tasks, const BodyMotion& bodies, double dt) {
  clear(bed_.load);
  const ChunkStep at{bodies, bodies.step, dt, bed_.load.data()};
  if (traffic_) {
    traffic_->begin(bed_, at.step);
    for (SpinWait wait; !traffic_->has_rows(at.step); wait.once()) traffic_->progress(bed_, at.step);
  }
  for (Chunk& c : bed_.chunks) {
    for (const ChunkTask task : tasks.at_once) task(bed_, c, at);
    if (c.needs_ghosts) traffic_->pairs_done();
  }
  if (traffic_)
    for (SpinWait wait; !traffic_->is_over(at.step); wait.once()) traffic_->progress(bed_, at.step);
  for (Chunk& c : bed_.chunks)
    for (const ChunkTask task : tasks.after_shares) task(bed_, c, at);
}

}  // namespace moraine::dem::cpu
