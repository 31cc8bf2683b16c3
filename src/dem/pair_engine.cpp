#include "dem/pair_engine.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <tuple>

#include "dem/engine_parts.hpp"
#include "dem/features.hpp"

namespace moraine::dem {

namespace {

constexpr Index no_link = -1;
constexpr int group_block = 16;  // groups of four that go through the three phases together
constexpr int steps_between_checks = 256;
constexpr int steps_near_list_should_last = 80;

template <class Row>
Pack row(const Row& v) {
  return Pack::load(reinterpret_cast<const double*>(&v));
}
template <class Row>
void set_row(Row& v, Pack p) {
  p.store(reinterpret_cast<double*>(&v));
}

}  // namespace

void PairEngine::PairList::add(Index i, Index j, Index target, const Spring<double>& s) {
  const auto lane = static_cast<int>(count % 4);
  if (lane == 0) {
    pairs.emplace_back();
    springs.push_back({0.0, 0.0, 0.0});
    slipping.push_back(0.0);
  }
  PairGroup& p = pairs.back();
  p.i[lane] = row_bytes * i, p.j[lane] = row_bytes * j, p.target[lane] = row_bytes * target;
  for (int a = 0; a < 3; ++a) springs.back()[a].v[lane] = s.delta_t[a];
  slipping.back().v[lane] = s.slipping;
  ++count;
}

void PairEngine::PairList::pad(Index first_dummy) {
  if (count % 4 == 0) return;
  for (auto lane = static_cast<int>(count % 4); lane < 4; ++lane) {
    pairs.back().i[lane] = row_bytes * first_dummy;
    pairs.back().j[lane] = pairs.back().target[lane] = row_bytes * (first_dummy + 1);
  }
}

Spring<double> PairEngine::PairList::spring(std::int64_t k) const {
  const Vec3<Pack>& s = springs[k / 4];
  const int lane = static_cast<int>(k % 4);
  return {{s.x[lane], s.y[lane], s.z[lane]}, slipping[k / 4][lane]};
}

PairEngine::PairEngine(int threads) : threads_wanted_(threads) { space_.threads = std::max(1, threads); }

std::string PairEngine::describe() const {
#if defined(__AVX2__)
  const char* lanes = "AVX2";
#elif defined(__x86_64__)
  const char* lanes = "SSE2";
#else
  const char* lanes = "portable SIMD";
#endif
  return "cpu, " + std::to_string(space_.threads) + (space_.threads == 1 ? " thread, " : " threads, ") +
         lanes;
}

Engine::Counts PairEngine::counts() const {
  Counts c = counts_;
  c.candidates = neighbours_.total;
  c.near = 0;
  for (const Chunk& chunk : chunks_) c.near += chunk.near[0].count + chunk.near[1].count;
  return c;
}

void PairEngine::load(const Scene& scene, const State& s) {
  check_scene(scene, s);
  scene_ = scene;
  sides_ = Sides::of(scene);
  n_ = s.size();
  id_ = s.id;
  x_start_ = s.x_start;
  r_max_ = *std::max_element(s.r.begin(), s.r.end());
  margin_ = neighbour_margin(scene, s);

  // Below some 1,500 grains a thread waits longer at barriers than it works.
  space_.threads = threads_wanted_ > 0 ? threads_wanted_ : std::clamp(n_ / 1500, 1, available_cores());

  chunk_size_ = chunk_size(n_);
  const Index chunks = chunk_count(n_);
  chunks_.clear();
  chunks_.resize(chunks);
  progress_ = std::make_unique<Progress[]>(chunks);
  const std::int64_t rows = n_ + 2 * chunks;
  grain_.resize(rows), load_.resize(rows), mobility_.resize(n_), role_.resize(n_);
  const Features features = features_of(scene);
  now_.resize(features.damped ? rows : 0);
  damping_.resize(features.damped && features.ledger ? rows : 0);
  std::fill(damping_.data(), damping_.data() + damping_.size(), LoadRow{});

  const std::vector<GrainRow> grains = grain_rows(scene, s);
  std::copy(grains.begin(), grains.end(), grain_.data());
  for (Index i = 0; i < n_; ++i) {
    role_.data()[i] = s.role[i];
    mobility_.data()[i] = mobility(scene, s.r[i], s.role[i]);
    load_.data()[i] = {s.force[i], 0, s.torque[i], 0};
  }
  for (std::int64_t k = n_; k < rows; ++k) {  // dummies: pairs that never touch
    const double apart = k % 2 == n_ % 2 ? 0 : 0.25 * (sides_.side.x > 0 ? sides_.side.x : 1.0);
    grain_.data()[k] = {{apart, 0, 0}, -1e30, {0, 0, 0}, -1e30, {0, 0, 0}, 0, {0, 0, 0}, 0};
    load_.data()[k] = {};
    if (features.damped) now_.data()[k] = {};
  }
  for (Index c = 0; c < chunks; ++c) {
    Chunk& chunk = chunks_[c];
    chunk.begin = c * chunk_size_, chunk.end = std::min(n_, chunk.begin + chunk_size_);
    for (Index i = chunk.begin; i < chunk.end; ++i)
      if (s.role[i] == Role::top) chunk.top_layer.push_back(i);
  }
  for (const Contact& contact : s.contacts) {
    Chunk& chunk = chunks_[contact.i / chunk_size_];
    chunk.near[contact.j < chunk.end ? 0 : 1].add(contact.i, contact.j, contact.j,
                                                  {contact.delta_t, contact.slipping});
  }
  for (const WallContact& w : s.wall_contacts)
    chunks_[w.i / chunk_size_].walls.push_back({w.i, w.wall, {w.delta_t, w.slipping}});

  course_ = {};
  course_.drive = drive_of(scene, s);
  closed_ = true;
  counts_ = {};
  run_ = nullptr;
  with_features(features, [&]<Features F>() { select_features<F>(); });
  find_candidates();

  if (s.staggered) return;
  if (features.damped)
    for (Index i = 0; i < n_; ++i) now_.data()[i] = {grain_.data()[i].v, 0, grain_.data()[i].omega, 0};
  (this->*evaluate_)(0.0);
  Drive& drive = course_.drive;
  const Reaction reaction = sum_reactions(drive.step);
  drive.take(scene, reaction);
  drive.half_step(scene, -1);
  drive.take(scene, reaction);  // now that the wall's velocity is that of n - 1/2
  drive.ledger = {};
  drive.ledger.viscous_power = drive.viscous_power();
  for (Index i = 0; i < n_; ++i) {
    LoadRow& l = load_.data()[i];
    half_step_back(grain_.data()[i], mobility_.data()[i], l.f, l.torque, scene.dt);
    l.slip = 0;
  }
}

template <Features F>
void PairEngine::select_features() {
  run_ = &PairEngine::run<F>;
  evaluate_ = &PairEngine::evaluate<F>;
}

// Candidates, links between chunks and their slots, and with them new near lists.
void PairEngine::find_candidates() {
  neighbours_.build(space_, scene_, grain_.data(), role_.data(), n_, r_max_, margin_, /*half=*/true);
  ++counts_.rebuilds;

  std::vector<Index> link_of(chunks_.size(), no_link);  // from the chunk at hand to each other
  links_.clear();
  for (Chunk& chunk : chunks_) {
    chunk.candidates[0].clear(), chunk.candidates[1].clear(), chunk.incoming.clear(), chunk.outgoing.clear();
  }
  for (Index c = 0; c < static_cast<Index>(chunks_.size()); ++c) {
    Chunk& chunk = chunks_[c];
    for (Index i = chunk.begin; i < chunk.end; ++i) {
      for (std::int64_t k = neighbours_.row.data()[i]; k < neighbours_.row.data()[i + 1]; ++k) {
        const Index j = neighbours_.neighbour.data()[k];
        if (j < chunk.end) {
          chunk.candidates[0].push_back({i, j, no_link});
          continue;
        }
        const Index to = j / chunk_size_;
        if (link_of[to] == no_link) {
          link_of[to] = static_cast<Index>(links_.size());
          links_.push_back({c, to, 0});
          chunk.outgoing.push_back(link_of[to]);
          chunks_[to].incoming.push_back(link_of[to]);
        }
        ++links_[link_of[to]].size;
        chunk.candidates[1].push_back({i, j, link_of[to]});
      }
    }
    for (const Index l : chunk.outgoing) link_of[links_[l].to] = no_link;
  }
  const Index rows = n_ + 2 * static_cast<Index>(chunks_.size());
  std::int64_t slots = 0;
  for (Link& link : links_) {
    link.first = static_cast<Index>(rows + slots);
    slots += link.size;
  }
  if ((rows + slots) * row_bytes > std::numeric_limits<Offset>::max())
    throw error("too many grains for one process: ", n_, " grains and ", slots,
                " pairs across chunks; there is room for 67 million in all");
  for (Host::Array<LoadRow>* loads : {&load_, &damping_}) {
    if (loads->size() == 0) continue;
    if (rows + slots > loads->size()) {  // keep what grains and dummies have
      Host::Array<LoadRow> larger;
      larger.resize(rows + slots);
      std::copy(loads->data(), loads->data() + rows, larger.data());
      *loads = std::move(larger);
    }
    std::fill(loads->data() + rows, loads->data() + rows + slots, LoadRow{});
  }
  slot_owner_.resize(slots);

  course_.moved = course_.moved_near = 0;
  course_.near_margin = choose_near_margin(fastest(course_.drive), 0);
  run_team(space_.threads, [&](int t) {
    for (std::size_t c = t; c < chunks_.size(); c += space_.threads)
      rebuild_near(chunks_[c], course_.drive, course_.near_margin);
  });
}

// Long enough to last for some dozens of steps, never beyond what the candidates cover.
double PairEngine::choose_near_margin(double speed, double moved) const {
  const double wanted = std::max(2 * speed * scene_.dt * steps_near_list_should_last, 1e-5 * r_max_);
  return std::min(wanted, margin_ - moved);
}

// A bound on the speed of anything, m/s.
double PairEngine::fastest(const Drive& drive) const {
  double v2[3] = {0, 0, 0};
  for (const Chunk& chunk : chunks_)
    for (int a = 0; a < 3; ++a) v2[a] = std::max(v2[a], chunk.at(drive.step - 1).fastest2[a]);
  return std::max(std::sqrt(v2[0] + v2[1] + v2[2]), std::abs(drive.wall_v));
}

Reaction PairEngine::sum_reactions(std::int64_t step) const {
  Reaction sum;
  for (const Chunk& chunk : chunks_) sum.add(chunk.at(step).reaction);
  return sum;
}

double PairEngine::sum_slip(std::int64_t step) const {
  double sum = 0;
  for (const Chunk& chunk : chunks_) sum += chunk.at(step).slip;
  return sum;
}

// Whether all chunks that read this one's grains or send it shares have evaluated their pairs.
bool PairEngine::others_are_done(const Chunk& chunk, std::int64_t step) const {
  return std::all_of(chunk.incoming.begin(), chunk.incoming.end(), [&](Index l) {
    return progress_[links_[l].from].done.load(std::memory_order_acquire) == step;
  });
}

// Of the present step, which integrate will add up only when it comes to it; the same sums in the same order.
double PairEngine::pending_slip() const {
  double sum = 0;
  for (const Chunk& chunk : chunks_) {
    double slip = 0;
    for (Index i = chunk.begin; i < chunk.end; ++i) slip += load_.data()[i].slip;
    sum += slip;
  }
  return sum;
}

void PairEngine::rebuild_near(Chunk& chunk, const Drive& drive, double near_margin) {
  const Index dummy = n_ + 2 * static_cast<Index>(&chunk - chunks_.data());
  const GrainRow* const grain = grain_.data();
  for (const Index l : chunk.outgoing) links_[l].used = 0;
  for (int part = 0; part < 2; ++part) {
    PairList& old = chunk.near[part];
    PairList& list = chunk.spare;
    list.clear();
    std::int64_t k = 0;  // both lists are sorted by (i, j), so the springs are found by walking along
    for (const Candidate& c : chunk.candidates[part]) {
      const Vec3d plain = grain[c.i].x - grain[c.j].x, d = nearest_image(sides_, plain);
      const double reach = grain[c.i].r + grain[c.j].r + near_margin;
      if (dot(d, d) >= reach * reach) continue;
      const auto earlier = [&](std::int64_t q) {
        const PairGroup& g = old.pairs[q / 4];
        const Index i = g.first(q % 4);
        return i != c.i ? i < c.i : g.second(q % 4) < c.j;
      };
      while (k < old.count && earlier(k)) ++k;
      const bool known =
          k < old.count && old.pairs[k / 4].first(k % 4) == c.i && old.pairs[k / 4].second(k % 4) == c.j;
      Index target = c.j;
      if (part == 1) {
        Link& link = links_[c.link];
        target = link.first + link.used++;
        slot_owner_.data()[target - n_ - 2 * static_cast<Index>(chunks_.size())] = c.j;
      }
      list.add(c.i, c.j, target, known ? old.spring(k) : Spring<double>{{0, 0, 0}, 0});
      if (const auto group = static_cast<Index>(list.pairs.size() - 1);
          !(d == plain) && (list.across_sides.empty() || list.across_sides.back() != group))
        list.across_sides.push_back(group);
    }
    list.pad(dummy);
    std::swap(old, list);
  }

  std::vector<WallPair> walls;
  const auto add = [&](Index i, WallName wall) {
    const auto same = [&](const WallPair& w) { return w.i == i && w.wall == wall; };
    const auto known = std::find_if(chunk.walls.begin(), chunk.walls.end(), same);
    walls.push_back(known != chunk.walls.end() ? *known : WallPair{i, wall, {{0, 0, 0}, 0}});
  };
  for (Index i = chunk.begin; i < chunk.end; ++i) {
    if (!meets_walls(scene_, role_.data()[i])) continue;
    if (scene_.floor && grain[i].x.z - grain[i].r < near_margin) add(i, WallName::floor);
    if (scene_.top_wall.drive != TopWall::Drive::none &&
        drive.wall_z - grain[i].x.z - grain[i].r < near_margin)
      add(i, WallName::top);
  }
  chunk.walls = std::move(walls);
}

template <Features F>
void PairEngine::pair_forces(Chunk& chunk, double dt) {
  constexpr Features pairs = between_grains(F);
  pair_forces<pairs, false>(chunk.near[0], dt);
  pair_forces<pairs, true>(chunk.near[1], dt);
}

// Turns what a group's pairs do to their grains back into rows and adds them up, or leaves j's share in its
// slot.
template <Features F, bool to_slots>
inline void PairEngine::scatter(const PairGroup& p, const Geometry<Pack>& at, const Vec3<Pack>& force,
                                const Vec3<Pack>& f_x_n, const Pack& slip, LoadRow* loads) {
  const auto load = [first = reinterpret_cast<char*>(loads)](Offset o) -> LoadRow& {
    return *reinterpret_cast<LoadRow*>(first + o);
  };
  Pack f[4] = {force.x, force.y, force.z, F.ledger ? slip : Pack(0.0)};
  transpose(f[0], f[1], f[2], f[3]);
  [[maybe_unused]] Pack t[4];
  if constexpr (F.friction) {
    t[0] = f_x_n.x, t[1] = f_x_n.y, t[2] = f_x_n.z, t[3] = 0.0;
    transpose(t[0], t[1], t[2], t[3]);
  }
  for (int k = 0; k < 4; ++k) {
    LoadRow &a = load(p.i[k]), &b = load(p.target[k]);
    set_row(a.f, row(a.f) + f[k]);
    const Pack on_j = F.ledger ? without_last(f[k]) : f[k];
    set_row(b.f, to_slots ? -on_j : row(b.f) - on_j);
    if constexpr (F.friction) {
      set_row(a.torque, fma(Pack(at.l_i[k]), t[k], row(a.torque)));
      set_row(b.torque, to_slots ? Pack(at.l_j[k]) * t[k] : fma(Pack(at.l_j[k]), t[k], row(b.torque)));
    }
  }
}

// Short phases over a block of groups: gather rows and turn them into lanes, the three parts of the law, turn
// back and add up. One group alone is a long chain of dependent operations; in phases the processor works on
// several at once.
template <Features F, bool to_slots>
void PairEngine::pair_forces(PairList& list, double dt) {
  const auto grain = [first = reinterpret_cast<const char*>(grain_.data())](Offset at) -> const GrainRow& {
    return *reinterpret_cast<const GrainRow*>(first + 2 * static_cast<std::size_t>(at));
  };
  [[maybe_unused]] const auto now =
      [first = reinterpret_cast<const char*>(now_.data())](Offset at) -> const NowRow& {
    return *reinterpret_cast<const NowRow*>(first + at);
  };
  const ContactParameters law = scene_.grain;
  const Sides sides = sides_;
  const Pack minus_but_last(-1, -1, -1, 1);

  struct Lanes {
    Vec3<Pack> x_ij;
    Pack r_sum, r_difference;
    Motion<Pack> before;
    [[no_unique_address]] std::conditional_t<F.viscous, Motion<Pack>, std::tuple<>> now;

    const Motion<Pack>& at_step() const {  // for what only viscous contacts ask
      if constexpr (F.viscous)
        return now;
      else
        return before;
    }
  };
  Lanes lanes[group_block];
  Geometry<Pack> geometry[group_block];
  Slide<Pack> slides[group_block];
  Vec3<Pack> delta_t[group_block];
  Grip<Pack> grips[group_block];

  const auto groups = static_cast<std::int64_t>(list.pairs.size());
  auto across = list.across_sides.begin();
  for (std::int64_t start = 0; start < groups; start += group_block) {
    const int block = static_cast<int>(std::min<std::int64_t>(group_block, groups - start));

    for (int g = 0; g < block; ++g) {
      const PairGroup& p = list.pairs[start + g];
      Lanes& q = lanes[g];
      Pack d[4], v[4], wi[4], wj[4];
      for (int k = 0; k < 4; ++k) {
        const GrainRow &a = grain(p.i[k]), &b = grain(p.j[k]);
        d[k] = row(a.x) - row(b.x);
        v[k] = fma(minus_but_last, row(b.v), row(a.v));
        if constexpr (F.friction) wi[k] = row(a.omega), wj[k] = row(b.omega);
      }
      transpose(d[0], d[1], d[2], d[3]);
      transpose(v[0], v[1], v[2], v[3]);
      Vec3<Pack> x_ij{d[0], d[1], d[2]};
      if (across != list.across_sides.end() && *across == start + g)
        x_ij = nearest_image(sides, x_ij), ++across;
      geometry[g] = between_grains(x_ij, v[3], d[3]);
      q.before.v = {v[0], v[1], v[2]};
      if constexpr (F.friction) {
        transpose(wi[0], wi[1], wi[2], wi[3]);
        transpose(wj[0], wj[1], wj[2], wj[3]);
        q.before.omega_i = {wi[0], wi[1], wi[2]}, q.before.omega_j = {wj[0], wj[1], wj[2]};
      }
      if constexpr (F.viscous) {
        for (int k = 0; k < 4; ++k) {
          const NowRow &a = now(p.i[k]), &b = now(p.j[k]);
          v[k] = row(a.v) - row(b.v), wi[k] = row(a.omega), wj[k] = row(b.omega);
        }
        transpose(v[0], v[1], v[2], v[3]);
        transpose(wi[0], wi[1], wi[2], wi[3]);
        transpose(wj[0], wj[1], wj[2], wj[3]);
        q.now = {{v[0], v[1], v[2]}, {wi[0], wi[1], wi[2]}, {wj[0], wj[1], wj[2]}};
      }
    }
    if constexpr (F.friction)
      for (int g = 0; g < block; ++g) slides[g] = slide(dt, geometry[g], lanes[g].before);
    for (int g = 0; g < block; ++g) {
      const PairGroup& later = list.pairs[std::min(start + g + group_block, groups - 1)];
      for (const Offset j : later.j) __builtin_prefetch(&grain(j).x), __builtin_prefetch(&grain(j).omega);
      if constexpr (F.friction) delta_t[g] = carry(dt, geometry[g], slides[g], list.springs[start + g]);
    }
    for (int g = 0; g < block; ++g)
      grips[g] = grip<F>(law, geometry[g], lanes[g].at_step(), delta_t[g], list.slipping[start + g]);
    for (int g = 0; g < block; ++g) {
      const Geometry<Pack>& at = geometry[g];
      Spring<Pack> spring{list.springs[start + g], 0.0};
      const Action<Pack> a = act<F>(law, at, lanes[g].at_step(), delta_t[g], grips[g], spring);
      if constexpr (F.friction) list.springs[start + g] = spring.delta_t;
      if constexpr (F.softening) list.slipping[start + g] = spring.slipping;
      scatter<F, to_slots>(list.pairs[start + g], at, a.f, a.f_x_n, a.slip, load_.data());
      if constexpr (F.viscous && F.ledger)
        scatter<F, to_slots>(list.pairs[start + g], at, a.f_viscous, a.f_x_n_viscous, 0.0, damping_.data());
    }
  }
}

// What the pairs of other chunks have left in slots for this one.
void PairEngine::collect(const Chunk& chunk, LoadRow* load) const {
  const Index first_slot = n_ + 2 * static_cast<Index>(chunks_.size());
  for (const Index l : chunk.incoming) {
    const Link& link = links_[l];
    for (Index slot = link.first; slot < link.first + link.used; ++slot) {
      LoadRow& to = load[slot_owner_.data()[slot - first_slot]];
      set_row(to.f, row(to.f) + row(load[slot].f));
      set_row(to.torque, row(to.torque) + row(load[slot].torque));
    }
  }
}

// What the pairs of other chunks and the walls add, and the chunk's part of the reactions.
template <Features F>
void PairEngine::finish(Chunk& chunk, const Drive& drive, double dt) {
  LoadRow* const load = load_.data();
  collect(chunk, load);
  if constexpr (F.viscous && F.ledger) collect(chunk, damping_.data());

  Reaction& reaction = chunk.at(drive.step).reaction;
  reaction = {};
  for (WallPair& w : chunk.walls) {
    const GrainRow& g = grain_.data()[w.i];
    const NowRow now = F.damped ? now_.data()[w.i] : NowRow{};
    const WallAction a = wall_action<at_walls(F)>(scene_.wall, dt, drive, g, now, w.wall, w.spring);
    load[w.i].add(a.f, a.torque, a.slip);
    if constexpr (F.damped && F.ledger) damping_.data()[w.i].add(a.f_viscous, a.torque_viscous, 0);
    if (w.wall == WallName::top) {
      reaction.wall_force -= a.f.z;
      reaction.wall_damping -= a.f_viscous.z;
    }
  }
  for (const Index i : chunk.top_layer) {
    reaction.shear_force += load[i].f.x;
    if constexpr (F.damped && F.ledger) reaction.layer_damping += damping_.data()[i].f.x;
  }
  if constexpr (F.damped && F.ledger) {
    Power power;
    for (Index i = chunk.begin; i < chunk.end; ++i) {
      LoadRow& damping = damping_.data()[i];
      add_damping_power(power, grain_.data()[i], mobility_.data()[i], load[i], damping, dt);
      damping = {};
    }
    reaction.damping_power = power.total();
  }
}

template <Features F>
void PairEngine::integrate(Chunk& chunk, const Drive& drive, std::int64_t step) {
  GrainRow* const grain = grain_.data();
  if (scene_.shear.drive == Shear::Drive::stress)
    for (const Index i : chunk.top_layer) grain[i].v.x = drive.layer_u;
  const Pack zero(0.0), dt(scene_.dt, scene_.dt, scene_.dt, 0);
  [[maybe_unused]] const Pack half_dt = Pack(0.5) * dt;
  Pack sum_f = zero, fastest2 = zero;
  for (Index i = chunk.begin; i < chunk.end; ++i) {
    const Pack m = row(mobility_.data()[i]);
    const Pack inverse_mass = __builtin_shuffle(m.v, zero.v, Pack::Bits{0, 0, 1, 4});
    const Pack gravity = __builtin_shuffle(m.v, zero.v, Pack::Bits{4, 4, 2, 4});
    const Pack inverse_inertia = __builtin_shuffle(m.v, zero.v, Pack::Bits{3, 3, 3, 4});
    LoadRow& load = load_.data()[i];
    const Pack f = row(load.f), torque = row(load.torque);
    const Pack acceleration = fma(f, inverse_mass, gravity), spin_acceleration = torque * inverse_inertia;
    Kinematics<Pack> k{row(grain[i].x), row(grain[i].v), row(grain[i].omega), row(grain[i].rotation)};
    leapfrog(k, acceleration, spin_acceleration, dt);
    set_row(grain[i].x, k.x), set_row(grain[i].v, k.v), set_row(grain[i].omega, k.omega);
    set_row(grain[i].rotation, k.rotation);
    if constexpr (F.damped) {
      set_row(now_.data()[i].v, fma(half_dt, acceleration, k.v));
      set_row(now_.data()[i].omega, fma(half_dt, spin_acceleration, k.omega));
    }
    sum_f += f;
    fastest2 = max(k.v * k.v, fastest2);
    set_row(load.f, zero), set_row(load.torque, zero);
  }
  if constexpr (F.damped)
    if (scene_.shear.drive == Shear::Drive::stress)
      for (const Index i : chunk.top_layer) now_.data()[i].v.x = drive.layer_u_ahead;
  Chunk::Tally& tally = chunk.at(step);
  tally.slip = sum_f[3];
  for (int a = 0; a < 3; ++a) tally.fastest2[a] = fastest2[a];
}

void PairEngine::check(Chunk& chunk, const Drive& drive) const {
  chunk.lost = -1;
  for (Index i = chunk.begin; i < chunk.end && chunk.lost < 0; ++i)
    if (is_lost(scene_, drive, grain_.data()[i])) chunk.lost = i;
}

void PairEngine::report_lost() const {
  for (const Chunk& chunk : chunks_)
    if (chunk.lost >= 0) throw lost_grain(scene_, course_.drive, grain_.data()[chunk.lost], id_[chunk.lost]);
  throw error("internal: no grain is lost");
}

template <Features F>
void PairEngine::evaluate(double dt) {
  for (Index i = 0; i < n_; ++i) load_.data()[i] = {};
  for (Index i = 0; i < n_ && damping_.size() > 0; ++i) damping_.data()[i] = {};
  for (Chunk& chunk : chunks_) pair_forces<F>(chunk, dt);
  for (Chunk& chunk : chunks_) finish<F>(chunk, course_.drive, dt);
}

// Steps until all are done, or until new candidates are needed (then it is left between integration and
// forces, and taken up there again with at_forces).
template <Features F>
PairEngine::Pause PairEngine::run(std::int64_t& steps, bool& at_forces) {
  const double dt = scene_.dt;
  const bool layer_by_stress = scene_.shear.drive == Shear::Drive::stress;
  Barrier barrier(space_.threads);
  Pause pause = Pause::done;
  const std::int64_t wanted = steps;
  const Course start = course_;
  const bool start_at_forces = at_forces, start_closed = closed_;

  run_team(space_.threads, [&](int thread) {
    Course course = start;
    Drive& drive = course.drive;
    bool closed = start_closed, forces_next = start_at_forces, integrated = false, rebuild = false;
    std::int64_t left = wanted;
    Pause reason = Pause::done;
    std::vector<Chunk*> waiting;
    const auto mine = [&](auto&& work) {  // dealt in turns, so that all threads sweep upwards together
      for (std::size_t c = thread; c < chunks_.size(); c += space_.threads) work(chunks_[c]);
    };
    const auto close_and_advance = [&] {
      if (!closed) drive.close(scene_, sum_reactions(drive.step));
      drive.advance(scene_);
    };

    while (left > 0) {
      if (!forces_next) {
        const std::int64_t step = drive.step;
        if (layer_by_stress) {  // the layer's new velocity needs all forces on it first
          barrier.wait();
          close_and_advance();
        }
        if (!integrated) mine([&](Chunk& c) { integrate<F>(c, drive, step); });
        const bool guard = left == 1 || left % steps_between_checks == 0;
        if (guard) mine([&](Chunk& c) { check(c, drive); });
        barrier.wait();

        if (!layer_by_stress) close_and_advance();
        if (!closed) drive.ledger.slip += sum_slip(step);
        closed = false;
        if (guard &&
            std::any_of(chunks_.begin(), chunks_.end(), [](const Chunk& c) { return c.lost >= 0; })) {
          reason = Pause::lost;
          break;
        }
        const double speed = fastest(drive);
        course.moved += 2 * speed * dt;
        course.moved_near += 2 * speed * dt;
        // One step must stay in hand: a contact that opens in this step still belongs in the near list, for
        // what its spring gives up.
        if (!(course.moved + 2 * speed * dt < margin_)) {
          reason = Pause::search;
          break;
        }
        if (!(course.moved_near < course.near_margin)) {
          course.near_margin = choose_near_margin(speed, course.moved);
          course.moved_near = 0;
          rebuild = true;
        }
      }
      forces_next = false;
      --left;
      integrated = left > 0 && !layer_by_stress;
      const auto complete = [&](Chunk& c) {
        finish<F>(c, drive, dt);
        if (integrated) integrate<F>(c, drive, drive.step);
      };
      const auto take_on = [&](Chunk& c) {
        Progress& progress = progress_[&c - chunks_.data()];
        if (!progress.take(drive.step)) return;
        if (rebuild) rebuild_near(c, drive, course.near_margin);
        pair_forces<F>(c, dt);
        progress.done.store(drive.step, std::memory_order_release);
        if (others_are_done(c, drive.step))
          complete(c);
        else
          waiting.push_back(&c);
      };
      mine(take_on);
      for (Chunk& c : chunks_) take_on(c);  // what a slower thread has not come to
      for (Chunk* c : waiting) {
        wait_until([&] { return others_are_done(*c, drive.step); });
        complete(*c);
      }
      waiting.clear();
      rebuild = false;
    }
    if (thread == 0) course_ = course, closed_ = closed, steps = left, pause = reason;
  });
  at_forces = pause == Pause::search;
  return pause;
}

void PairEngine::advance(std::int64_t steps) {
  bool at_forces = false;
  while (steps > 0) {
    switch ((this->*run_)(steps, at_forces)) {
      case Pause::done:
        break;
      case Pause::search:  // which may come of a number that is no longer finite
        for (Chunk& chunk : chunks_) {
          check(chunk, course_.drive);
          if (chunk.lost >= 0) report_lost();
        }
        find_candidates();
        break;
      case Pause::lost:
        report_lost();
    }
  }
}

State PairEngine::state() const {
  State s;
  s.id = id_;
  s.x_start = x_start_;
  Drive drive = course_.drive;
  if (!closed_) {
    drive.close(scene_, sum_reactions(drive.step));
    drive.ledger.slip += pending_slip();
  }
  for (Index i = 0; i < n_; ++i) append_grain(s, grain_.data()[i], load_.data()[i], role_.data()[i]);
  for (const Chunk& chunk : chunks_) {
    for (const PairList& list : chunk.near)
      for (std::int64_t k = 0; k < list.count; ++k) {
        const Index i = list.pairs[k / 4].first(k % 4), j = list.pairs[k / 4].second(k % 4);
        append_contact(s, scene_, sides_, grain_.data()[i], grain_.data()[j], i, j, list.spring(k));
      }
    for (const WallPair& w : chunk.walls)
      append_wall_contact(s, scene_, drive, grain_.data()[w.i], w.i, w.wall, w.spring);
  }
  finish_state(s, drive);
  return s;
}

std::unique_ptr<Engine> make_pair_engine(int threads) { return std::make_unique<PairEngine>(threads); }

}  // namespace moraine::dem
