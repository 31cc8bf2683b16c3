// The GPU's engine: each grain walks its own contacts and adds up its own force, so no two threads write to
// one place. Each contact is computed twice, by either grain, from the same numbers in the same order; its
// spring is kept twice, too. Templated on Space: on the host it gives the same bits as PairEngine, which is
// how the tests prove this loop without a GPU.
//
// One launch takes all steps (march.hpp) until the neighbour lists are about to run out; then the host builds
// new ones and launches again.
#pragma once
#include <algorithm>
#include <memory>

#include "dem/features.hpp"
#include "dem/march.hpp"
#include "dem/neighbours.hpp"

namespace moraine::dem {

namespace gather {

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
    const Drive& drive = w.control->drive;
    const GrainRow* const grain = w.grain[drive.step & 1];
    lost[c] = -1;
    for (Index i = static_cast<Index>(c) * w.chunk; i < w.n && i < (c + 1) * w.chunk && lost[c] < 0; ++i)
      if (is_lost(w.scene, drive, grain[i])) lost[c] = i;
  }
};

}  // namespace gather

template <class Space>
class GatherEngine final : public Engine {
 public:
  GatherEngine(Space space, std::string name) : space_(std::move(space)), name_(std::move(name)) {}

  void load(const Scene& scene, const State& s, Surroundings* surroundings) override {
    check_scene(scene, s);
    n_ = s.size();
    id_ = s.id, x_start_ = s.x_start, role_host_ = s.role;
    r_max_ = *std::max_element(s.r.begin(), s.r.end());
    features_ = features_of(scene);
    surroundings_ = features_.water ? surroundings : nullptr;
    features_.water = false;  // a pointer tells (GatherView::water)
    water_.set(std::vector<WaterRow>(surroundings_ ? n_ : 0));
    view_ = {};
    view_.scene = scene, view_.sides = Sides::of(scene);
    view_.n = n_, view_.chunk = chunk_size(n_), view_.margin = neighbour_margin(scene, s);
    rebuilds_ = 0;

    role_.set(s.role);
    std::vector<LoadRow> loads(n_);
    for (Index i = 0; i < n_; ++i) loads[i] = {s.force[i], 0, s.torque[i], 0};
    load_.set(loads);
    for (int parity : {0, 1}) {
      grain_[parity].resize(n_), now_[parity].resize(features_.damped ? n_ : 0);
      tally_[parity].set(std::vector<Note>(view_.groups())), chunk_tally_[parity].resize(view_.chunks());
    }
    grain_[s.step & 1].set(grain_rows(scene, s));
    std::vector<Spring<double>> wall_springs(2 * static_cast<std::size_t>(n_), {{0, 0, 0}, 0});
    for (const WallContact& w : s.wall_contacts)
      wall_springs[2 * static_cast<std::size_t>(w.i) + static_cast<int>(w.wall)] = {w.delta_t, w.slipping};
    wall_spring_.set(wall_springs);
    lost_.resize(view_.chunks());
    Control control;
    control.drive = drive_of(scene, s);
    control.water = s.water;
    control_.set({control});
    if (surroundings_ && s.staggered) {
      std::vector<WaterRow> rows(n_);
      for (Index i = 0; i < n_; ++i) rows[i] = {s.water_force[i], 0};
      water_.set(rows);
    }

    search(s.step);
    place_springs(s.contacts);
    refresh_view();
    if (s.staggered) return;

    if (features_.damped) {
      std::vector<NowRow> now(n_);
      const std::vector<GrainRow> grains = grain_[s.step & 1].get();
      for (Index i = 0; i < n_; ++i) now[i] = {grains[i].v, 0, grains[i].omega, 0};
      now_[s.step & 1].set(now);
    }
    evaluate(control);
    if (surroundings_) exchange();
    start_half_a_step_back();
  }

  void advance(std::int64_t steps) override {
    Control control = space_.read(control_.data());
    const std::int64_t end = control.drive.step + steps;
    while (control.drive.step < end || control.stale) {
      // Not all at once, for engines that share a card and do not fit side by side.
      std::int64_t target = std::min(end, control.drive.step + 4096);
      const std::int64_t m = view_.scene.exchange_interval;
      if (surroundings_) target = std::min(target, (control.drive.step / m + (control.stale ? 0 : 1)) * m);
      march(view_, std::max(target, control.drive.step));
      control = space_.read(control_.data());
      if (!control.stale) {
        if (surroundings_ && exchanges(view_.scene, control.drive.step)) exchange();
        continue;
      }
      check_lost(control);
      search_again(control.drive.step);
      control.moved = 0;
      space_.write(control_.data(), control);
    }
  }

  State state() const override {
    State s;
    s.id = id_, s.x_start = x_start_;
    Control control = space_.read(control_.data());
    const std::vector<GrainRow> grains = grain_[control.drive.step & 1].get();
    const std::vector<LoadRow> loads = load_.get();
    if (surroundings_)
      for (const WaterRow& w : water_.get()) s.water_force.push_back(w.f);
    if (!control.closed) {
      const Note total = sums(control.drive.step);
      control.drive.close(view_.scene, total.reaction, control.water_at(view_.scene));
      control.drive.ledger.slip += total.slip;
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
    for (int parity : {0, 1}) {
      view_.grain[parity] = grain_[parity].data(), view_.now[parity] = now_[parity].data();
      view_.tally[parity] = tally_[parity].data(), view_.chunk_tally[parity] = chunk_tally_[parity].data();
    }
    view_.water = surroundings_ ? water_.data() : nullptr;
    view_.load = load_.data(), view_.role = role_.data(), view_.control = control_.data();
    view_.row = lists_.row.data(), view_.neighbour = lists_.neighbour.data();
    view_.spring = spring_.data(), view_.wall_spring = wall_spring_.data();
  }

  void search(std::int64_t step) {
    lists_.build(space_, view_.scene, grain_[step & 1].data(), role_.data(), n_, r_max_, view_.margin,
                 /*half=*/false);
    ++rebuilds_;
  }

  void search_again(std::int64_t step) {
    std::swap(lists_, old_lists_);
    std::swap(spring_, old_spring_);
    search(step);
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

  void march(const GatherView& view, std::int64_t target) {
    with_features(features_, [&]<Features F>() {
      space_.cooperate(view.groups(), group_size, gather::March<F>{view, target});
    });
  }

  // Forces and sums where the grains are, springs as they are.
  void evaluate(Control control) {
    control.stale = true;
    space_.write(control_.data(), control);
    GatherView still = view_;
    still.scene.dt = 0;
    march(still, control.drive.step);
  }

  // Grains and water meet on the host, where the grid is solved for.
  void exchange() {
    Control control = space_.read(control_.data());
    const std::vector<GrainRow> grains = grain_[control.drive.step & 1].get();
    if (surroundings_->stale()) surroundings_->remap(grains.data(), control.drive);
    for (Index c = 0; c < view_.chunks(); ++c) surroundings_->displace(c, grains.data());
    control.water = surroundings_->solve(control.drive, view_.scene.time(control.drive.step));
    std::vector<WaterRow> water(n_);
    for (Index c = 0; c < view_.chunks(); ++c) surroundings_->push(c, grains.data(), water.data());
    water_.set(water), control_.set({control});
    refresh_view();
  }

  Note sums(std::int64_t step) const {
    const std::vector<Note> tally = tally_[step & 1].get();
    Note total;
    for (int what = Note::first_sum; what < Note::first_sum + Note::sums(features_); ++what)
      for (Index c = 0; c < view_.chunks(); ++c) {
        Note chunk;
        gather_up(chunk, what, tally.data() + c * view_.chunk_groups(), view_.groups_of(c));
        gather_up(total, what, &chunk, 1, /*on_top=*/true);
      }
    return total;
  }

  void start_half_a_step_back() {
    Control control = space_.read(control_.data());
    const Reaction reaction = sums(control.drive.step).reaction;
    Drive& drive = control.drive;
    drive.take(view_.scene, reaction, control.water);
    drive.half_step(view_.scene, -1);
    drive.take(view_.scene, reaction, control.water);  // now that the wall's velocity is that of n - 1/2
    drive.ledger = {};
    drive.ledger.viscous_power = drive.viscous_power();
    Array<GrainRow>& rows = grain_[drive.step & 1];
    std::vector<GrainRow> grains = rows.get();
    std::vector<LoadRow> loads = load_.get();
    const std::vector<WaterRow> water = water_.get();
    for (Index i = 0; i < n_; ++i) {
      LoadRow whole = loads[i];
      if (surroundings_)
        whole.f = axpy(static_cast<double>(view_.scene.exchange_interval), water[i].f, whole.f);
      half_step_back(view_.scene, grains[i], whole);
      loads[i].slip = 0;
    }
    rows.set(grains), load_.set(loads), control_.set({control});
  }

  void check_lost(const Control& control) {
    space_.for_each(view_.chunks(), gather::FindLost{view_, lost_.data()});
    for (const Index i : lost_.get())
      if (i >= 0)
        throw lost_grain(view_.scene, control.drive, space_.read(grain_[control.drive.step & 1].data() + i),
                         id_[i]);
  }

  template <class T>
  using Array = typename Space::template Array<T>;

  Space space_;
  std::string name_;
  Index n_ = 0;
  double r_max_ = 0;
  Features features_;
  Surroundings* surroundings_ = nullptr;
  GatherView view_;
  Neighbours<Space> lists_, old_lists_;
  Array<GrainRow> grain_[2];
  Array<NowRow> now_[2];
  Array<LoadRow> load_;
  Array<WaterRow> water_;
  Array<Role> role_;
  Array<Spring<double>> spring_, old_spring_, wall_spring_;
  Array<Note> tally_[2], chunk_tally_[2];
  Array<Control> control_;
  Array<Index> lost_;
  std::int64_t rebuilds_ = 0;
  std::vector<Index> id_;
  std::vector<Vec3d> x_start_;
  std::vector<Role> role_host_;
};

}  // namespace moraine::dem
