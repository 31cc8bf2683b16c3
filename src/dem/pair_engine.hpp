// The CPU's engine: each pair of near grains once, as many at a time as there are SIMD lanes.
//
// Three lists, each drawn from the one before: candidates within the neighbour margin (cells, rebuilt every
// few thousand steps), near pairs within a much smaller margin (every few dozen), and of these the
// overlapping ones carry force. Pairs belong to the chunk of their lower grain. A pair across two chunks
// leaves j's share in a slot that j's chunk collects, so that no two threads write to one place and every sum
// has one order (grain.hpp, SumOrder).
//
// So only earlier chunks read a chunk's grains or send it shares. Once their pairs are done, it is finished
// and its grains move on to the next step at once, while they are still in the cache: one pass over memory
// and one barrier a step. Loads live only from a chunk's pairs to its integration, in a buffer that a thread
// uses again for its next chunk.
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <vector>

#include "backend/team.hpp"
#include "dem/contact.hpp"
#include "dem/drive.hpp"
#include "dem/engine.hpp"
#include "dem/engine_parts.hpp"
#include "dem/leapfrog.hpp"
#include "dem/neighbours.hpp"

namespace moraine::dem {

class PairEngine final : public Engine {
 public:
  explicit PairEngine(int threads);  // 0: by the number of grains

  void load(const Scene& scene, const State& state, Surroundings* surroundings) override;
  void advance(std::int64_t steps) override;
  State state() const override;
  Counts counts() const override;
  std::string describe() const override;
  int threads() const override { return space_.threads; }

 private:
  // Where a grain's rows are, in bytes from the first LoadRow; its GrainRow is twice as far from the first of
  // those. Kept instead of the index because the loop over pairs would have to compute it.
  using Offset = std::uint32_t;
  static constexpr Offset row_bytes = sizeof(LoadRow);
  static_assert(sizeof(GrainRow) == 2 * row_bytes && sizeof(NowRow) == row_bytes);

  static constexpr int lanes = Pack::width;
  struct PairGroup {
    std::array<Offset, lanes> i, j;
    std::array<Offset, lanes> target;  // where j's share goes: j itself, or (from the first slot) a slot
  };
  // Near pairs, by (i, j).
  struct PairList {
    std::vector<PairGroup> pairs;
    std::vector<Vec3<Pack>> springs;
    std::vector<Pack> slipping;
    std::vector<bool> across_sides;  // groups with a pair that touches across periodic sides
    Index count = 0;

    void clear() { pairs.clear(), springs.clear(), slipping.clear(), across_sides.clear(), count = 0; }
    // Returns its place in the list. target: see PairGroup.
    Index add(Index i, Index j, Index target, bool across_sides, const Spring<double>& spring);
    // Fills the last group with a pair that never touches.
    void pad(Index i, Index far_away, Index target);
    Spring<double> spring(Index place) const;
  };
  struct Candidate {
    Index i, j;
    Index link;   // for pairs across chunks
    Index place;  // in the near list, or not_near
  };
  static constexpr Index not_near = -1;
  struct WallPair {
    Index i;
    WallName wall;
    Spring<double> spring;
  };
  // Slots for the pairs from one chunk to another.
  struct Link {
    Index from, to;
    Index first, used = 0, size = 0;  // in slots
  };
  struct alignas(64) Chunk {
    Index begin, end;
    std::vector<Candidate> candidates[2];  // inside the chunk, across
    PairList near[2], spare;
    std::vector<WallPair> walls;
    std::vector<Index> incoming;  // links, by the chunk they come from
    std::vector<Index> outgoing;
    std::vector<Index> top_layer;
    // What all threads read after a step. Two, for even and odd steps: a thread may be at the next step
    // already while another still reads.
    struct alignas(64) Tally {
      Reaction reaction;
      double slip = 0;                 // J, dissipated in the step
      double fastest2[3] = {0, 0, 0};  // largest v^2 by component
    } tally[2];
    Index lost = -1;  // a grain that went wrong
    const Tally& at(std::int64_t step) const { return tally[step & 1]; }
    Tally& at(std::int64_t step) { return tally[step & 1]; }
  };
  // What one thread needs while a chunk is under way.
  class Buffers {
   public:
    Host::Array<WaterRow> push;  // by the water, on the grains of a chunk; empty where there is no water

    // Loads of a chunk, all zero when taken and when given back.
    LoadRow* take(Index rows);
    void give_back(LoadRow* buffer) { free_.push_back(buffer); }

   private:
    std::vector<Host::Array<LoadRow>> all_;
    std::vector<LoadRow*> free_;
  };
  // The last step at which a thread took a chunk on, and at which its pairs were done.
  struct alignas(64) Progress {
    std::atomic<std::int64_t> taken{-1}, done{-1};
    bool is_taken(std::int64_t step) const { return taken.load(std::memory_order_relaxed) == step; }
    bool take(std::int64_t step) { return !is_taken(step) && taken.exchange(step) != step; }
  };
  // Each thread's own copy of what all agree on.
  struct Course {
    Drive drive;
    double moved, moved_near, near_margin;
    std::int64_t rebuilds_near = 0;
  };
  enum class Pause { done, search, lost, failed };

  void place_contacts(const std::vector<Contact>& contacts);
  void find_candidates();
  void rebuild_near(Chunk& chunk, const Drive& drive, double near_margin);
  double choose_near_margin(double speed, double moved) const;
  double fastest(const Drive& drive) const;
  Reaction sum_reactions(std::int64_t step) const;
  double sum_slip(std::int64_t step) const;
  bool others_are_done(const Chunk& chunk, std::int64_t step) const;
  double pending_slip() const;
  bool kicked_at(std::int64_t step) const { return exchanges(scene_, step); }
  WaterReaction water_at(std::int64_t step) const;
  void exchange_alone();
  LoadRow with_water(LoadRow load, Index i, std::int64_t step) const;

  template <Features F>
  Pause run(std::int64_t& steps, bool& at_forces);
  template <Features F>
  void evaluate(double dt);
  // load: where that of grain 0 would be, though only those of the chunk's grains need exist.
  template <Features F>
  void pair_forces(Chunk& chunk, double dt, LoadRow* load);
  template <Features F, bool to_slots>
  void pair_forces(PairList& list, double dt, LoadRow* load);
  template <Features F, bool to_slots>
  static void scatter(const PairGroup& pairs, const Geometry<Pack>& geometry, const Vec3<Pack>& f,
                      const Vec3<Pack>& f_x_n, const Pack& slip, LoadRow* load, LoadRow* slot);
  void collect(const Chunk& chunk, LoadRow* load, const LoadRow* slot) const;
  template <Features F>
  void finish(Chunk& chunk, const Drive& drive, double dt, LoadRow* load);
  // push: as load, of the water at this step; null where there is none.
  template <Features F>
  void integrate(Chunk& chunk, const Drive& drive, std::int64_t step, LoadRow* load, const WaterRow* push);
  void check(Chunk& chunk, const Drive& drive) const;
  [[noreturn]] void report_lost() const;

  Pause (PairEngine::*run_)(std::int64_t&, bool&) = nullptr;
  void (PairEngine::*evaluate_)(double) = nullptr;
  template <Features F>
  void select_features();

  const int threads_wanted_;
  Host space_;
  Scene scene_;
  Sides sides_;
  Index n_ = 0;
  Index chunk_size_ = 0;
  double r_max_ = 0, margin_ = 0;
  std::vector<Chunk> chunks_;
  std::unique_ptr<Progress[]> progress_;  // by chunk
  std::vector<Link> links_;
  Host::Array<Index> slot_owner_;
  Host::Array<GrainRow> grain_;  // n grains, then one that never touches
  Host::Array<NowRow> now_;      // viscous only
  Host::Array<LoadRow> load_;    // of the last step of advance()
  Host::Array<LoadRow> slot_;
  Host::Array<LoadRow> damping_, damping_slot_;  // the viscous part of them, where the ledger asks for it
  std::vector<Buffers> buffers_;                 // by thread
  Surroundings* surroundings_ = nullptr;
  Host::Array<WaterRow> water_;   // with surroundings only: at the last exchange, for state()
  WaterReaction water_reaction_;  // likewise
  // What surroundings threw, and at which step: a thread may be at the next one already, and fail there,
  // while another has not yet looked whether this one went well.
  static constexpr std::int64_t never = INT64_MAX;
  std::exception_ptr failure_;
  std::atomic<std::int64_t> failed_{never};
  std::atomic<int> displaced_{0};         // threads that have, at the present exchange
  std::atomic<std::int64_t> solved_{-1};  // the last exchange whose pressures are known
  Host::Array<Role> role_;
  Neighbours<Host> neighbours_;
  Course course_;
  bool closed_ = true;  // the account of the present step is in drive.ledger already
  Counts counts_;
  std::vector<Index> id_;
  std::vector<Vec3d> x_start_;
};

}  // namespace moraine::dem
