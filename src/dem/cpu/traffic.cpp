#include "dem/cpu/traffic.hpp"

#include <algorithm>
#include <cstring>

namespace moraine::dem::cpu {

namespace {

// What a message has of a share: as many numbers as the law makes.
std::size_t numbers_of_share(const Bed& bed) { return bed.uses.grains.friction ? 6 : 3; }
// Of so many links: how many slots each has used, then whose they are, then the shares.
std::size_t head_bytes(std::size_t links, std::size_t slots) { return (4 * (links + slots) + 7) / 8 * 8; }

}  // namespace

void Traffic::lay_out(const Bed& bed) {
  numbers_ = bed.uses.grains.friction ? 9 : 6;
  const auto chunks = static_cast<Index>(bed.chunks.size());
  const auto most = [&](std::size_t links, std::size_t slots) {
    return head_bytes(links, slots) + slots * numbers_of_share(bed) * sizeof(double);
  };
  for (Later& l : later_) {
    l.links.clear();
    std::size_t slots = 0;
    for (std::size_t k = 0; k < bed.links.size(); ++k) {
      const Link& link = bed.links[k];
      if (link.to < chunks || bed.part.rank_of_chunk(bed.part.first_chunk() + link.to) != l.rank) continue;
      l.links.push_back(static_cast<Index>(k)), slots += link.size;
    }
    l.rows.resize(static_cast<std::size_t>(numbers_ * l.ghosts)),
        l.shares.resize(most(l.links.size(), slots));
  }
  for (Earlier& e : earlier_) {
    std::size_t slots = 0;
    for (Index k = e.first_link; k < e.first_link + e.links; ++k) slots += bed.links[k].size;
    e.rows.resize(numbers_ * e.wanted.size()), e.shares.resize(most(e.links, slots));
  }
  chunks_with_ghosts_ = static_cast<int>(std::ranges::count_if(bed.chunks, &Chunk::needs_ghosts));
  rows_at_ = shares_at_ = -1;
}

void Traffic::begin(Bed& bed, std::int64_t step) {
  chunks_done_ = 0, sent_shares_ = 0;
  const GrainRow* const grain = bed.grain.data();
  for (Later& l : later_) {
    l.has_rows = false;
    l.rows_in = ranks_.receive(l.rank, Tag::rows, l.rows.data(), l.rows.size() * sizeof(double));
  }
  for (Earlier& e : earlier_) {
    e.has_shares = false;
    e.shares_in = ranks_.receive(e.rank, Tag::shares, e.shares.data(), e.shares.size());
    ranks_.wait(e.rows_out);
    double* to = e.rows.data();
    for (const Index i : e.wanted) {
      const GrainRow& g = grain[i];
      std::memcpy(to, &g.x, sizeof g.x), std::memcpy(to + 3, &g.v, sizeof g.v);
      if (numbers_ > 6) std::memcpy(to + 6, &g.omega, sizeof g.omega);
      to += numbers_;
    }
    e.rows_out = ranks_.send(e.rank, Tag::rows, e.rows.data(), e.rows.size() * sizeof(double));
    bytes_sent_ += e.rows.size() * sizeof(double);
  }
  if (later_.empty()) rows_at_.store(step, std::memory_order_release);
  if (earlier_.empty()) shares_at_.store(step, std::memory_order_release);
}

void Traffic::progress(Bed& bed, std::int64_t step) {
  if (!has_rows(step)) {
    bool all = true;
    for (Later& l : later_) {
      if (!l.has_rows && ranks_.done(l.rows_in)) take_rows(bed, l);
      all = all && l.has_rows;
    }
    if (all) rows_at_.store(step, std::memory_order_release);
  }
  if (sent_shares_ < later_.size() && chunks_done_.load(std::memory_order_acquire) == chunks_with_ghosts_)
    for (; sent_shares_ < later_.size(); ++sent_shares_) send_shares(bed, later_[sent_shares_]);
  if (!has_shares(step)) {
    bool all = true;
    for (Earlier& e : earlier_) {
      if (!e.has_shares && ranks_.done(e.shares_in)) take_shares(bed, e);
      all = all && e.has_shares;
    }
    if (all) shares_at_.store(step, std::memory_order_release);
  }
}

void Traffic::finish() {
  for (Earlier& e : earlier_) ranks_.wait(e.rows_out);
  for (Later& l : later_) ranks_.wait(l.shares_out);
}

void Traffic::take_rows(Bed& bed, Later& from) {
  const double* at = from.rows.data();
  for (Index i = from.first_ghost; i < from.first_ghost + from.ghosts; ++i, at += numbers_) {
    GrainRow& g = bed.grain.data()[i];
    std::memcpy(&g.x, at, sizeof g.x), std::memcpy(&g.v, at + 3, sizeof g.v);
    if (numbers_ > 6) std::memcpy(&g.omega, at + 6, sizeof g.omega);
  }
  from.has_rows = true;
}

void Traffic::send_shares(const Bed& bed, Later& to) {
  ranks_.wait(to.shares_out);
  const Index other_first = bed.order.begin_of(bed.part.first_chunks[to.rank]) - bed.part.first;
  auto* const head = reinterpret_cast<std::int32_t*>(to.shares.data());
  std::size_t slots = 0;
  for (std::size_t k = 0; k < to.links.size(); ++k) slots += head[k] = bed.links[to.links[k]].used;
  std::int32_t* owner = head + to.links.size();
  const std::size_t numbers = numbers_of_share(bed), first = head_bytes(to.links.size(), slots);
  std::byte* share = to.shares.data() + first;
  for (const Index l : to.links) {
    const Link& link = bed.links[l];
    for (Index slot = link.first; slot < link.first + link.used; ++slot) {
      *owner++ = bed.number(bed.slot_owner.data()[slot]) - other_first;
      const LoadRow& row = bed.slot.data()[slot];
      std::memcpy(share, &row.f, sizeof row.f);
      if (numbers > 3) std::memcpy(share + sizeof row.f, &row.torque, sizeof row.torque);
      share += numbers * sizeof(double);
    }
  }
  const std::size_t bytes = first + slots * numbers * sizeof(double);
  to.shares_out = ranks_.send(to.rank, Tag::shares, to.shares.data(), bytes);
  bytes_sent_ += bytes;
}

void Traffic::take_shares(Bed& bed, Earlier& from) {
  const auto* const head = reinterpret_cast<const std::int32_t*>(from.shares.data());
  std::size_t slots = 0;
  for (Index k = 0; k < from.links; ++k) slots += head[k];
  const std::int32_t* owner = head + from.links;
  const std::size_t numbers = numbers_of_share(bed);
  const std::byte* share = from.shares.data() + head_bytes(from.links, slots);
  for (Index k = 0; k < from.links; ++k) {
    Link& link = bed.links[from.first_link + k];
    link.used = head[k];
    for (Index slot = link.first; slot < link.first + link.used; ++slot) {
      bed.slot_owner.data()[slot] = *owner++;
      LoadRow& row = bed.slot.data()[slot];
      row.slip = row.viscous = 0, row.torque = {0, 0, 0};
      std::memcpy(&row.f, share, sizeof row.f);
      if (numbers > 3) std::memcpy(&row.torque, share + sizeof row.f, sizeof row.torque);
      share += numbers * sizeof(double);
    }
  }
  from.has_shares = true;
}

bool Traffic::share_tallies(Bed& bed, const BodyMotion& bodies, std::int64_t step) {
  const Part& part = bed.part;
  const auto servos = static_cast<std::size_t>(bodies.servos);
  const std::size_t of_chunk = servos + 2, of_rank = 6;  // numbers
  std::vector<std::size_t> begin;                        // bytes
  for (int r = 0; r <= ranks_.size(); ++r)
    begin.push_back(sizeof(double) * (of_chunk * part.first_chunks[r] + of_rank * r));
  static thread_local std::vector<double> all;
  all.resize(begin.back() / sizeof(double));
  double* to = all.data() + begin[ranks_.rank()] / sizeof(double);

  double* const most = std::exchange(to, to + of_rank);
  std::fill(most, most + of_rank, 0.0);
  for (const Chunk& c : bed.chunks) {
    const Chunk::Tally& t = c.at(step);
    for (int a = 0; a < 3; ++a) most[a] = std::max(most[a], t.fastest2[a]);
    for (const double way2 : t.ways2)
      most[4] = std::max(most[4], std::min(most[3], way2)), most[3] = std::max(most[3], way2);
    if (c.lost >= 0) most[5] = 1;
    to = std::copy(t.reaction.force, t.reaction.force + servos, to);
    *to++ = t.lost.slip, *to++ = t.lost.viscous;
  }
  ranks_.gather(all.data(), begin);

  std::vector<Chunk::Tally>& tallies = bed.tallies[step & 1];
  tallies.resize(part.first_chunks.back());
  bool lost = false;
  for (int r = 0; r < ranks_.size(); ++r) {
    const double* from = all.data() + begin[r] / sizeof(double);
    Chunk::Tally& first = tallies[part.first_chunks[r]];
    std::copy(from, from + 3, first.fastest2), std::copy(from + 3, from + 5, first.ways2);
    lost = lost || from[5] > 0;
    from += of_rank;
    for (Index c = part.first_chunks[r]; c < part.first_chunks[r + 1]; ++c) {
      std::copy(from, from + servos, tallies[c].reaction.force), from += servos;
      tallies[c].lost = {from[0], from[1]}, from += 2;
    }
  }
  return lost;
}

void Traffic::count_work(const Bed& bed) {
  double mine = 0;
  for (const Chunk& c : bed.chunks) mine += work_of(c);
  work_ = of_all(ranks_, mine);
}

}  // namespace moraine::dem::cpu
