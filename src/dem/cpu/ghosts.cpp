// The part of Traffic that a search has: which grains of other ranks a rank must know.
#include <algorithm>
#include <cmath>
#include <limits>

#include "dem/cpu/traffic.hpp"
#include "dem/neighbours.hpp"

namespace moraine::dem::cpu {

namespace {

struct Extent {
  double low[3], high[3];  // m
};

// Of all grains of all ranks. Throws Error on all ranks where one is not finite.
Extent extent_of(Ranks& ranks, const Bed& bed) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Extent own{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
  bool finite = true;
  for (Index i = 0; i < bed.n; ++i)
    for (int a = 0; a < 3; ++a) {
      const double x = bed.grain.data()[i].x[a];
      own.low[a] = std::min(own.low[a], x), own.high[a] = std::max(own.high[a], x);
      finite = finite && std::isfinite(x);
    }
  expect_well(&ranks, finite ? "" : "a grain's coordinates are not finite");
  for (const Extent& e : of_all(ranks, own))
    for (int a = 0; a < 3; ++a)
      own.low[a] = std::min(own.low[a], e.low[a]), own.high[a] = std::max(own.high[a], e.high[a]);
  return own;
}

// Cells no narrower than the reach of a pair, and so few that their bits are quickly sent.
CellGrid coarse_grid(const Bed& bed, const Extent& extent) {
  const double most = std::max(4096.0, bed.part.all / 64.0);
  CellGrid grid{{}, {}, {1, 1, 1}, bed.sides};
  double length[3], width = (2 * bed.r_max + bed.margin) * (1 + 1e-9);
  for (int a = 0; a < 3; ++a) {
    const bool periodic = bed.sides.side[a] > 0;
    grid.origin[a] = periodic ? 0 : extent.low[a];
    length[a] = periodic ? bed.sides.side[a] : extent.high[a] - extent.low[a];
  }
  const auto along = [&](int a) { return std::max(1.0, std::floor(length[a] / width)); };
  while (along(0) * along(1) * along(2) > most) width *= 1.1;
  for (int a = 0; a < 3; ++a) {
    grid.n[a] = static_cast<std::int32_t>(along(a));
    grid.inverse_cell[a] = length[a] > 0 ? grid.n[a] / length[a] : 0;
  }
  return grid;
}

class CellSet {
 public:
  CellSet(const CellGrid& grid, const std::uint64_t* bits) : grid_(grid), bits_(bits) {}
  bool has(std::int32_t cell) const { return bits_[cell / 64] >> (cell % 64) & 1; }
  // Whether it has the cell or one beside it.
  bool has_near(const Vec3d& x) const {
    std::int32_t low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      const std::int32_t c = grid_.along(a, x[a]);
      const bool periodic = grid_.sides.side[a] > 0;
      low[a] = periodic ? c - 1 : std::max(c - 1, 0);
      high[a] = periodic ? c + 1 : std::min(c + 1, grid_.n[a] - 1);
    }
    for (std::int32_t z = low[2]; z <= high[2]; ++z)
      for (std::int32_t y = low[1]; y <= high[1]; ++y)
        for (std::int32_t c = low[0]; c <= high[0]; ++c)
          if (has((wrapped(2, z) * grid_.n[1] + wrapped(1, y)) * grid_.n[0] + wrapped(0, c))) return true;
    return false;
  }

 private:
  std::int32_t wrapped(int a, std::int32_t c) const { return (c + grid_.n[a]) % grid_.n[a]; }
  const CellGrid& grid_;
  const std::uint64_t* bits_;
};

}  // namespace

void Traffic::fetch_ghosts(Bed& bed) {
  // What candidates know is by number from here on, as rows of ghosts change.
  for (Chunk& chunk : bed.chunks)
    for (Candidate& c : chunk.candidates[1]) c.j = bed.number(c.j);

  const CellGrid grid = coarse_grid(bed, extent_of(ranks_, bed));
  const std::size_t words = (static_cast<std::size_t>(grid.n[0]) * grid.n[1] * grid.n[2] + 63) / 64;
  std::vector<std::uint64_t> bits(words * ranks_.size());
  std::vector<std::size_t> begin;
  for (int r = 0; r <= ranks_.size(); ++r) begin.push_back(r * words * sizeof(std::uint64_t));
  std::uint64_t* const own = bits.data() + words * ranks_.rank();
  for (Index i = 0; i < bed.n; ++i) {
    const auto cell = static_cast<std::size_t>(grid.index(bed.grain.data()[i].x));
    own[cell / 64] |= std::uint64_t{1} << (cell % 64);
  }
  ranks_.gather(bits.data(), begin);

  for (int r = 0; r < ranks_.rank(); ++r) {
    const CellSet theirs(grid, bits.data() + words * r);
    const Index their_first = bed.order.begin_of(bed.part.first_chunks[r]);
    Parcel parcel;
    std::vector<Bed::Ghost> ghosts;
    for (Index i = 0; i < bed.n; ++i)
      if (theirs.has_near(bed.grain.data()[i].x))
        ghosts.push_back(
            {bed.grain.data()[i], bed.part.first + i - their_first, bed.part_of[i], bed.material_of(i)});
    parcel.put_list(ghosts);
    parcel.send(ranks_, r);
  }
  std::vector<Bed::Ghost> ghosts;
  later_.clear();
  for (int r = ranks_.rank() + 1; r < ranks_.size(); ++r) {
    const auto first = static_cast<Index>(ghosts.size());
    Parcel::from(ranks_, r).add_to(ghosts);
    later_.push_back(
        {.rank = r, .first_ghost = bed.n + first, .ghosts = static_cast<Index>(ghosts.size()) - first});
  }
  bed.set_ghosts(ghosts);
}

std::vector<Outgoing> Traffic::keep_ghosts(Bed& bed) {
  std::vector<Index> row(bed.nobody() + 1, -1);  // by the old one
  for (const Chunk& chunk : bed.chunks)
    for (const Candidate& c : chunk.candidates[1])
      if (c.j >= bed.n) row[c.j] = 0;
  std::vector<Bed::Ghost> kept;
  for (Later& l : later_) {
    const Index first = l.first_ghost, end = l.first_ghost + l.ghosts;
    l.first_ghost = bed.n + static_cast<Index>(kept.size());
    for (Index old = first; old < end; ++old) {
      if (row[old] < 0) continue;
      row[old] = bed.n + static_cast<Index>(kept.size());
      kept.push_back({bed.grain.data()[old], bed.number(old), bed.part_of[old], bed.material_of(old)});
    }
    l.ghosts = bed.n + static_cast<Index>(kept.size()) - l.first_ghost;
  }
  for (Chunk& chunk : bed.chunks)
    for (Candidate& c : chunk.candidates[1])
      if (c.j >= bed.n) c.j = row[c.j];
  bed.set_ghosts(kept);

  // Their owners are told which rows to send, and what links come to them.
  const Index first_chunk = bed.part.first_chunk();
  for (const Later& l : later_) {
    std::vector<Index> wanted;
    const Index other = bed.part.first_chunks[l.rank],
                other_first = bed.order.begin_of(other) - bed.part.first;
    for (Index i = l.first_ghost; i < l.first_ghost + l.ghosts; ++i)
      wanted.push_back(bed.number(i) - other_first);
    std::vector<Outgoing> links;
    for (const Chunk& chunk : bed.chunks)
      for (const Outgoing& out : chunk.outgoing)
        if (const Index to = first_chunk + out.to; to >= other && to < bed.part.first_chunks[l.rank + 1])
          links.push_back({to - other, out.size});
    Parcel parcel;
    parcel.put_list(wanted), parcel.put_list(links);
    parcel.send(ranks_, l.rank);
  }
  std::erase_if(later_, [](const Later& l) { return l.ghosts == 0; });
  earlier_.clear();
  std::vector<Outgoing> from_others;
  for (int r = 0; r < ranks_.rank(); ++r) {
    Parcel parcel = Parcel::from(ranks_, r);
    Earlier e{.rank = r, .first_link = static_cast<Index>(from_others.size())};
    parcel.add_to(e.wanted), parcel.add_to(from_others);
    e.links = static_cast<Index>(from_others.size()) - e.first_link;
    if (!e.wanted.empty()) earlier_.push_back(std::move(e));
  }
  return from_others;
}

}  // namespace moraine::dem::cpu
