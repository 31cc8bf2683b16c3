// The GPU's loop with several lanes to a grain and many threads in a block, where there is no GPU: each
// thread is a fiber that runs until it must wait for others. A wait that can never end fails by name.
#include <ucontext.h>

#include <functional>

#include "backends.hpp"
#include "dem/gpu/gather_engine.hpp"
#include "physics/same_bits.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

class Fibers {
 public:
  void add(std::function<void()> body) {
    fibers_.push_back(std::make_unique<Fiber>());
    fibers_.back()->body = std::move(body);
  }
  void run() {
    for (const auto& f : fibers_) {
      getcontext(&f->context);
      f->stack = std::make_unique_for_overwrite<char[]>(stack_size);
      f->context.uc_stack.ss_sp = f->stack.get(), f->context.uc_stack.ss_size = stack_size;
      f->context.uc_link = &main_;
      makecontext(&f->context, start, 0);
    }
    for (std::size_t running = fibers_.size(); running > 0;) {
      progress_ = false;
      for (const auto& f : fibers_) {
        if (f->done) continue;
        current_ = f.get(), all_ = this;
        swapcontext(&main_, &f->context);
        if (f->done) --running, progress_ = true;
      }
      if (!progress_) throw error("all threads wait for one another");
    }
  }

  // Where so many meet.
  struct Meeting {
    int arrived = 0, turn = 0;
    void wait(int members) {
      const int mine = turn;
      if (++arrived == members) {
        arrived = 0, ++turn;
        all_->progress_ = true;
      }
      while (turn == mine) swapcontext(&current_->context, &all_->main_);
    }
  };

 private:
  static constexpr std::size_t stack_size = 64 * 1024;
  struct Fiber {
    ucontext_t context;
    std::unique_ptr<char[]> stack;
    std::function<void()> body;
    bool done = false;
  };
  static void start() {
    current_->body();
    current_->done = true;
  }
  static inline Fiber* current_ = nullptr;
  static inline Fibers* all_ = nullptr;
  std::vector<std::unique_ptr<Fiber>> fibers_;
  ucontext_t main_;
  bool progress_ = false;
};

// As Cuda (backend/cuda.cuh).
struct HostOfLanes : Host {
  int blocks = 1, units_at_once = 1;

  static constexpr int warp = 32;
  struct Warp {
    Fibers::Meeting meeting;
    bool any = false;
  };
  struct alignas(16) Slot {
    double number[10];
  };
  struct Block {
    Fibers::Meeting meeting;
    std::vector<Warp> warps;
    std::vector<Slot> slots;
  };

  struct Team {
    int thread, threads, block_, blocks_;
    Block* mine;
    Fibers::Meeting* all;

    int block() const { return block_; }
    int blocks() const { return blocks_; }
    template <class F>
    void for_each(int count, F&& f) const {
      for (int k = thread; k < count; k += threads) f(k);
    }
    struct Item {
      static constexpr int lanes = 4;
      int index, lane, together;
      Warp* warp;
      Slot* slot;
      bool any(bool so) const {
        if (so) warp->any = true;
        warp->meeting.wait(together);
        const bool result = warp->any;
        warp->meeting.wait(together);
        warp->any = false;
        warp->meeting.wait(together);
        return result;
      }
      template <class T, class Use>
      void in_order(const T& value, Use&& use) const {
        *reinterpret_cast<T*>(slot + lane) = value;
        warp->meeting.wait(together);
        for (int k = 0; k < lanes; ++k) use(*reinterpret_cast<const T*>(slot + k));
        warp->meeting.wait(together);
      }
    };
    template <class F>
    void for_each_item(int count, F&& f) const {
      const int lane = thread % Item::lanes;
      for (int k = thread / Item::lanes; k < count; k += items_at_once()) {
        const int left = (count - k) * Item::lanes + thread % warp - lane;
        f(Item{k, lane, std::min(left, warp), &mine->warps[thread / warp], &mine->slots[thread - lane]});
      }
    }
    int items_at_once() const { return threads / Item::lanes; }
    void sync() const { mine->meeting.wait(threads); }
    template <class F>
    void once(F&& f) const {
      sync();
      if (thread == 0) f();
      sync();
    }
    void barrier() const { all->wait(threads * blocks_); }
  };

  template <class Body>
  void cooperate(std::int64_t units, int unit, const Body& body) const {
    const int used = static_cast<int>(
                  std::min<std::int64_t>(blocks, (units + units_at_once - 1) / units_at_once)),
              threads = units_at_once * unit * Team::Item::lanes;
    std::vector<Block> block(used);
    std::vector<typename Body::Shared> shared(used);
    Fibers::Meeting all;
    Fibers fibers;
    for (int b = 0; b < used; ++b) {
      block[b].warps.resize(threads / warp), block[b].slots.resize(threads);
      for (int t = 0; t < threads; ++t)
        fibers.add([&, b, t] { body(Team{t, threads, b, used, &block[b], &all}, shared[b]); });
    }
    fibers.run();
  }
};

TEST(Lanes, SameBitsAsPairs) {
  std::vector<Bed> beds{sheared_bed(), sheared_bed(), cloud(700, 0.2, 5)};
  beds[1].scene.body(BodyId::top_layer).x = Drive::by(400);
  ContactParameters& grain = beds[1].scene.with(Material::grain);
  grain.gamma_n = grain.gamma_t = 5;
  const std::int64_t steps = 40;
  for (std::size_t k = 0; k < beds.size(); ++k) {
    SCOPED_TRACE(k);
    Scene scene = beds[k].scene;
    const State& start = beds[k].state;
    const State by_pairs = run(*make_engine(Backend::cpu, 1), scene, start, steps);
    scene.neighbour_margin = 0.02 * *std::max_element(start.r.begin(), start.r.end());
    for (const auto& [blocks, units_at_once] : {std::pair{1, 1}, std::pair{2, 3}, std::pair{5, 2}}) {
      HostOfLanes space;
      space.blocks = blocks, space.units_at_once = units_at_once;
      gpu::GatherEngine<HostOfLanes> engine(space, "lanes on the host");
      engine.load(scene, start, nullptr);
      engine.advance(1);
      engine.advance(steps - 1);
      expect_same_bits(engine.state(), by_pairs);
    }
  }
}

}  // namespace
}  // namespace moraine::dem
