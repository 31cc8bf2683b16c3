// Steps one after the other with no return to the host, as a team of blocks takes them (backend/host.hpp):
// what GatherEngine launches. The tasks are those of step.hpp.
//
// Blocks wait for each other once a step: a block computes the forces of its grains at step n, moves them on
// to n + 1, and leaves what they add to the sums; after the barrier every block adds up the sums of all, in
// one order, and moves its own copy of the bodies. Rows and sums are kept twice, for even and odd steps: no
// block is more than one barrier ahead of another, so where it writes nobody reads any more. A layer driven
// by stress needs a second barrier, between forces and motion.
#pragma once
#include "dem/gpu/grain_tasks.hpp"

namespace moraine::dem::gpu {

// Memory that the threads of a block share: its own copy of what all blocks agree on, and tallies on their
// way into sums.
struct BlockMemory {
  static constexpr int tallies = 128;
  Control control;
  Tally total;
  Tally tally[tallies];
};

// Steps until `target`, or until the lists run out.
template <class Laws, Account account>
struct StepKernel {
  GatherView w;
  std::int64_t target;
  using Shared = BlockMemory;

  template <class Team>
  MORAINE_TEAM void operator()(const Team& team, Shared& shared) const {
    Control& c = shared.control;
    team.once([&] { c = *w.control; });
    std::int64_t step = c.bodies.step;
    // The last launch may have had other blocks.
    if (whole_chunks(team)) add_up_own_chunks(team, step, all());
    team.barrier();  // also so that nobody reads *w.control any more when it is written again
    const bool layer_by_stress = w.scene.body(BodyId::top_layer).x.kind == Drive::Kind::stress;
    bool stale = c.stale, forces_next = stale, moved_on = false;
    while (forces_next || step < target) {
      if (!forces_next) {
        if (layer_by_stress) {  // the layer's new velocity needs all forces on it first
          team.barrier();
          add_up(team, shared, step, sums());
          team.once([&] { move_bodies(c, shared.total); });
        }
        if (!moved_on) do_grains(team, shared, step, Part::motion);
        team.barrier();
        add_up(team, shared, step, layer_by_stress ? speeds() : all());
        team.once([&] {
          if (!layer_by_stress) move_bodies(c, shared.total);
          see_whether_lists_last(c, shared.total);
        });
        ++step;
        if ((stale = c.stale)) break;
      }
      stale = forces_next = false;
      moved_on = step < target && !layer_by_stress;
      do_grains(team, shared, step, moved_on ? Part::both : Part::forces);
    }
    if (team.block() == 0)
      team.once([&] {
        c.stale = stale;
        *w.control = c;
      });
  }

 private:
  using Tasks = GrainTasks<Laws, account>;

  // Of a step's tasks for grains: forces, motion to the next step, or both at one go.
  enum class Part { forces, motion, both };

  // Numbers of a tally, from first to end - 1 (TallyLayout).
  struct Numbers {
    int first, end;
    MORAINE_HD int count() const { return end - first; }
  };
  MORAINE_HD Numbers all() const { return {TallyLayout::speed, w.tallies.end()}; }
  MORAINE_HD Numbers sums() const { return {TallyLayout::first_sum, w.tallies.end()}; }
  MORAINE_HD Numbers speeds() const { return {TallyLayout::speed, TallyLayout::first_sum}; }
  MORAINE_HD Numbers of(Part part) const {
    return part == Part::forces ? sums() : part == Part::motion ? speeds() : all();
  }

  // All tasks of one grain in a step. All lanes come here; lane 0 fills in the tally.
  template <class Item>
  MORAINE_TEAM void one_grain(const Item& item, const BodyMotion& bodies, std::int64_t step, Index i,
                              Part part, Tally& tally) const {
    const Tasks tasks{w, bodies, step};
    LoadRow load{};
    if (part == Part::motion) {
      if (item.lane != 0) return;
      load = w.load[i];
    } else {
      tasks.pair_forces(item, i, load);
      if (item.lane != 0) return;
      tally = {};
      tasks.plane_forces(i, load, tally);
      tasks.layer_forces(i, load, tally);
      tally.sum[TallyLayout::slip] = load.slip, tally.sum[TallyLayout::viscous] = load.viscous;
      if (part == Part::forces) w.load[i] = load;
    }
    if (part != Part::forces) tally.speed2 = tasks.motion(i, load);
  }

  MORAINE_HD void move_bodies(Control& c, const Tally& total) const {
    if (!c.closed) c.bodies.ledger.add(TallyLayout::dissipation(total));
    c.close_and_advance(w.scene, w.tallies.reaction(total));
    c.closed = false;
  }
  MORAINE_HD void see_whether_lists_last(Control& c, const Tally& total) const {
    const double speed = max(sqrt(static_cast<double>(total.speed2)), c.bodies.fastest_plane());
    c.moved += 2 * speed * w.scene.dt;
    c.stale = !(c.moved < w.margin);
  }

  // Blocks take runs of groups in turn. Where there are many chunks a run is a whole one, and the block adds
  // it up for all others.
  template <class Team>
  MORAINE_TEAM bool whole_chunks(const Team& team) const {
    return w.chunks() >= 6 * team.blocks();
  }
  template <class Team>
  MORAINE_TEAM void do_grains(const Team& team, Shared& shared, std::int64_t step, Part part) const {
    Tally* const tally = w.tally[step & 1];
    const Numbers numbers = of(part);
    const Index at_once = least(team.items_at_once(), Shared::tallies) / group_size;
    const Index run = whole_chunks(team) ? w.chunk_groups() : at_once;
    for (Index begin = team.block() * run; begin < w.groups(); begin += team.blocks() * run)
      for (Index group = begin; group < begin + run && group < w.groups(); group += at_once) {
        const Index groups = least(at_once, begin + run - group, w.groups() - group),
                    i_0 = group * group_size, grains = least(groups * group_size, w.n - i_0);
        team.for_each_item(grains, [&](const auto& item) {
          one_grain(item, shared.control.bodies, step, i_0 + item.index, part, shared.tally[item.index]);
        });
        team.sync();
        team.for_each(groups * numbers.count(), [&](Index k) {
          const Index g = k / numbers.count();
          reduce(tally[group + g], numbers.first + k % numbers.count(), shared.tally + g * group_size,
                 least(group_size, grains - g * group_size));
        });
        team.sync();
      }
    if (whole_chunks(team)) add_up_own_chunks(team, step, numbers);
  }
  template <class Team>
  MORAINE_TEAM void add_up_own_chunks(const Team& team, std::int64_t step, Numbers numbers) const {
    const Index chunks = (w.chunks() - team.block() + team.blocks() - 1) / team.blocks();
    team.for_each(chunks * numbers.count(), [&](Index k) {
      const Index c = team.block() + k / numbers.count() * team.blocks();
      reduce(w.chunk_tally[step & 1][c], numbers.first + k % numbers.count(),
             w.tally[step & 1] + c * w.chunk_groups(), w.groups_of(c));
    });
  }

  // Of all grains, by chunks, into shared.total.
  template <class Team>
  MORAINE_TEAM void add_up(const Team& team, Shared& shared, std::int64_t step, Numbers numbers) const {
    const Tally *const tally = w.tally[step & 1], *const chunk_tally = w.chunk_tally[step & 1];
    for (Index c_0 = 0; c_0 < w.chunks(); c_0 += Shared::tallies) {
      const Index chunks = least(Shared::tallies, w.chunks() - c_0);
      team.for_each(chunks * numbers.count(), [&](Index k) {
        const Index at = k / numbers.count(), c = c_0 + at;
        const int what = numbers.first + k % numbers.count();
        if (whole_chunks(team))
          reduce(shared.tally[at], what, chunk_tally + c, 1);
        else
          reduce(shared.tally[at], what, tally + c * w.chunk_groups(), w.groups_of(c));
      });
      team.sync();
      team.for_each(numbers.count(),
                    [&](Index k) { reduce(shared.total, numbers.first + k, shared.tally, chunks, c_0 > 0); });
      team.sync();
    }
  }
  template <class... More>
  MORAINE_HD static Index least(Index a, Index b, More... more) {
    if constexpr (sizeof...(more) > 0) b = least(b, more...);
    return a < b ? a : b;
  }
};

}  // namespace moraine::dem::gpu
