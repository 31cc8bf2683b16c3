// The GPU's engine: each grain walks its own contacts and adds up its own force, so no two threads write to
// one place. Each contact is computed twice, by either grain, from the same numbers in the same order; its
// spring is kept twice, too. Templated on Space: on the host it gives the same bits as PairEngine, which is
// how the tests prove this loop without a GPU.
//
// One launch takes all steps (step_kernel.hpp) until the neighbour lists are about to run out; then the host
// builds new ones and launches again.
#pragma once
#include <algorithm>
#include <memory>

#include "dem/gpu/step_kernel.hpp"
#include "dem/neighbours.hpp"
#include "dem/scene_check.hpp"
#include "dem/state_rows.hpp"
#include "dem/uses.hpp"

namespace moraine::dem::gpu {

// Springs from the old rows of neighbours into the new ones.
struct CarrySprings {
  const std::int64_t *old_row, *row;
  const Index *old_neighbour, *neighbour;
  const SpringRow* old_spring;
  SpringRow* spring;
  MORAINE_HD void operator()(std::int64_t i) const {
    for (std::int64_t k = row[i]; k < row[i + 1]; ++k) {
      spring[k] = {};
      for (std::int64_t q = old_row[i]; q < old_row[i + 1]; ++q)
        if (old_neighbour[q] == neighbour[k]) spring[k] = old_spring[q];
    }
  }
};

struct FindLost {
  GatherView w;
  Index* lost;
  MORAINE_HD void operator()(std::int64_t c) const {
    const BodyMotion& bodies = w.control->bodies;
    const GrainRow* const grain = w.grain[bodies.step & 1];
    const Index chunk = w.order.chunk;
    lost[c] = -1;
    for (Index i = static_cast<Index>(c) * chunk; i < w.n && i < (c + 1) * chunk && lost[c] < 0; ++i)
      if (is_lost(bodies, grain[i])) lost[c] = i;
  }
};

template <class Space>
class GatherEngine final : public Engine {
 public:
  GatherEngine(Space space, std::string name) : space_(std::move(space)), name_(std::move(name)) {}

  void load(const Scene& scene, const State& s, FluidCoupling* fluid) override {
    check_scene(scene, s);
    kept_ = {};
    kept_.id = s.id, kept_.x_start = s.x_start, kept_.part_of = s.part_of, kept_.bodies = s.bodies;
    kept_.material = s.material;
    n_ = s.size();
    r_max_ = *std::max_element(s.r.begin(), s.r.end());
    uses_ = uses_of(scene);
    fluid_ = uses_.water ? fluid : nullptr;
    Control control;
    control.bodies = motion_of(scene, s);
    control.water = s.water;
    control_.set({control});
    view_ = {};
    view_.scene = scene, view_.sides = Sides::of(scene);
    material_.set(s.material);
    view_.n = n_, view_.order = {chunk_size(n_), s.material.empty() ? nullptr : material_.data()};
    view_.margin = neighbour_margin(scene, s);
    view_.tallies = {control.bodies.servos};
    searches_ = 0;
    load_rows(s, control.bodies);

    search(s.step);
    place_springs(s);
    refresh_view();
    if (s.staggered) return;
    start(control);
    if (!uses_.damping()) return;
    State begun = state();
    remember_velocities(scene, begun);
    load(scene, begun, fluid);
  }

  void redrive(const Scene& scene) override {
    view_.scene.bodies = scene.bodies;
    Control control = space_.read(control_.data());
    control.bodies.redrive(view_.scene);
    space_.write(control_.data(), control);
  }

  void advance(std::int64_t steps) override {
    Control control = space_.read(control_.data());
    const std::int64_t end = control.bodies.step + steps;
    while (control.bodies.step < end || control.stale) {
      // Not all at once, for engines that share a card and do not fit side by side.
      std::int64_t target = std::min(end, control.bodies.step + 4096);
      const std::int64_t m = view_.scene.exchange_interval;
      if (fluid_) target = std::min(target, (control.bodies.step / m + (control.stale ? 0 : 1)) * m);
      launch(view_, std::max(target, control.bodies.step));
      control = space_.read(control_.data());
      if (!control.stale) {
        if (fluid_ && exchanges(view_.scene, control.bodies.step)) exchange();
        continue;
      }
      check_lost(control);
      search_again(control.bodies.step);
      control.moved = 0;
      space_.write(control_.data(), control);
    }
  }

  Counts counts() const override { return {lists_.total / 2, lists_.total / 2, searches_}; }
  std::string describe() const override { return name_; }
  int threads() const override { return 1; }

 private:
  State read(bool contacts) const override {
    State s = kept_;
    s.part_of.clear();
    const Control control = space_.read(control_.data());
    BodyMotion bodies = control.bodies;
    const std::vector<GrainRow> grains = grain_[bodies.step & 1].get();
    const std::vector<LoadRow> loads = load_.get();
    if (fluid_)
      for (const WaterRow& w : water_.get()) s.water_force.push_back(w.f);
    if (!control.closed) {
      const Tally total = sums(bodies.step);
      bodies.close(view_.scene, view_.tallies.reaction(total),
                   reaction_at(view_.scene, control.water, bodies.step));
      bodies.ledger.add(TallyLayout::dissipation(total));
    }
    for (Index i = 0; i < n_; ++i) append_grain(s, grains[i], loads[i], kept_.part_of[i]);
    if (contacts) append_contacts(s, grains, bodies);
    finish_state(s, bodies);
    return s;
  }

  void append_contacts(State& s, const std::vector<GrainRow>& grains, const BodyMotion& bodies) const {
    const std::vector<std::int64_t> row = lists_.row.get();
    const std::vector<Index> neighbour = lists_.neighbour.get();
    const std::vector<SpringRow> spring = spring_.get(), plane_spring = plane_spring_.get();
    for (Index i = 0; i < n_; ++i) {
      for (std::int64_t k = row[i]; k < row[i + 1]; ++k)
        if (const Index j = neighbour[k]; j > i)
          append_contact(s, view_.scene, view_.scene.between(s.material_of(i), s.material_of(j)), view_.sides,
                         grains[i], grains[j], i, j, spring[k]);
      if (!meets_planes(view_.scene, kept_.part_of[i])) continue;
      for (int p = 0; p < bodies.planes; ++p)
        append_wall_contact(s, view_.scene, bodies.plane[p], grains[i], i,
                            plane_spring[static_cast<std::size_t>(bodies.planes) * i + p]);
    }
  }

  void load_rows(const State& s, const BodyMotion& bodies) {
    part_of_.set(s.part_of);
    std::vector<LoadRow> loads(n_);
    for (Index i = 0; i < n_; ++i) loads[i] = {s.force[i], 0, s.torque[i], 0};
    load_.set(loads);
    for (int parity : {0, 1}) {
      grain_[parity].resize(n_);
      tally_[parity].set(std::vector<Tally>(view_.groups())), chunk_tally_[parity].resize(view_.chunks());
    }
    grain_[s.step & 1].set(grain_rows(view_.scene, s));
    std::vector<WaterRow> water(fluid_ ? n_ : 0);
    if (s.staggered)
      for (std::size_t i = 0; i < water.size(); ++i) water[i] = {s.water_force[i], 0};
    water_.set(water);
    const auto planes = static_cast<std::size_t>(bodies.planes);
    std::vector<SpringRow> springs(std::max<std::size_t>(planes * n_, 1));
    for (const WallContact& w : s.wall_contacts)
      if (const Plane* plane = bodies.find(w.wall))
        springs[planes * w.i + (plane - bodies.plane)] = {
            remembered(view_.scene, view_.scene.between(s.material_of(w.i), plane->material), w.spring)};
    plane_spring_.set(springs);
    lost_.resize(view_.chunks());
  }

  void refresh_view() {
    for (int parity : {0, 1}) {
      view_.grain[parity] = grain_[parity].data();
      view_.tally[parity] = tally_[parity].data(), view_.chunk_tally[parity] = chunk_tally_[parity].data();
    }
    view_.water = fluid_ ? water_.data() : nullptr;
    view_.load = load_.data(), view_.part_of = part_of_.data(), view_.control = control_.data();
    view_.row = lists_.row.data(), view_.neighbour = lists_.neighbour.data();
    view_.spring = spring_.data(), view_.plane_spring = plane_spring_.data();
  }

  void search(std::int64_t step) {
    lists_.build(space_, view_.scene, grain_[step & 1].data(), part_of_.data(), n_, view_.margin,
                 view_.order.material);
    ++searches_;
  }

  void search_again(std::int64_t step) {
    std::swap(lists_, old_lists_);
    std::swap(spring_, old_spring_);
    search(step);
    spring_.resize(lists_.total);
    if (lists_.total == 0) spring_.set(std::vector<SpringRow>(1));  // never read, but copied
    space_.for_each(n_, CarrySprings{old_lists_.row.data(), lists_.row.data(), old_lists_.neighbour.data(),
                                     lists_.neighbour.data(), old_spring_.data(), spring_.data()});
    refresh_view();
  }

  void place_springs(const State& s) {
    const std::vector<std::int64_t> row = lists_.row.get();
    const std::vector<Index> neighbour = lists_.neighbour.get();
    std::vector<SpringRow> springs(std::max<std::int64_t>(lists_.total, 1));
    for (const Contact& c : s.contacts)
      for (const auto& [i, j] : {std::pair{c.i, c.j}, std::pair{c.j, c.i}})
        for (std::int64_t k = row[i]; k < row[i + 1]; ++k)
          if (neighbour[k] == j) springs[k] = {remembered(view_.scene, between(s, c), c.spring)};
    spring_.set(springs);
  }

  const ContactParameters& between(const State& s, const Contact& c) const {
    return view_.scene.between(s.material_of(c.i), s.material_of(c.j));
  }

  void launch(const GatherView& view, std::int64_t target) {
    with_laws(view.scene, [&]<class Row, Account account>() {
      space_.cooperate(view.groups(), group_size, StepKernel<Row, account>{view, target});
    });
  }

  // First forces, and velocities half a step back.
  void start(Control control) {
    Array<GrainRow>& rows = grain_[control.bodies.step & 1];
    std::vector<GrainRow> grains = rows.get();
    evaluate(control);
    if (fluid_) exchange();
    control = space_.read(control_.data());
    BodyMotion& bodies = control.bodies;
    const Reaction reaction = view_.tallies.reaction(sums(bodies.step));
    start_half_a_step_back(view_.scene, reaction, control.water, bodies);
    std::vector<LoadRow> loads = load_.get();
    const std::vector<WaterRow> water = water_.get();
    for (Index i = 0; i < n_; ++i) {
      const LoadRow whole = fluid_ ? with_water(view_.scene, bodies.step, loads[i], water[i].f) : loads[i];
      half_step_back(view_.scene, grains[i], kept_.material_of(i), whole);
      loads[i].slip = loads[i].viscous = 0;
    }
    rows.set(grains), load_.set(loads), control_.set({control});
  }

  // Forces and sums where the grains are, springs as they are.
  void evaluate(Control control) {
    control.stale = true;
    space_.write(control_.data(), control);
    GatherView still = view_;
    still.scene.dt = 0;
    launch(still, control.bodies.step);
  }

  // Grains and water meet on the host, where the grid is solved for.
  void exchange() {
    Control control = space_.read(control_.data());
    const std::vector<GrainRow> grains = grain_[control.bodies.step & 1].get();
    if (fluid_->stale()) fluid_->remap(grains.data(), control.bodies);
    for (Index c = 0; c < view_.chunks(); ++c) fluid_->displace(c, grains.data());
    control.water = fluid_->solve(control.bodies, view_.scene.time(control.bodies.step));
    std::vector<WaterRow> water(n_);
    for (Index c = 0; c < view_.chunks(); ++c) fluid_->push(c, grains.data(), water.data());
    water_.set(water), control_.set({control});
    refresh_view();
  }

  Tally sums(std::int64_t step) const {
    const std::vector<Tally> tally = tally_[step & 1].get();
    Tally total;
    for (int what = TallyLayout::first_sum; what < view_.tallies.end(); ++what)
      for (Index c = 0; c < view_.chunks(); ++c) {
        Tally chunk;
        reduce(chunk, what, tally.data() + c * view_.chunk_groups(), view_.groups_of(c));
        reduce(total, what, &chunk, 1, /*on_top=*/true);
      }
    return total;
  }

  void check_lost(const Control& control) {
    space_.for_each(view_.chunks(), FindLost{view_, lost_.data()});
    for (const Index i : lost_.get())
      if (i >= 0)
        throw lost_grain(view_.scene, control.bodies, space_.read(grain_[control.bodies.step & 1].data() + i),
                         kept_.id[i]);
  }

  template <class T>
  using Array = typename Space::template Array<T>;

  Space space_;
  std::string name_;
  Index n_ = 0;
  double r_max_ = 0;
  Uses uses_;
  FluidCoupling* fluid_ = nullptr;
  GatherView view_;
  Neighbours<Space> lists_, old_lists_;
  Array<GrainRow> grain_[2];
  Array<LoadRow> load_;
  Array<WaterRow> water_;
  Array<BodyId> part_of_;
  Array<Material> material_;
  Array<SpringRow> spring_, old_spring_, plane_spring_;
  Array<Tally> tally_[2], chunk_tally_[2];
  Array<Control> control_;
  Array<Index> lost_;
  std::int64_t searches_ = 0;
  State kept_;  // what no step changes: ids, x_start, layers, materials, bodies that do not move
};

}  // namespace moraine::dem::gpu
