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
constexpr int block_pairs = 16;  // that go through the phases together
constexpr int rows_ahead = 8;    // that integration asks to write to
// A chunk costs as much to bring into another core's cache as to compute, so it changes hands only where its
// thread is held up for longer than that.
constexpr int turns_before_help = 300;
constexpr int steps_between_checks = 256;
constexpr int steps_near_list_should_last = 80;

// A vector and the number behind it.
using Row = Pack;
template <class Member>
Row row(const Member& v) {
  return Row::load(reinterpret_cast<const double*>(&v));
}
template <class Member>
void set_row(Member& v, Row p) {
  p.store(reinterpret_cast<double*>(&v));
}
// All of a LoadRow, or the first half of a GrainRow.
template <class Struct>
Line line(const Struct& s) {
  return Line::load(reinterpret_cast<const double*>(&s));
}
// j's line times this and i's line: x_ij, r_i - r_j, v_ij, r_i + r_j.
const Line i_minus_j{-1.0, Row(-1, -1, -1, 1)};

void clear(Host::Array<LoadRow>& loads) { std::fill(loads.data(), loads.data() + loads.size(), LoadRow{}); }

}  // namespace

Index PairEngine::PairList::add(Index i, Index j, Index target, bool across, const Spring<double>& s) {
  const int lane = count % lanes;
  if (lane == 0) {
    pairs.emplace_back();
    springs.emplace_back();
    slipping.emplace_back();
    across_sides.push_back(false);
  }
  PairGroup& p = pairs.back();
  p.i[lane] = row_bytes * i, p.j[lane] = row_bytes * j, p.target[lane] = row_bytes * target;
  for (int a = 0; a < 3; ++a) springs.back()[a].v[lane] = s.delta_t[a];
  slipping.back().v[lane] = s.slipping;
  if (across) across_sides.back() = true;
  return count++;
}

void PairEngine::PairList::pad(Index i, Index far_away, Index target) {
  while (count % lanes != 0) add(i, far_away, target, false, {{0, 0, 0}, 0});
}

Spring<double> PairEngine::PairList::spring(Index place) const {
  const Vec3<Pack>& s = springs[place / lanes];
  const int lane = static_cast<int>(place % lanes);
  return {{s.x[lane], s.y[lane], s.z[lane]}, slipping[place / lanes][lane]};
}

LoadRow* PairEngine::Buffers::take(Index rows) {
  if (free_.empty()) {
    all_.emplace_back().resize(rows);
    clear(all_.back());
    free_.push_back(all_.back().data());
  }
  LoadRow* const taken = free_.back();
  free_.pop_back();
  return taken;
}

PairEngine::PairEngine(int threads) : threads_wanted_(threads) { space_.threads = std::max(1, threads); }

std::string PairEngine::describe() const {
#if defined(__AVX2__)
  const char* set = "AVX2";
#elif defined(__x86_64__)
  const char* set = "SSE2";
#else
  const char* set = "portable SIMD";
#endif
  return "cpu, " + std::to_string(space_.threads) + (space_.threads == 1 ? " thread, " : " threads, ") + set;
}

Engine::Counts PairEngine::counts() const {
  Counts c = counts_;
  c.candidates = neighbours_.total;
  c.near = 0;
  for (const Chunk& chunk : chunks_) c.near += chunk.near[0].count + chunk.near[1].count;
  return c;
}

void PairEngine::load(const Scene& scene, const State& s, Surroundings* surroundings) {
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
  grain_.resize(n_ + 1), load_.resize(n_), role_.resize(n_);
  const Features features = features_of(scene);
  now_.resize(features.damped ? n_ + 1 : 0);
  damping_.resize(features.damped && features.ledger ? n_ : 0);
  clear(damping_);
  surroundings_ = features.water ? surroundings : nullptr;
  water_.resize(features.water ? n_ : 0);
  for (Index i = 0; i < static_cast<Index>(water_.size()); ++i)
    water_.data()[i] = {s.staggered ? s.water_force[i] : Vec3d{0, 0, 0}, 0};
  water_reaction_ = s.water;
  solved_ = -1, displaced_ = 0, failed_ = never;
  buffers_.clear();
  buffers_.resize(space_.threads);
  if (features.water)
    for (Buffers& b : buffers_) b.push.resize(chunk_size_);

  const std::vector<GrainRow> grains = grain_rows(scene, s);
  std::copy(grains.begin(), grains.end(), grain_.data());
  for (Index i = 0; i < n_; ++i) {
    role_.data()[i] = s.role[i];
    load_.data()[i] = {s.force[i], 0, s.torque[i], 0};
  }
  // One grain that never touches, for the last lanes of a list; at no round place, lest a grain be there.
  grain_.data()[n_] = {
      {-987654321.12, -876543210.98, -765432109.87}, -1e9, {0, 0, 0}, -1e9, {0, 0, 0}, 0, {0, 0, 0}, 0};
  if (features.damped) now_.data()[n_] = {};
  for (Index c = 0; c < chunks; ++c) {
    Chunk& chunk = chunks_[c];
    chunk.begin = c * chunk_size_, chunk.end = std::min(n_, chunk.begin + chunk_size_);
    for (Index i = chunk.begin; i < chunk.end; ++i)
      if (s.role[i] == Role::top) chunk.top_layer.push_back(i);
  }
  place_contacts(s.contacts);
  for (const WallContact& w : s.wall_contacts)
    chunks_[w.i / chunk_size_].walls.push_back({w.i, w.wall, {w.delta_t, w.slipping}});
  for (Chunk& chunk : chunks_)
    std::sort(chunk.walls.begin(), chunk.walls.end(), [](const WallPair& a, const WallPair& b) {
      return std::tie(a.i, a.wall) < std::tie(b.i, b.wall);
    });

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
  if (features.water) exchange_alone();
  drive.take(scene, reaction, water_at(drive.step));
  drive.half_step(scene, -1);
  drive.take(scene, reaction, drive.water);  // now that the wall's velocity is that of n - 1/2
  drive.ledger = {};
  drive.ledger.viscous_power = drive.viscous_power();
  for (Index i = 0; i < n_; ++i) {
    half_step_back(scene, grain_.data()[i], with_water(load_.data()[i], i, drive.step));
    load_.data()[i].slip = 0;
  }
}

// With the grains at rest in between: what the pressures of the start do.
void PairEngine::exchange_alone() {
  const auto chunks = static_cast<Index>(chunks_.size());
  for (Index c = 0; c < chunks; ++c) surroundings_->displace(c, grain_.data());
  water_reaction_ = surroundings_->solve(course_.drive, scene_.time(course_.drive.step));
  for (Index c = 0; c < chunks; ++c) surroundings_->push(c, grain_.data(), water_.data());
}

LoadRow PairEngine::with_water(LoadRow load, Index i, std::int64_t step) const {
  if (kicked_at(step))
    load.f = axpy(static_cast<double>(scene_.exchange_interval), water_.data()[i].f, load.f);
  return load;
}

WaterReaction PairEngine::water_at(std::int64_t step) const {
  if (kicked_at(step) || !surroundings_) return water_reaction_;
  return {water_reaction_.wall_between, 0, 0, water_reaction_.wall_between};
}

// As near pairs, from which find_candidates takes their springs.
void PairEngine::place_contacts(const std::vector<Contact>& contacts) {  // sorted
  auto contact = contacts.begin();
  for (Chunk& chunk : chunks_)
    for (; contact != contacts.end() && contact->i < chunk.end; ++contact) {
      const auto& [i, j, delta_t, slipping] = *contact;
      const int part = j < chunk.end ? 0 : 1;
      const Index place = chunk.near[part].add(i, j, 0, false, {delta_t, slipping});
      chunk.candidates[part].push_back({i, j, no_link, place});
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
  for (Chunk& chunk : chunks_) chunk.incoming.clear(), chunk.outgoing.clear();
  for (Index c = 0; c < static_cast<Index>(chunks_.size()); ++c) {
    Chunk& chunk = chunks_[c];
    std::vector<Candidate> old[2];
    std::swap(old[0], chunk.candidates[0]), std::swap(old[1], chunk.candidates[1]);
    std::size_t known[2] = {0, 0};  // all lists are sorted by (i, j)
    const auto place_of = [&](int part, Index i, Index j) {
      std::size_t& k = known[part];
      while (k < old[part].size() && std::tie(old[part][k].i, old[part][k].j) < std::tie(i, j)) ++k;
      return k < old[part].size() && old[part][k].i == i && old[part][k].j == j ? old[part][k].place
                                                                                : not_near;
    };
    for (Index i = chunk.begin; i < chunk.end; ++i) {
      for (std::int64_t k = neighbours_.row.data()[i]; k < neighbours_.row.data()[i + 1]; ++k) {
        const Index j = neighbours_.neighbour.data()[k];
        if (j < chunk.end) {
          chunk.candidates[0].push_back({i, j, no_link, place_of(0, i, j)});
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
        chunk.candidates[1].push_back({i, j, link_of[to], place_of(1, i, j)});
      }
    }
    for (const Index l : chunk.outgoing) link_of[links_[l].to] = no_link;
  }
  std::int64_t slots = 1;  // the first one is for pads
  for (Link& link : links_) {
    link.first = static_cast<Index>(slots);
    slots += link.size;
  }
  if (std::max<std::int64_t>(n_ + 1, slots) * row_bytes > std::numeric_limits<Offset>::max())
    throw error("too many grains for one process: ", n_, " grains and ", slots,
                " pairs across chunks; there is room for 67 million of each");
  slot_.resize(slots), slot_owner_.resize(slots);
  clear(slot_);
  if (damping_.size() > 0) {
    damping_slot_.resize(slots);
    clear(damping_slot_);
  }

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
    GroupedSum slip;
    for (Index i = chunk.begin; i < chunk.end; ++i) slip.add(i, load_.data()[i].slip);
    sum += slip.total();
  }
  return sum;
}

void PairEngine::rebuild_near(Chunk& chunk, const Drive& drive, double near_margin) {
  const GrainRow* const grain = grain_.data();
  for (const Index l : chunk.outgoing) links_[l].used = 0;
  for (int part = 0; part < 2; ++part) {
    PairList& old = chunk.near[part];
    PairList& list = chunk.spare;
    list.clear();
    std::vector<Candidate>& candidates = chunk.candidates[part];
    for (std::size_t start = 0; start < candidates.size(); start += lanes) {
      const int used = static_cast<int>(std::min<std::size_t>(lanes, candidates.size() - start));
      Line lines[lanes];
      Pack c[8];
      for (int k = 0; k < lanes; ++k) {
        const Candidate& q = candidates[start + std::min(k, used - 1)];
        lines[k] = fma(i_minus_j, line(grain[q.j]), line(grain[q.i]));
      }
      to_columns(lines, c);
      const Vec3<Pack> plain{c[0], c[1], c[2]}, d = nearest_image(sides_, plain), shift = d - plain;
      const Pack reach = c[7] + Pack(near_margin);
      const Pack apart = dot(d, d) - reach * reach, across = dot(shift, shift);
      for (int k = 0; k < used; ++k) {
        Candidate& q = candidates[start + k];
        if (!(apart[k] < 0)) {
          q.place = not_near;
          continue;
        }
        Index target = q.j;
        if (part == 1) {
          Link& link = links_[q.link];
          target = link.first + link.used++;
          slot_owner_.data()[target] = q.j;
        }
        const Spring<double> spring =
            q.place == not_near ? Spring<double>{{0, 0, 0}, 0} : old.spring(q.place);
        q.place = list.add(q.i, q.j, target, across[k] > 0, spring);
      }
    }
    list.pad(chunk.begin, n_, part == 1 ? 0 : chunk.begin);
    std::swap(old, list);
  }

  std::vector<WallPair> walls;
  auto known = chunk.walls.begin();  // sorted by grain, then wall
  const auto add = [&](Index i, WallName wall) {
    const auto at = [](const WallPair& w) { return std::tie(w.i, w.wall); };
    while (known != chunk.walls.end() && at(*known) < std::tie(i, wall)) ++known;
    const bool same = known != chunk.walls.end() && at(*known) == std::tie(i, wall);
    walls.push_back(same ? *known : WallPair{i, wall, {{0, 0, 0}, 0}});
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
void PairEngine::pair_forces(Chunk& chunk, double dt, LoadRow* load) {
  constexpr Features pairs = between_grains(F);
  pair_forces<pairs, false>(chunk.near[0], dt, load);
  pair_forces<pairs, true>(chunk.near[1], dt, load);
}

// Turns what a group's pairs do to their grains back into lines and adds them up, or leaves j's share in its
// slot.
template <Features F, bool to_slots>
inline void PairEngine::scatter(const PairGroup& p, const Geometry<Pack>& at, const Vec3<Pack>& f,
                                const Vec3<Pack>& f_x_n, const Pack& slip, LoadRow* load, LoadRow* slot) {
  const auto row_at = [](LoadRow* first, Offset o) -> double* {
    return reinterpret_cast<double*>(reinterpret_cast<char*>(first) + o);
  };
  const Pack zero(0.0);
  const Pack columns[8] = {f.x, f.y, f.z, F.ledger ? slip : zero, f_x_n.x, f_x_n.y, f_x_n.z, zero};
  Line action[lanes];
  to_lines(columns, action);
  for (int k = 0; k < lanes; ++k) {
    double *const a = row_at(load, p.i[k]), *const b = row_at(to_slots ? slot : load, p.target[k]);
    const double l_i = F.friction ? at.l_i[k] : 0, l_j = F.friction ? at.l_j[k] : 0;
    fma(Line{1.0, l_i}, action[k], Line::load(a)).store(a);
    const Line on_j{Row(-1, -1, -1, 0), l_j};
    (to_slots ? on_j * action[k] : fma(on_j, action[k], Line::load(b))).store(b);
  }
}

// Short phases over a block of groups: gather rows and turn them into lanes, the three parts of the law, turn
// back and add up. One group alone is a long chain of dependent operations; in phases the processor works on
// several at once.
template <Features F, bool to_slots>
[[gnu::flatten]] void PairEngine::pair_forces(PairList& list, double dt, LoadRow* load) {
  const auto grain = [first = reinterpret_cast<const char*>(grain_.data())](Offset at) -> const GrainRow& {
    return *reinterpret_cast<const GrainRow*>(first + 2 * static_cast<std::size_t>(at));
  };
  [[maybe_unused]] const auto now =
      [first = reinterpret_cast<const char*>(now_.data())](Offset at) -> const NowRow& {
    return *reinterpret_cast<const NowRow*>(first + at);
  };
  const ContactParameters law = scene_.grain;
  const Sides sides = sides_;
  const Line difference = i_minus_j;
  constexpr int group_block = block_pairs / lanes;

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
  Lanes motion[group_block];
  Geometry<Pack> geometry[group_block];
  Slide<Pack> slides[group_block];
  Vec3<Pack> delta_t[group_block];
  Grip<Pack> grips[group_block];

  const auto groups = static_cast<std::int64_t>(list.pairs.size());
  for (std::int64_t start = 0; start < groups; start += group_block) {
    const int block = static_cast<int>(std::min<std::int64_t>(group_block, groups - start));

    for (int g = 0; g < block; ++g) {
      const PairGroup& p = list.pairs[start + g];
      Lanes& q = motion[g];
      Line lines[lanes];
      Pack c[8];
      for (int k = 0; k < lanes; ++k) lines[k] = fma(difference, line(grain(p.j[k])), line(grain(p.i[k])));
      to_columns(lines, c);
      Vec3<Pack> x_ij{c[0], c[1], c[2]};
      if (list.across_sides[start + g]) x_ij = nearest_image(sides, x_ij);
      q.x_ij = x_ij, q.r_sum = c[7], q.r_difference = c[3];
      q.before.v = {c[4], c[5], c[6]};
      if constexpr (F.friction) {
        for (int k = 0; k < lanes; ++k) lines[k] = {row(grain(p.i[k]).omega), row(grain(p.j[k]).omega)};
        to_columns(lines, c);
        q.before.omega_i = {c[0], c[1], c[2]}, q.before.omega_j = {c[4], c[5], c[6]};
      }
      if constexpr (F.viscous) {
        for (int k = 0; k < lanes; ++k)
          lines[k] = fma(Line{Row(-1, -1, -1, 0), 0.0}, line(now(p.j[k])), line(now(p.i[k])));
        to_columns(lines, c);
        q.now.v = {c[0], c[1], c[2]}, q.now.omega_i = {c[4], c[5], c[6]};
        for (int k = 0; k < lanes; ++k) lines[k] = line(now(p.j[k]));
        to_columns(lines, c);
        q.now.omega_j = {c[4], c[5], c[6]};
      }
    }
    for (int g = 0; g < block; ++g) {
      geometry[g] = between_grains(motion[g].x_ij, motion[g].r_sum, motion[g].r_difference);
      if constexpr (F.friction) slides[g] = slide(dt, geometry[g], motion[g].before);
    }
    for (int g = 0; g < block; ++g) {
      const PairGroup& later = list.pairs[std::min(start + g + group_block, groups - 1)];
      for (const Offset j : later.j) __builtin_prefetch(&grain(j).x), __builtin_prefetch(&grain(j).omega);
      if constexpr (F.friction) delta_t[g] = carry(dt, geometry[g], slides[g], list.springs[start + g]);
      grips[g] = grip<F>(law, geometry[g], motion[g].at_step(), delta_t[g], list.slipping[start + g]);
    }
    for (int g = 0; g < block; ++g) {
      const Geometry<Pack>& at = geometry[g];
      Spring<Pack> spring{list.springs[start + g], Pack(0.0)};
      if constexpr (F.softening) spring.slipping = list.slipping[start + g];
      const Action<Pack> a = act<F>(law, dt, at, motion[g].at_step(), delta_t[g], grips[g], spring);
      if constexpr (F.friction) list.springs[start + g] = spring.delta_t;
      if constexpr (F.softening) list.slipping[start + g] = spring.slipping;
      scatter<F, to_slots>(list.pairs[start + g], at, a.f, a.f_x_n, a.slip, load, slot_.data());
      if constexpr (F.viscous && F.ledger)
        scatter<F, to_slots>(list.pairs[start + g], at, a.f_viscous, a.f_x_n_viscous, Pack(0.0),
                             damping_.data(), damping_slot_.data());
    }
  }
}

// What the pairs of other chunks have left in slots for this one.
void PairEngine::collect(const Chunk& chunk, LoadRow* load, const LoadRow* slots) const {
  for (const Index l : chunk.incoming) {
    const Link& link = links_[l];
    for (Index slot = link.first; slot < link.first + link.used; ++slot) {
      LoadRow& to = load[slot_owner_.data()[slot]];
      set_row(to.f, row(to.f) + row(slots[slot].f));
      set_row(to.torque, row(to.torque) + row(slots[slot].torque));
    }
  }
}

// What the pairs of other chunks and the walls add, and the chunk's part of the reactions.
template <Features F>
void PairEngine::finish(Chunk& chunk, const Drive& drive, double dt, LoadRow* load) {
  collect(chunk, load, slot_.data());
  if constexpr (F.viscous && F.ledger) collect(chunk, damping_.data(), damping_slot_.data());

  GroupedSum wall_force, wall_damping, shear_force, layer_damping, power;
  for (WallPair& w : chunk.walls) {
    const GrainRow& g = grain_.data()[w.i];
    const NowRow now = F.damped ? now_.data()[w.i] : NowRow{};
    const WallAction a = wall_action<at_walls(F)>(scene_.wall, dt, drive, g, now, w.wall, w.spring);
    load[w.i].add(a.f, a.torque, a.slip);
    if constexpr (F.damped && F.ledger) damping_.data()[w.i].add(a.f_viscous, a.torque_viscous, 0);
    if (w.wall == WallName::top) {
      wall_force.add(w.i, -a.f.z);
      wall_damping.add(w.i, -a.f_viscous.z);
    }
  }
  for (const Index i : chunk.top_layer) {
    shear_force.add(i, load[i].f.x);
    if constexpr (F.damped && F.ledger) layer_damping.add(i, damping_.data()[i].f.x);
  }
  if constexpr (F.damped && F.ledger)
    for (Index i = chunk.begin; i < chunk.end; ++i) {
      LoadRow& damping = damping_.data()[i];
      // Of the last exchange: the present one may not have been solved yet.
      const LoadRow whole = F.water ? with_water(load[i], i, drive.step) : load[i];
      power.add(i, damping_power(scene_, grain_.data()[i], whole, damping, dt));
      damping = {};
    }
  chunk.at(drive.step).reaction = {wall_force.total(), shear_force.total(), wall_damping.total(),
                                   layer_damping.total(), power.total()};
}

template <Features F>
void PairEngine::integrate(Chunk& chunk, const Drive& drive, std::int64_t step, LoadRow* loads,
                           const WaterRow* push) {
  GrainRow* const grain = grain_.data();
  if (scene_.shear.drive == Shear::Drive::stress)
    for (const Index i : chunk.top_layer) grain[i].v.x = drive.layer_u;
  const Row zero(0.0), dt(scene_.dt, scene_.dt, scene_.dt, 0);
  const Row all_three(1, 1, 1, 0), only_z(0, 0, 1, 0), gravity(0, 0, -scene_.submerged_gravity(), 0);
  [[maybe_unused]] const Row half_dt = Row(0.5) * dt;
  [[maybe_unused]] const Row impulse(static_cast<double>(scene_.exchange_interval));
  Row sum_f = zero, group_f = zero, fastest2 = zero;
  for (Index i = chunk.begin; i < chunk.end; ++i) {
    // Other threads have read these rows; asking for several at once to write to saves most of the waiting.
    __builtin_prefetch(&grain[i + rows_ahead].x, 1), __builtin_prefetch(&grain[i + rows_ahead].omega, 1);
    GrainRow& g = grain[i];
    const bool free = g.inverse_inertia > 0;  // as in mobility()
    const Row inverse_mass = Row(g.inverse_mass) * (free ? all_three : only_z);
    const Row f = row(loads[i].f), torque = row(loads[i].torque);
    Row force = f;
    if constexpr (F.water)
      if (push) force = fma(impulse, row(push[i].f), f);
    const Row acceleration = fma(force, inverse_mass, free ? gravity : zero);
    const Row spin_acceleration = torque * Row(g.inverse_inertia);
    Kinematics<Row> k{row(g.x), row(g.v), row(g.omega), row(g.rotation)};
    leapfrog(k, acceleration, spin_acceleration, dt);
    set_row(g.x, k.x), set_row(g.v, k.v), set_row(g.omega, k.omega), set_row(g.rotation, k.rotation);
    if constexpr (F.damped) {
      set_row(now_.data()[i].v, fma(half_dt, acceleration, k.v));
      set_row(now_.data()[i].omega, fma(half_dt, spin_acceleration, k.omega));
    }
    group_f += f;
    if (ends_group(i)) sum_f += group_f, group_f = zero;
    fastest2 = max(k.v * k.v, fastest2);
    set_row(loads[i].f, zero), set_row(loads[i].torque, zero);
  }
  if constexpr (F.damped)
    if (scene_.shear.drive == Shear::Drive::stress)
      for (const Index i : chunk.top_layer) now_.data()[i].v.x = drive.layer_u_ahead;
  Chunk::Tally& tally = chunk.at(step);
  tally.slip = (sum_f + group_f)[3];
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
  clear(load_), clear(damping_);
  for (Chunk& chunk : chunks_) pair_forces<F>(chunk, dt, load_.data());
  for (Chunk& chunk : chunks_) finish<F>(chunk, course_.drive, dt, load_.data());
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
    struct Waiting {
      Chunk* chunk;
      LoadRow* load;
    };
    std::vector<Waiting> waiting;
    Buffers& buffers = buffers_[thread];
    // Each thread has a stretch of neighbours, most of which it finds in its own cache from the last step,
    // and begins with those that other threads wait for.
    const std::size_t first = chunks_.size() * thread / space_.threads,
                      end = chunks_.size() * (thread + 1) / space_.threads;
    std::vector<Chunk*> mine;
    for (std::size_t c = first; c < end; ++c) mine.push_back(&chunks_[c]);
    std::stable_partition(mine.begin(), mine.end(), [&](const Chunk* c) {
      return std::any_of(c->outgoing.begin(), c->outgoing.end(),
                         [&](Index l) { return static_cast<std::size_t>(links_[l].to) >= end; });
    });
    const auto close_and_advance = [&] {
      if (!closed) drive.close(scene_, sum_reactions(drive.step), water_at(drive.step));
      drive.advance(scene_);
    };
    // An exception that left a team of threads would end the program: kept until all have met at a barrier.
    [[maybe_unused]] const auto keep_failure = [&](auto&& act) {
      try {
        act();
      } catch (...) {
        failure_ = std::current_exception();
        failed_ = drive.step;
      }
    };
    // The thread that is last to say where its grains went solves for the pressure while others go on to
    // their pairs. Whether there are weights; the same for all threads.
    [[maybe_unused]] const auto exchange = [&](bool displaced) {
      if (surroundings_->stale()) {
        displaced = false;
        if (thread == 0) keep_failure([&] { surroundings_->remap(grain_.data(), drive); });
        barrier.wait();
        if (failed_ <= drive.step) return false;
      }
      if (!displaced)
        for (const Chunk* c : mine)
          surroundings_->displace(static_cast<Index>(c - chunks_.data()), grain_.data());
      if (displaced_.fetch_add(1, std::memory_order_acq_rel) + 1 < space_.threads) return true;
      displaced_.store(0, std::memory_order_relaxed);
      keep_failure([&] { water_reaction_ = surroundings_->solve(drive, scene_.time(drive.step)); });
      solved_.store(drive.step, std::memory_order_release);
      return true;
    };

    while (left > 0) {
      if (!forces_next) {
        const std::int64_t step = drive.step;
        if (layer_by_stress) {  // the layer's new velocity needs all forces on it first
          barrier.wait();
          close_and_advance();
        }
        if (!integrated)
          for (Chunk* c : mine)
            integrate<F>(*c, drive, step, load_.data(), kicked_at(step) ? water_.data() : nullptr);
        const bool guard = left == 1 || left % steps_between_checks == 0;
        if (guard)
          for (Chunk* c : mine) check(*c, drive);
        barrier.wait();
        if (F.water && failed_ <= step) break;

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
      // By the threads that integrated them.
      [[maybe_unused]] const bool displaced = integrated && !forces_next;
      forces_next = false;
      --left;
      integrated = left > 0 && !layer_by_stress;
      [[maybe_unused]] const bool exchanging = F.water && kicked_at(drive.step);
      if constexpr (F.water)
        if (exchanging && !exchange(displaced)) break;
      const auto is_ready = [&](const Chunk& c) {
        if constexpr (F.water)
          if (exchanging && solved_.load(std::memory_order_acquire) != drive.step) return false;
        return others_are_done(c, drive.step);
      };
      // Loads that are asked for after this step go to their own place, all others to a buffer. So does the
      // push of the water, unless the damping's ledger or a later step may ask for it.
      [[maybe_unused]] const bool keep_push = !integrated || F.damped || scene_.exchange_interval > 1;
      const auto complete = [&](Waiting w) {
        finish<F>(*w.chunk, drive, dt, w.load);
        WaterRow* push = nullptr;
        const auto c = static_cast<Index>(w.chunk - chunks_.data());
        if constexpr (F.water)
          if (exchanging) {
            push = keep_push ? water_.data() : buffers.push.data() - w.chunk->begin;
            surroundings_->push(c, grain_.data(), push);
          }
        if (!integrated) return;
        integrate<F>(*w.chunk, drive, drive.step, w.load, push);
        if constexpr (F.water)  // while they are in cache; the pressure of this step is solved for
          if (kicked_at(drive.step + 1) && !surroundings_->stale()) surroundings_->displace(c, grain_.data());
        buffers.give_back(w.load + w.chunk->begin);
      };
      const auto take_on = [&](Chunk& c) {
        Progress& progress = progress_[&c - chunks_.data()];
        if (!progress.take(drive.step)) return;
        if (rebuild) rebuild_near(c, drive, course.near_margin);
        const Waiting w{&c, integrated ? buffers.take(chunk_size_) - c.begin : load_.data()};
        pair_forces<F>(c, dt, w.load);
        progress.done.store(drive.step, std::memory_order_release);
        if (is_ready(c))
          complete(w);
        else
          waiting.push_back(w);
      };
      for (Chunk* c : mine) take_on(*c);
      std::size_t all_taken_from = chunks_.size();
      for (Patience patience;;) {
        const auto ready = std::find_if(waiting.begin(), waiting.end(),
                                        [&](const Waiting& w) { return is_ready(*w.chunk); });
        if (ready != waiting.end()) {
          complete(*ready);
          waiting.erase(ready);
          continue;
        }
        while (all_taken_from > 0 && progress_[all_taken_from - 1].is_taken(drive.step)) --all_taken_from;
        if (waiting.empty() && all_taken_from == 0) break;
        patience.wait();
        if (all_taken_from > 0 && patience.turns() > turns_before_help) {
          take_on(chunks_[all_taken_from - 1]);
          patience.renew();
        }
      }
      rebuild = false;
    }
    if (thread == 0) course_ = course, closed_ = closed, steps = left, pause = reason;
  });
  if (failed_ != never) pause = Pause::failed;
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
      case Pause::failed: {  // which may come of a lost grain, too
        for (Chunk& chunk : chunks_) {
          check(chunk, course_.drive);
          if (chunk.lost >= 0) report_lost();
        }
        std::rethrow_exception(failure_);
      }
    }
  }
}

State PairEngine::state() const {
  State s;
  s.id = id_;
  s.x_start = x_start_;
  Drive drive = course_.drive;
  if (!closed_) {
    drive.close(scene_, sum_reactions(drive.step), water_at(drive.step));
    drive.ledger.slip += pending_slip();
  }
  for (std::int64_t i = 0; i < water_.size(); ++i) s.water_force.push_back(water_.data()[i].f);
  for (Index i = 0; i < n_; ++i) append_grain(s, grain_.data()[i], load_.data()[i], role_.data()[i]);
  for (const Chunk& chunk : chunks_) {
    for (int part = 0; part < 2; ++part)
      for (const Candidate& c : chunk.candidates[part])
        if (c.place != not_near)
          append_contact(s, scene_, sides_, grain_.data()[c.i], grain_.data()[c.j], c.i, c.j,
                         chunk.near[part].spring(c.place));
    for (const WallPair& w : chunk.walls)
      append_wall_contact(s, scene_, drive, grain_.data()[w.i], w.i, w.wall, w.spring);
  }
  finish_state(s, drive);
  return s;
}

std::unique_ptr<Engine> make_pair_engine(int threads) { return std::make_unique<PairEngine>(threads); }

}  // namespace moraine::dem
