// Steps one after the other with no return to the host, as a team of blocks takes them (backend/host.hpp):
// what GatherEngine launches.
//
// Blocks wait for each other once a step: a block computes the forces of its grains at step n, moves them on
// to n + 1, and leaves what they add to the sums; after the barrier every block adds up the sums of all, in
// one order, and moves its own copy of the wall. Rows and sums are kept twice, for even and odd steps: no
// block is more than one barrier ahead of another, so where it writes nobody reads any more. A layer driven
// by stress needs a second barrier, between forces and motion.
#pragma once
#include <limits>

#include "dem/engine_parts.hpp"

namespace moraine::dem {

// What all blocks agree on.
struct Control {
  Drive drive;
  double moved = 0;     // m, bound on the approach of any two bodies since the last search
  bool stale = false;   // the lists have run out, or a grain is lost: grains are at this step, forces are not
  bool closed = true;   // the account of the present step is in drive.ledger already
  WaterReaction water;  // of the last exchange

  MORAINE_HD WaterReaction water_at(const Scene& scene) const {
    if (exchanges(scene, drive.step)) return water;
    return {water.wall_between, 0, 0, water.wall_between};
  }
};

// What a grain, a group of them, a chunk or all add to a step's sums.
struct Note {
  double slip = 0;  // J, dissipated in the step
  Reaction reaction;
  float speed2 = 0;  // m2/s2, the largest, rounded up; infinite where a grain is lost

  static constexpr int speed = 0, first_sum = 1;  // `what` of gather_up()
  static constexpr int sums(const Features& f) { return f.damped && f.ledger ? 6 : 3; }
  MORAINE_HD double& sum(int what) { return reinterpret_cast<double*>(this)[what - first_sum]; }
  MORAINE_HD double sum(int what) const { return reinterpret_cast<const double*>(this)[what - first_sum]; }
};
static_assert(sizeof(Reaction) == 5 * sizeof(double));

// One number of `to` from those of the notes, added up in order (or on top of what it is). Many are read
// before the first is added: memory is far away. Zeros at the end change nothing.
MORAINE_HD void gather_up(Note& to, int what, const Note* notes, Index count, bool on_top = false) {
  constexpr Index batch = 32;
  if (what == Note::speed) {
    float fastest = on_top ? to.speed2 : 0, next[batch];
    for (Index begin = 0; begin < count; begin += batch) {
      for (Index k = 0; k < batch; ++k) next[k] = begin + k < count ? notes[begin + k].speed2 : 0;
      for (Index k = 0; k < batch; ++k) fastest = ::fmaxf(next[k], fastest);
    }
    to.speed2 = fastest;
  } else {
    double sum = on_top ? to.sum(what) : 0, next[batch];
    for (Index begin = 0; begin < count; begin += batch) {
      for (Index k = 0; k < batch; ++k) next[k] = begin + k < count ? notes[begin + k].sum(what) : 0;
      for (Index k = 0; k < batch; ++k) sum += next[k];
    }
    to.sum(what) = sum;
  }
}

// Everything a step reads and writes, as plain pointers; [2]: for even and odd steps.
struct GatherView {
  Scene scene;
  Sides sides;
  Index n, chunk;
  double margin;
  GrainRow* grain[2];
  NowRow* now[2];
  LoadRow* load;          // of the last step of a launch; with a layer driven by stress, of each
  const WaterRow* water;  // of the last exchange; null without pore water
  const Role* role;
  const std::int64_t* row;
  const Index* neighbour;
  Spring<double>*spring, *wall_spring;
  Note* tally[2];        // by group
  Note* chunk_tally[2];  // where blocks have whole chunks
  Control* control;

  MORAINE_HD Index chunks() const { return (n + chunk - 1) / chunk; }
  MORAINE_HD Index groups() const { return (n + group_size - 1) / group_size; }
  MORAINE_HD Index chunk_groups() const { return chunk / group_size; }
  // The groups of a chunk: from c * chunk_groups(), so many.
  MORAINE_HD Index groups_of(Index c) const {
    const Index left = groups() - c * chunk_groups();
    return left < chunk_groups() ? left : chunk_groups();
  }
};

namespace gather {

// A block's own copy of what all agree on, and notes on their way into sums.
struct Desk {
  static constexpr int notes = 128;
  Control control;
  Note total;
  Note note[notes];
};

// Steps until `target`, or until the lists run out.
template <Features F>
struct March {
  GatherView w;
  std::int64_t target;
  using Desk = gather::Desk;

  template <class Team>
  MORAINE_TEAM void operator()(const Team& team, Desk& desk) const {
    Control& c = desk.control;
    team.once([&] { c = *w.control; });
    std::int64_t step = c.drive.step;
    // The last launch may have had other blocks.
    if (whole_chunks(team)) add_up_own_chunks(team, step, Note::speed, sums_end);
    team.barrier();  // also so that nobody reads *w.control any more when it is written again
    const bool layer_by_stress = w.scene.shear.drive == Shear::Drive::stress;
    bool stale = c.stale, forces_next = stale, moved_on = false;
    while (forces_next || step < target) {
      if (!forces_next) {
        if (layer_by_stress) {  // the layer's new velocity needs all forces on it first
          team.barrier();
          add_up(team, desk, step, Note::first_sum, sums_end);
          team.once([&] { close_and_advance(c, desk.total); });
        }
        if (!moved_on) take_turns(team, desk, step, /*forces=*/false, /*move=*/true);
        team.barrier();
        add_up(team, desk, step, Note::speed, layer_by_stress ? Note::first_sum : sums_end);
        team.once([&] {
          if (!layer_by_stress) close_and_advance(c, desk.total);
          note_movement(c, desk.total);
        });
        ++step;
        if ((stale = c.stale)) break;
      }
      stale = forces_next = false;
      moved_on = step < target && !layer_by_stress;
      take_turns(team, desk, step, /*forces=*/true, moved_on);
    }
    if (team.block() == 0)
      team.once([&] {
        c.stale = stale;
        *w.control = c;
      });
  }

 private:
  static constexpr int sums_end = Note::first_sum + Note::sums(F);

  MORAINE_HD void close_and_advance(Control& c, const Note& total) const {
    if (!c.closed) {
      c.drive.close(w.scene, total.reaction, c.water_at(w.scene));
      c.drive.ledger.slip += total.slip;
    }
    c.closed = false;
    c.drive.advance(w.scene);
  }
  MORAINE_HD void note_movement(Control& c, const Note& total) const {
    const double speed = max(sqrt(static_cast<double>(total.speed2)), ::fabs(c.drive.wall_v));
    c.moved += 2 * speed * w.scene.dt;
    c.stale = !(c.moved < w.margin);
  }

  // Blocks take runs of groups in turn. Where there are many chunks a run is a whole one, and the block adds
  // it up for all others.
  template <class Team>
  MORAINE_TEAM bool whole_chunks(const Team& team) const {
    return w.chunks() >= 6 * team.blocks();
  }
  // A block's turn after turn over its grains: forces at `step`, or motion to step + 1, or both at one go.
  template <class Team>
  MORAINE_TEAM void take_turns(const Team& team, Desk& desk, std::int64_t step, bool forces,
                               bool move) const {
    Note* const tally = w.tally[step & 1];
    const int first_what = move ? Note::speed : Note::first_sum,
              end_what = forces ? sums_end : Note::first_sum, whats = end_what - first_what;
    const Index at_once = least(team.items_at_once(), Desk::notes) / group_size;
    const Index run = whole_chunks(team) ? w.chunk_groups() : at_once;
    for (Index begin = team.block() * run; begin < w.groups(); begin += team.blocks() * run)
      for (Index group = begin; group < begin + run && group < w.groups(); group += at_once) {
        const Index groups = least(at_once, begin + run - group, w.groups() - group),
                    i_0 = group * group_size, grains = least(groups * group_size, w.n - i_0);
        team.for_each_item(grains, [&](const auto& item) {
          const Note note = one_grain(item, desk.control.drive, step, i_0 + item.index, forces, move);
          if (item.lane == 0) desk.note[item.index] = note;
        });
        team.sync();
        team.for_each(groups * whats, [&](Index k) {
          const Index g = k / whats;
          gather_up(tally[group + g], first_what + k % whats, desk.note + g * group_size,
                    least(group_size, grains - g * group_size));
        });
        team.sync();
      }
    if (whole_chunks(team)) add_up_own_chunks(team, step, first_what, end_what);
  }
  template <class Team>
  MORAINE_TEAM void add_up_own_chunks(const Team& team, std::int64_t step, int first_what,
                                      int end_what) const {
    const Index chunks = (w.chunks() - team.block() + team.blocks() - 1) / team.blocks();
    const int whats = end_what - first_what;
    team.for_each(chunks * whats, [&](Index k) {
      const Index c = team.block() + k / whats * team.blocks();
      gather_up(w.chunk_tally[step & 1][c], first_what + k % whats, w.tally[step & 1] + c * w.chunk_groups(),
                w.groups_of(c));
    });
  }

  // Of all grains, by chunks, into desk.total.
  template <class Team>
  MORAINE_TEAM void add_up(const Team& team, Desk& desk, std::int64_t step, int first_what,
                           int end_what) const {
    const Note *const tally = w.tally[step & 1], *const chunk_tally = w.chunk_tally[step & 1];
    const int whats = end_what - first_what;
    for (Index c_0 = 0; c_0 < w.chunks(); c_0 += Desk::notes) {
      const Index chunks = least(Desk::notes, w.chunks() - c_0);
      team.for_each(chunks * whats, [&](Index k) {
        const Index at = k / whats, c = c_0 + at;
        if (whole_chunks(team))
          gather_up(desk.note[at], first_what + k % whats, chunk_tally + c, 1);
        else
          gather_up(desk.note[at], first_what + k % whats, tally + c * w.chunk_groups(), w.groups_of(c));
      });
      team.sync();
      team.for_each(whats,
                    [&](Index k) { gather_up(desk.total, first_what + k, desk.note, chunks, c_0 > 0); });
      team.sync();
    }
  }
  template <class... More>
  MORAINE_HD static Index least(Index a, Index b, More... more) {
    if constexpr (sizeof...(more) > 0) b = least(b, more...);
    return a < b ? a : b;
  }

  // All lanes come here; what counts is the note of lane 0.
  template <class Item>
  MORAINE_TEAM Note one_grain(const Item& item, const Drive& drive, std::int64_t step, Index i, bool forces,
                              bool move) const {
    Note note;
    LoadRow load{};
    if (forces) {
      LoadRow damping{};
      add_contacts(item, step, i, load, damping);
      if (item.lane != 0) return note;
      add_walls(drive, step, i, load, damping, note.reaction);
      note.slip = load.slip;
      if (w.role[i] == Role::top) {
        note.reaction.shear_force = load.f.x;
        if constexpr (F.damped && F.ledger) note.reaction.layer_damping = damping.f.x;
      }
      if constexpr (F.damped && F.ledger)
        note.reaction.damping_power =
            damping_power(w.scene, w.grain[step & 1][i], with_water(load, i, step), damping, w.scene.dt);
      if (!move) w.load[i] = load;
    } else {
      if (item.lane != 0) return note;
      load = w.load[i];
    }
    if (move) note.speed2 = move_on(drive, step, i, load);
    return note;
  }

  struct Share {
    Vec3d f;
    double slip;
    Vec3d f_x_n;
    double lever;
  };
  template <class Item>
  MORAINE_TEAM void add_contacts(const Item& item, std::int64_t step, Index i, LoadRow& load,
                                 LoadRow& damping) const {
    const std::int64_t end = w.row[i + 1];
    for (std::int64_t k_0 = w.row[i]; item.any(k_0 < end); k_0 += Item::lanes) {
      const std::int64_t k = k_0 + item.lane;
      Share share{}, viscous{};
      if (k < end) contact(step, i, w.neighbour[k], w.spring[k], share, viscous);
      item.in_order(share, [&](const Share& s) { load.add(s.f, s.lever, s.f_x_n, s.slip); });
      if constexpr (F.viscous && F.ledger)
        item.in_order(viscous, [&](const Share& s) { damping.add(s.f, s.lever, s.f_x_n, s.slip); });
    }
  }
  // What the contact with j does to i.
  MORAINE_HD void contact(std::int64_t step, Index i, Index j, Spring<double>& spring, Share& share,
                          Share& viscous) const {
    const GrainRow* const grain = w.grain[step & 1];
    const bool first = i < j;
    const GrainRow &a = grain[first ? i : j], &b = grain[first ? j : i];
    const Geometry<double> g = between_grains(nearest_image(w.sides, a.x - b.x), a.r + b.r, a.r - b.r);
    const Motion<double> before{a.v - b.v, a.omega, b.omega};
    Motion<double> at = before;
    if constexpr (F.viscous) {
      const NowRow* const now = w.now[step & 1];
      const NowRow &p = now[first ? i : j], &q = now[first ? j : i];
      at = {p.v - q.v, p.omega, q.omega};
    }
    const Action<double> action = contact_law<F>(w.scene.grain, w.scene.dt, g, before, at, spring);
    // A pair of an earlier chunk comes by way of a slot, where its torque has been rounded by itself.
    const bool by_slot = j < i / w.chunk * w.chunk;
    const auto on_i = [&](const Vec3d& f, const Vec3d& f_x_n, double slip) -> Share {
      if (first) return {f, slip, f_x_n, g.l_i};
      if (by_slot) return {-f, 0, g.l_j * f_x_n, 1};
      return {-f, 0, f_x_n, g.l_j};
    };
    share = on_i(action.f, action.f_x_n, action.slip);
    if constexpr (F.viscous && F.ledger) viscous = on_i(action.f_viscous, action.f_x_n_viscous, 0);
  }

  // One that is further off than the margin did not touch in the step before either.
  MORAINE_HD void add_walls(const Drive& drive, std::int64_t step, Index i, LoadRow& load, LoadRow& damping,
                            Reaction& reaction) const {
    if (!meets_walls(w.scene, w.role[i])) return;
    const GrainRow& g = w.grain[step & 1][i];
    const NowRow now = F.damped ? w.now[step & 1][i] : NowRow{};
    for (const WallName wall : {WallName::floor, WallName::top}) {
      const bool top = wall == WallName::top;
      if (top ? w.scene.top_wall.drive == TopWall::Drive::none : !w.scene.floor) continue;
      const double gap = (top ? drive.wall_z - g.x.z : g.x.z) - g.r;
      if (!(gap < w.margin)) continue;
      const WallAction a = wall_action<at_walls(F)>(w.scene.wall, w.scene.dt, drive, g, now, wall,
                                                    w.wall_spring[2 * i + static_cast<int>(wall)]);
      load.add(a.f, a.torque, a.slip);
      if constexpr (F.damped && F.ledger) damping.add(a.f_viscous, a.torque_viscous, 0);
      if (top) reaction.wall_force = -a.f.z, reaction.wall_damping = -a.f_viscous.z;
    }
  }

  MORAINE_HD LoadRow with_water(LoadRow load, Index i, std::int64_t step) const {
    if (w.water && exchanges(w.scene, step))
      load.f = axpy(static_cast<double>(w.scene.exchange_interval), w.water[i].f, load.f);
    return load;
  }

  // To step + 1; returns its speed as Note has it.
  MORAINE_HD float move_on(const Drive& drive, std::int64_t step, Index i, const LoadRow& load) const {
    GrainRow g = w.grain[step & 1][i];
    const bool layer = w.scene.shear.drive == Shear::Drive::stress && w.role[i] == Role::top;
    if (layer) g.v.x = drive.layer_u;
    const Triple dt(Vec3d{w.scene.dt, w.scene.dt, w.scene.dt});
    const Mobility m = mobility(w.scene, g);
    const Triple acceleration = m.acceleration(with_water(load, i, step).f),
                 spin_acceleration = m.spin_acceleration(load.torque);
    Kinematics<Triple> k{g.x, g.v, g.omega, g.rotation};
    leapfrog(k, acceleration, spin_acceleration, dt);
    g.x = k.x, g.v = k.v, g.omega = k.omega, g.rotation = k.rotation;
    const int next = (step + 1) & 1;
    w.grain[next][i] = g;
    if constexpr (F.damped) {
      NowRow now{axpy<double>(0.5 * w.scene.dt, acceleration, g.v), 0,
                 axpy<double>(0.5 * w.scene.dt, spin_acceleration, g.omega), 0};
      if (layer) now.v.x = drive.layer_u_ahead;
      w.now[next][i] = now;
    }
    return is_lost(w.scene, drive, g) ? std::numeric_limits<float>::infinity()
                                      : 1.000001f * static_cast<float>(dot(g.v, g.v));
  }
};

}  // namespace gather

}  // namespace moraine::dem
