#include "dem/ranks/ranked_engine.hpp"

#include <algorithm>
#include <tuple>

#include "dem/cpu/pair_engine.hpp"
#include "dem/ranks/state_parts.hpp"
#include "dem/scene_check.hpp"
#include "dem/state_rows.hpp"

namespace moraine::dem {

namespace {

enum class Order { load, redrive, advance, state, counts, dismiss };

// What a part is loaded with, beside its grains.
struct Loading {
  Scene scene;
  BodyMotion bodies;
  double r_max, margin, widest_margin;
  Index all;
  int threads;
};

// A rank's engine and the part of the bed that it has.
class RankPart {
 public:
  explicit RankPart(Ranks& ranks) : ranks_(ranks) {}

  void load(Parcel& parcel, cpu::PairEngine::Water water = {}) {
    Loading l;
    parcel.get(l);
    cpu::Part part{.ranks = &ranks_,
                   .all = l.all,
                   .r_max = l.r_max,
                   .margin = l.margin,
                   .widest_margin = l.widest_margin};
    parcel.add_to(part.first_chunks);
    part.first = part.first_chunk() * chunk_size(part.all);
    State state;
    get_part(parcel, state);
    parcel = {};  // of a large bed it is large
    scene_ = l.scene;
    engine_ = std::make_unique<cpu::PairEngine>(l.threads);
    engine_->load_part(l.scene, state, part, l.bodies, std::move(water));
  }
  void redrive(Parcel& parcel) {
    parcel.get(scene_.bodies);
    engine_->redrive(scene_);
  }
  cpu::PairEngine& engine() const { return *engine_; }

 private:
  Ranks& ranks_;
  Scene scene_;
  std::unique_ptr<cpu::PairEngine> engine_;
};

void tell(Ranks& ranks, Order order, const auto&... more) {
  Parcel parcel;
  parcel.put(order);
  (parcel.put(more), ...);
  for (int r = 1; r < ranks.size(); ++r) parcel.send(ranks, r);
}

class RankedEngine final : public Engine {
 public:
  RankedEngine(Ranks& ranks, int threads) : ranks_(ranks), threads_(threads), part_(ranks) {}

  void load(const Scene& scene, const State& state, FluidCoupling* fluid) override {
    check_scene(scene, state);
    if (const Index chunks = chunk_count(state.size()); chunks < ranks_.size())
      throw error("too few grains for ", ranks_.size(), " ranks: ", state.size(), " grains are ", chunks,
                  " chunks of ", chunk_size(state.size()),
                  ", and each rank takes one at least; start it on at most ", chunks,
                  chunks == 1 ? " rank" : " ranks");
    // Their places are one message (cpu/water_exchange.cpp).
    if (const Index most = 44'000'000; uses_of(scene).water && state.size() / ranks_.size() > most)
      throw error("too many grains with pore water for ", ranks_.size(), " ranks: ", state.size(),
                  "; expected at most ", most, " on each; use more ranks");
    scene_ = scene, fluid_ = fluid, tried_at_ = 0;
    together([&] { load_parts(state); });
    if (state.staggered || !uses_of(scene).damping()) return;
    State begun = this->state();
    remember_velocities(scene, begun);
    together([&] { load_parts(begun); });
  }
  void redrive(const Scene& scene) override {
    scene_.bodies = scene.bodies;
    tell(ranks_, Order::redrive, scene.bodies);
    part_.engine().redrive(scene);
  }
  void advance(std::int64_t steps) override {
    tell(ranks_, Order::advance, steps);
    together([&] { part_.engine().advance(steps); });
    share_anew();
  }
  State read(bool) const override {
    State s;
    together([&] {
      tell(ranks_, Order::state);
      s = part_.engine().state();
      for (int r = 1; r < ranks_.size(); ++r) {
        Parcel parcel = Parcel::from(ranks_, r);
        add_part(parcel, s, first_chunks_[r] * chunk_size(all_));
      }
    });
    std::ranges::sort(s.wall_contacts, {}, [](const WallContact& w) { return std::tuple(w.wall, w.i); });
    return s;
  }
  Counts counts() const override {
    const Counts own = part_.engine().counts();
    Counts sum{.rebuilds = own.rebuilds, .search_seconds = own.search_seconds};
    together([&] {
      tell(ranks_, Order::counts);
      for (const Counts& c : of_all(ranks_, own)) {
        sum.candidates += c.candidates, sum.near += c.near;
        sum.ghosts += c.ghosts, sum.bytes_sent += c.bytes_sent;
      }
    });
    sum.most_work = unevenness();
    return sum;
  }
  std::string describe() const override {
    const std::string one = loaded_ ? part_.engine().describe() : cpu::PairEngine(threads_).describe();
    return one.substr(0, 5) + std::to_string(ranks_.size()) + " ranks of " + one.substr(5);
  }
  int threads() const override { return loaded_ ? part_.engine().threads() : std::max(1, threads_); }

 private:
  // What all ranks do at once: if it fails on one alone, none can go on.
  template <class Act>
  void together(Act&& act) const {
    try {
      act();
    } catch (const SharedError&) {
      throw;
    } catch (const std::exception& e) {
      ranks_.abort(in_words(e));
    }
  }

  void load_parts(const State& state) {
    all_ = state.size();
    first_chunks_ = deal_chunks(state, ranks_.size());
    const cpu::Part whole = cpu::Part::whole(scene_, state);
    const Loading loading{
        scene_, motion_of(scene_, state), whole.r_max, whole.margin, whole.widest_margin, all_, threads_};
    const auto first = [&](int r) { return std::min(all_, first_chunks_[r] * chunk_size(all_)); };
    const auto parcel_for = [&](int r) {
      Parcel parcel;
      if (r > 0) parcel.put(Order::load);
      parcel.put(loading), parcel.put_list(first_chunks_);
      put_part(parcel, state, first(r), first(r + 1));
      return parcel;
    };
    for (int r = 1; r < ranks_.size(); ++r) parcel_for(r).send(ranks_, r);
    Parcel own = parcel_for(0);
    cpu::PairEngine::Water water{fluid_, {}};
    if (uses_of(scene_).water) water.whole = grain_rows(scene_, state);
    part_.load(own, std::move(water));
    loaded_ = true;
  }

  // The largest work of a rank over the mean.
  double unevenness() const {
    const std::vector<double>& work = part_.engine().work();
    double all = 0;
    for (const double w : work) all += w;
    return *std::ranges::max_element(work) * ranks_.size() / all;
  }

  // Deals chunks out again, where that would bring ranks nearer together.
  void share_anew() {
    const double uneven = unevenness();
    if (uneven < 1.1 || uneven < 1.05 * tried_at_) return;
    tried_at_ = uneven;
    const State now = state();
    if (deal_chunks(now, ranks_.size()) == first_chunks_) return;
    together([&] { load_parts(now); });
    tried_at_ = 0;
  }

  Ranks& ranks_;
  const int threads_;
  RankPart part_;
  Scene scene_;
  FluidCoupling* fluid_ = nullptr;
  Index all_ = 0;  // grains
  std::vector<Index> first_chunks_;
  bool loaded_ = false;
  double tried_at_ = 0;  // the largest share of work, of an even one, when chunks were last dealt out
};

}  // namespace

std::unique_ptr<Engine> make_ranked_engine(Ranks& ranks, int threads) {
  return std::make_unique<RankedEngine>(ranks, threads);
}

void serve(Ranks& ranks) {
  RankPart part(ranks);
  for (;;) {
    try {
      Parcel parcel = Parcel::from(ranks, 0, /*at_rest=*/true);
      Order order;
      parcel.get(order);
      switch (order) {
        case Order::load:
          part.load(parcel);
          break;
        case Order::redrive:
          part.redrive(parcel);
          break;
        case Order::advance: {
          std::int64_t steps = 0;
          parcel.get(steps);
          part.engine().advance(steps);
          break;
        }
        case Order::state: {
          Parcel answer;
          put_all(answer, part.engine().state());
          answer.send(ranks, 0);
          break;
        }
        case Order::counts:
          of_all(ranks, part.engine().counts());
          break;
        case Order::dismiss:
          return;
      }
    } catch (const SharedError&) {  // rank 0 has it, too, and says it
    } catch (const std::exception& e) {
      ranks.abort(in_words(e));
    }
  }
}

void dismiss(Ranks& ranks) { tell(ranks, Order::dismiss); }

}  // namespace moraine::dem
