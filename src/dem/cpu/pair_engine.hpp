// The CPU's engine, of a whole bed or of the part of it that a rank has.
#pragma once
#include <memory>
#include <optional>

#include "dem/cpu/neighbour_lists.hpp"
#include "dem/cpu/schedule.hpp"
#include "dem/cpu/search_margin.hpp"
#include "dem/cpu/thread_count.hpp"
#include "dem/engine.hpp"

namespace moraine::dem::cpu {

class PairEngine final : public Engine {
 public:
  explicit PairEngine(int threads) : threads_wanted_(threads), threads_(std::max(1, threads)) {}

  void load(const Scene& scene, const State& state, FluidCoupling* fluid) override;
  void redrive(const Scene& scene) override {
    bed_.scene.bodies = scene.bodies;
    control_.bodies.redrive(bed_.scene);
  }
  void advance(std::int64_t steps) override;
  Counts counts() const override;
  std::string describe() const override;
  int threads() const override { return threads_; }

  // Of a part of a bed, on all ranks together: as load(), but that contacts do not yet remember velocities.
  // state: see Bed::load_state(); bodies and water as they are at its step. water: of the whole bed, on rank
  // 0; fluid likewise.
  struct Water {
    FluidCoupling* fluid = nullptr;
    std::vector<GrainRow> whole;
  };
  void load_part(const Scene& scene, const State& state, const Part& part, const BodyMotion& bodies,
                 Water water);
  // In pairs, of each rank at the last search.
  const std::vector<double>& work() const { return traffic_->work(); }

 protected:
  State read(bool contacts) const override;

 private:
  void deal(int threads);
  void search();
  void start(const Scene& scene);
  void append_contacts(State& s, const BodyMotion& bodies) const;

  const int threads_wanted_;  // 0: by the number of grains
  int threads_;               // at most
  Host space_;
  mutable Bed bed_;
  StepTasks tasks_;
  Control control_;
  CloseGrains grains_;
  mutable std::unique_ptr<Traffic> traffic_;  // null where there are no other ranks
  std::unique_ptr<Exchange> exchange_;
  std::unique_ptr<Schedule> schedule_;
  std::optional<SearchMargin> margin_;
  std::optional<ThreadCount> count_;
  std::int64_t searches_ = 0;
  State kept_;  // what no step changes: ids, x_start, materials, bodies that do not move
};

}  // namespace moraine::dem::cpu
