// The GPU's engine: each grain walks its own contacts and adds up its own force, so no two threads write to
// one place. Each contact is computed twice, by either grain, from the same numbers in the same order; its
// spring is kept twice, too. Templated on Space: on the host it gives the same bits as PairEngine, which is
// how the tests prove this loop without a GPU.
//
// The host sends steps in batches and looks only now and then: once the neighbour lists are about to run out,
// a flag in Control turns all later steps of the batch into nothing, and the host builds new ones.
#pragma once
#include <algorithm>
#include <memory>

#include "dem/engine_parts.hpp"
#include "dem/features.hpp"
#include "dem/neighbours.hpp"

namespace moraine::dem {

struct Control {
  Drive drive;
  double moved = 0;  // m, bound on the approach of any two bodies since the last search
  bool stale = false, closed = true;
};

// Everything a step reads and writes, as plain pointers.
struct GatherView {
  Scene scene;
  Sides sides;
  Index n, chunk;
  double margin;
  GrainRow* grain;
  NowRow* now;
  LoadRow *load, *damping;           // damping: the viscous part, where the ledger asks for it
  double *wall_push, *wall_damping;  // N, each grain's force on the top wall; its viscous part
  const Role* role;
  const std::int64_t* row;
  const Index* neighbour;
  Spring<double>*spring, *wall_spring;
  Reaction* reaction;  // one for each chunk, as the next two
  double* slip;
  double* fastest2;  // by component, m2/s2
  Control* control;

  MORAINE_HD Index chunks() const { return (n + chunk - 1) / chunk; }
  MORAINE_HD Index chunk_end(Index c) const { return (c + 1) * chunk < n ? (c + 1) * chunk : n; }
};

namespace gather {

struct SumChunk {
  GatherView w;
  double dt;
  MORAINE_HD void operator()(std::int64_t c) const {
    if (w.control->stale) return;
    Reaction reaction;
    double slip = 0;
    Power power;
    for (Index i = static_cast<Index>(c) * w.chunk; i < w.chunk_end(static_cast<Index>(c)); ++i) {
      reaction.wall_force += w.wall_push[i];
      reaction.wall_damping += w.wall_damping[i];
      if (w.role[i] == Role::top) {
        reaction.shear_force += w.load[i].f.x;
        if (w.damping) reaction.layer_damping += w.damping[i].f.x;
      }
      slip += w.load[i].slip;
      if (w.damping) add_damping_power(power, w.scene, w.grain[i], w.load[i], w.damping[i], dt);
    }
    reaction.damping_power = power.total();
    w.reaction[c] = reaction, w.slip[c] = slip;
  }
};

struct AdvanceDrive {
  GatherView w;
  MORAINE_HD void operator()(std::int64_t) const {
    Control& c = *w.control;
    if (c.stale) return;
    if (!c.closed) close(c.drive);
    c.closed = false;
    c.drive.advance(w.scene);
  }
  MORAINE_HD void close(Drive& drive) const {
    drive.close(w.scene, sum_reactions());
    double slip = 0;
    for (Index k = 0; k < w.chunks(); ++k) slip += w.slip[k];
    drive.ledger.slip += slip;
  }
  MORAINE_HD Reaction sum_reactions() const {
    Reaction sum;
    for (Index k = 0; k < w.chunks(); ++k) sum.add(w.reaction[k]);
    return sum;
  }
};

template <Features F>
struct Integrate {
  GatherView w;
  MORAINE_HD void operator()(std::int64_t i) const {
    if (w.control->stale) return;
    GrainRow& g = w.grain[i];
    if (w.scene.shear.drive == Shear::Drive::stress && w.role[i] == Role::top)
      g.v.x = w.control->drive.layer_u;
    const Triple dt(Vec3d{w.scene.dt, w.scene.dt, w.scene.dt});
    const Mobility m = mobility(w.scene, g);
    const Triple acceleration = m.acceleration(w.load[i].f);
    const Triple spin_acceleration = m.spin_acceleration(w.load[i].torque);
    Kinematics<Triple> k{g.x, g.v, g.omega, g.rotation};
    leapfrog(k, acceleration, spin_acceleration, dt);
    g.x = k.x, g.v = k.v, g.omega = k.omega, g.rotation = k.rotation;
    if constexpr (F.damped) {
      w.now[i] = {axpy<double>(0.5 * w.scene.dt, acceleration, g.v), 0,
                  axpy<double>(0.5 * w.scene.dt, spin_acceleration, g.omega), 0};
      if (w.scene.shear.drive == Shear::Drive::stress && w.role[i] == Role::top)
        w.now[i].v.x = w.control->drive.layer_u_ahead;
    }
  }
};

struct FastestInChunk {
  GatherView w;
  MORAINE_HD void operator()(std::int64_t c) const {
    if (w.control->stale) return;
    Vec3d fastest2{0, 0, 0};
    for (Index i = static_cast<Index>(c) * w.chunk; i < w.chunk_end(static_cast<Index>(c)); ++i)
      for (int a = 0; a < 3; ++a) fastest2[a] = max(w.grain[i].v[a] * w.grain[i].v[a], fastest2[a]);
    for (int a = 0; a < 3; ++a) w.fastest2[3 * c + a] = fastest2[a];
  }
};

struct NoteMovement {
  GatherView w;
  MORAINE_HD void operator()(std::int64_t) const {
    Control& c = *w.control;
    if (c.stale) return;
    double v2[3] = {0, 0, 0};
    for (Index k = 0; k < w.chunks(); ++k)
      for (int a = 0; a < 3; ++a) v2[a] = max(w.fastest2[3 * k + a], v2[a]);
    const double speed = max(sqrt(v2[0] + v2[1] + v2[2]), ::fabs(c.drive.wall_v));
    c.moved += 2 * speed * w.scene.dt;
    c.stale = !(c.moved < w.margin);
  }
};

template <Features F>
struct Forces {
  GatherView w;
  double dt;

  MORAINE_HD void operator()(std::int64_t index) const {
    if (w.control->stale) return;
    const auto i = static_cast<Index>(index);
    LoadRow sum{}, damping{};
    for (std::int64_t k = w.row[i]; k < w.row[i + 1]; ++k) {
      const Index j = w.neighbour[k];
      const bool first = i < j;
      const GrainRow &a = w.grain[first ? i : j], &b = w.grain[first ? j : i];
      const Geometry<double> g = between_grains(nearest_image(w.sides, a.x - b.x), a.r + b.r, a.r - b.r);
      const Motion<double> before{a.v - b.v, a.omega, b.omega};
      Motion<double> at = before;
      if constexpr (F.viscous) {
        const NowRow &p = w.now[first ? i : j], &q = w.now[first ? j : i];
        at = {p.v - q.v, p.omega, q.omega};
      }
      const Action<double> action = contact_law<F>(w.scene.grain, dt, g, before, at, w.spring[k]);
      // A pair of an earlier chunk comes by way of a slot, where its torque has been rounded by itself.
      const bool by_slot = !first && i / w.chunk != j / w.chunk;
      const auto share = [&](const Vec3d& f, const Vec3d& f_x_n, double slip, LoadRow& to) {
        if (first)
          to.add(f, g.l_i, f_x_n, slip);
        else if (by_slot)
          to.add(-f, g.l_j * f_x_n, 0);
        else
          to.add(-f, g.l_j, f_x_n, 0);
      };
      share(action.f, action.f_x_n, action.slip, sum);
      if constexpr (F.viscous && F.ledger) share(action.f_viscous, action.f_x_n_viscous, 0, damping);
    }
    w.wall_push[i] = w.wall_damping[i] = 0;
    if (meets_walls(w.scene, w.role[i])) {
      if (w.scene.floor) add_wall(i, WallName::floor, sum, damping);
      if (w.scene.top_wall.drive != TopWall::Drive::none) add_wall(i, WallName::top, sum, damping);
    }
    w.load[i] = sum;
    if constexpr (F.damped && F.ledger) w.damping[i] = damping;
  }

  MORAINE_HD void add_wall(Index i, WallName wall, LoadRow& sum, LoadRow& damping) const {
    const NowRow now = F.damped ? w.now[i] : NowRow{};
    const WallAction a = wall_action<at_walls(F)>(w.scene.wall, dt, w.control->drive, w.grain[i], now, wall,
                                                  w.wall_spring[2 * i + static_cast<int>(wall)]);
    sum.add(a.f, a.torque, a.slip);
    if constexpr (F.damped && F.ledger) damping.add(a.f_viscous, a.torque_viscous, 0);
    if (wall == WallName::top) w.wall_push[i] = -a.f.z, w.wall_damping[i] = -a.f_viscous.z;
  }
};

// Springs from the old rows of neighbours into the new ones.
struct CarrySprings {
  const std::int64_t *old_row, *row;
  const Index *old_neighbour, *neighbour;
  const Spring<double>* old_spring;
  Spring<double>* spring;
  MORAINE_HD void operator()(std::int64_t i) const {
    for (std::int64_t k = row[i]; k < row[i + 1]; ++k) {
      spring[k] = {{0, 0, 0}, 0};
      for (std::int64_t q = old_row[i]; q < old_row[i + 1]; ++q)
        if (old_neighbour[q] == neighbour[k]) spring[k] = old_spring[q];
    }
  }
};

struct FindLost {
  GatherView w;
  Index* lost;
  MORAINE_HD void operator()(std::int64_t c) const {
    lost[c] = -1;
    for (Index i = static_cast<Index>(c) * w.chunk; i < w.chunk_end(static_cast<Index>(c)) && lost[c] < 0;
         ++i)
      if (is_lost(w.scene, w.control->drive, w.grain[i])) lost[c] = i;
  }
};

}  // namespace gather

template <class Space>
class GatherEngine final : public Engine {
 public:
  GatherEngine(Space space, std::string name) : space_(std::move(space)), name_(std::move(name)) {}

  void load(const Scene& scene, const State& s) override {
    check_scene(scene, s);
    n_ = s.size();
    id_ = s.id, x_start_ = s.x_start, role_host_ = s.role;
    r_max_ = *std::max_element(s.r.begin(), s.r.end());
    features_ = features_of(scene);
    view_ = {};
    view_.scene = scene, view_.sides = Sides::of(scene);
    view_.n = n_, view_.chunk = chunk_size(n_), view_.margin = neighbour_margin(scene, s);
    rebuilds_ = 0;

    grain_.set(grain_rows(scene, s));
    role_.set(s.role);
    std::vector<LoadRow> loads(n_);
    for (Index i = 0; i < n_; ++i) loads[i] = {s.force[i], 0, s.torque[i], 0};
    load_.set(loads);
    now_.resize(features_.damped ? n_ : 0), wall_push_.set(std::vector<double>(n_, 0));
    wall_damping_.set(std::vector<double>(n_, 0));
    damping_.set(std::vector<LoadRow>(features_.damped && features_.ledger ? n_ : 0));
    std::vector<Spring<double>> wall_springs(2 * static_cast<std::size_t>(n_), {{0, 0, 0}, 0});
    for (const WallContact& w : s.wall_contacts)
      wall_springs[2 * static_cast<std::size_t>(w.i) + static_cast<int>(w.wall)] = {w.delta_t, w.slipping};
    wall_spring_.set(wall_springs);
    reaction_.resize(view_.chunks()), slip_.resize(view_.chunks()), fastest2_.resize(3 * view_.chunks());
    lost_.resize(view_.chunks());
    Control control;
    control.drive = drive_of(scene, s);
    control_.set({control});

    search();
    place_springs(s.contacts);
    refresh_view();
    if (s.staggered) return;

    if (features_.damped) {
      std::vector<NowRow> now(n_);
      const std::vector<GrainRow> grains = grain_.get();
      for (Index i = 0; i < n_; ++i) now[i] = {grains[i].v, 0, grains[i].omega, 0};
      now_.set(now);
    }
    forces(0);
    start_half_a_step_back();
  }

  void advance(std::int64_t steps) override {
    Control control = space_.read(control_.data());
    const std::int64_t target = control.drive.step + steps;
    while (control.drive.step < target) {
      const std::int64_t batch = std::min<std::int64_t>(target - control.drive.step, 256);
      for (std::int64_t k = 0; k < batch; ++k) one_step();
      control = space_.read(control_.data());
      check_lost(control);
      if (control.stale) {
        search_again();
        control.stale = false, control.moved = 0;
        space_.write(control_.data(), control);
        forces(view_.scene.dt);
      }
    }
  }

  State state() const override {
    State s;
    s.id = id_, s.x_start = x_start_;
    Control control = space_.read(control_.data());
    const std::vector<GrainRow> grains = grain_.get();
    const std::vector<LoadRow> loads = load_.get();
    if (!control.closed) {
      space_.for_each(view_.chunks(), gather::SumChunk{view_, view_.scene.dt});
      std::vector<Reaction> reactions = reaction_.get();
      std::vector<double> slips = slip_.get();
      on_host(reactions, slips).close(control.drive);
    }
    for (Index i = 0; i < n_; ++i) append_grain(s, grains[i], loads[i], role_host_[i]);

    const std::vector<std::int64_t> row = lists_.row.get();
    const std::vector<Index> neighbour = lists_.neighbour.get();
    const std::vector<Spring<double>> spring = spring_.get(), wall_spring = wall_spring_.get();
    for (Index i = 0; i < n_; ++i) {
      for (std::int64_t k = row[i]; k < row[i + 1]; ++k)
        if (const Index j = neighbour[k]; j > i)
          append_contact(s, view_.scene, view_.sides, grains[i], grains[j], i, j, spring[k]);
      for (const WallName wall : {WallName::floor, WallName::top})
        if (!meets_walls(view_.scene, role_host_[i]))
          continue;
        else if (wall == WallName::floor ? view_.scene.floor
                                         : view_.scene.top_wall.drive != TopWall::Drive::none)
          append_wall_contact(s, view_.scene, control.drive, grains[i], i, wall,
                              wall_spring[2 * static_cast<std::size_t>(i) + static_cast<int>(wall)]);
    }
    finish_state(s, control.drive);
    return s;
  }

  Counts counts() const override { return {lists_.total / 2, lists_.total / 2, rebuilds_}; }
  std::string describe() const override { return name_; }
  int threads() const override { return 1; }

 private:
  void refresh_view() {
    view_.grain = grain_.data(), view_.now = now_.data(), view_.load = load_.data();
    view_.damping = damping_.size() > 0 ? damping_.data() : nullptr;
    view_.wall_push = wall_push_.data(), view_.wall_damping = wall_damping_.data();
    view_.role = role_.data(), view_.row = lists_.row.data(), view_.neighbour = lists_.neighbour.data();
    view_.spring = spring_.data(), view_.wall_spring = wall_spring_.data(), view_.reaction = reaction_.data();
    view_.slip = slip_.data(), view_.fastest2 = fastest2_.data(), view_.control = control_.data();
  }

  void search() {
    lists_.build(space_, view_.scene, grain_.data(), role_.data(), n_, r_max_, view_.margin, /*half=*/false);
    ++rebuilds_;
  }

  void search_again() {
    std::swap(lists_, old_lists_);
    std::swap(spring_, old_spring_);
    search();
    spring_.resize(std::max<std::int64_t>(lists_.total, 1));
    space_.for_each(
        n_, gather::CarrySprings{old_lists_.row.data(), lists_.row.data(), old_lists_.neighbour.data(),
                                 lists_.neighbour.data(), old_spring_.data(), spring_.data()});
    refresh_view();
  }

  void place_springs(const std::vector<Contact>& contacts) {
    const std::vector<std::int64_t> row = lists_.row.get();
    const std::vector<Index> neighbour = lists_.neighbour.get();
    std::vector<Spring<double>> springs(std::max<std::int64_t>(lists_.total, 1), {{0, 0, 0}, 0});
    for (const Contact& c : contacts)
      for (const auto& [i, j] : {std::pair{c.i, c.j}, std::pair{c.j, c.i}})
        for (std::int64_t k = row[i]; k < row[i + 1]; ++k)
          if (neighbour[k] == j) springs[k] = {c.delta_t, c.slipping};
    spring_.set(springs);
  }

  void start_half_a_step_back() {
    space_.for_each(view_.chunks(), gather::SumChunk{view_, 0});
    Control control = space_.read(control_.data());
    std::vector<Reaction> reactions = reaction_.get();
    std::vector<double> slips = slip_.get();
    const Reaction reaction = on_host(reactions, slips).sum_reactions();
    Drive& drive = control.drive;
    drive.take(view_.scene, reaction);
    drive.half_step(view_.scene, -1);
    drive.take(view_.scene, reaction);  // now that the wall's velocity is that of n - 1/2
    drive.ledger = {};
    drive.ledger.viscous_power = drive.viscous_power();
    std::vector<GrainRow> grains = grain_.get();
    std::vector<LoadRow> loads = load_.get();
    for (Index i = 0; i < n_; ++i) {
      half_step_back(view_.scene, grains[i], loads[i]);
      loads[i].slip = 0;
    }
    grain_.set(grains), load_.set(loads), control_.set({control});
  }

  gather::AdvanceDrive on_host(std::vector<Reaction>& reactions, std::vector<double>& slips) const {
    GatherView host = view_;
    host.reaction = reactions.data(), host.slip = slips.data();
    return {host};
  }

  void one_step() {
    with_features(features_, [&]<Features F>() {
      space_.for_each(view_.chunks(), gather::SumChunk{view_, view_.scene.dt});
      space_.for_each(1, gather::AdvanceDrive{view_});
      space_.for_each(n_, gather::Integrate<F>{view_});
      space_.for_each(view_.chunks(), gather::FastestInChunk{view_});
      space_.for_each(1, gather::NoteMovement{view_});
      space_.for_each(n_, gather::Forces<F>{view_, view_.scene.dt});
    });
  }

  void forces(double dt) {
    with_features(features_, [&]<Features F>() { space_.for_each(n_, gather::Forces<F>{view_, dt}); });
  }

  void check_lost(const Control& control) {
    space_.for_each(view_.chunks(), gather::FindLost{view_, lost_.data()});
    for (const Index i : lost_.get())
      if (i >= 0) throw lost_grain(view_.scene, control.drive, space_.read(grain_.data() + i), id_[i]);
  }

  template <class T>
  using Array = typename Space::template Array<T>;

  Space space_;
  std::string name_;
  Index n_ = 0;
  double r_max_ = 0;
  Features features_;
  GatherView view_;
  Neighbours<Space> lists_, old_lists_;
  Array<GrainRow> grain_;
  Array<NowRow> now_;
  Array<LoadRow> load_, damping_;
  Array<double> wall_push_, wall_damping_, fastest2_;
  Array<Role> role_;
  Array<Spring<double>> spring_, old_spring_, wall_spring_;
  Array<Reaction> reaction_;
  Array<double> slip_;  // J, dissipated in the step, one for each chunk
  Array<Control> control_;
  Array<Index> lost_;
  std::int64_t rebuilds_ = 0;
  std::vector<Index> id_;
  std::vector<Vec3d> x_start_;
  std::vector<Role> role_host_;
};

}  // namespace moraine::dem
