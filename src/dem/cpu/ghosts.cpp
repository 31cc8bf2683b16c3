// The part of Traffic that a search has: which grains of other ranks a rank must know.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <list>

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

// Calls use(cell) for it and those beside it, until that returns true.
template <class Use>
void around(const CellGrid& grid, const std::array<std::int32_t, 3>& at, Use&& use) {
  std::int32_t low[3], high[3];
  for (int a = 0; a < 3; ++a) {
    const bool periodic = grid.sides.side[a] > 0;
    low[a] = periodic ? at[a] - 1 : std::max(at[a] - 1, 0);
    high[a] = periodic ? at[a] + 1 : std::min(at[a] + 1, grid.n[a] - 1);
  }
  const auto wrapped = [&](int a, std::int32_t c) { return (c + grid.n[a]) % grid.n[a]; };
  for (std::int32_t z = low[2]; z <= high[2]; ++z)
    for (std::int32_t y = low[1]; y <= high[1]; ++y)
      for (std::int32_t x = low[0]; x <= high[0]; ++x)
        if (use((wrapped(2, z) * grid.n[1] + wrapped(1, y)) * grid.n[0] + wrapped(0, x))) return;
}

class CellSet {
 public:
  CellSet(const CellGrid& grid, const std::uint64_t* bits) : grid_(grid), bits_(bits) {}
  bool has(std::int32_t cell) const { return bits_[cell / 64] >> (cell % 64) & 1; }
  // Whether it has the grain's cell or one beside it.
  bool has_near(const Vec3d& x) const {
    bool found = false;
    around(grid_, {grid_.along(0, x.x), grid_.along(1, x.y), grid_.along(2, x.z)},
           [&](std::int32_t cell) { return found = has(cell); });
    return found;
  }

 private:
  const CellGrid& grid_;
  const std::uint64_t* bits_;
};

// With the cells beside them.
std::vector<std::uint64_t> grown(const CellGrid& grid, const std::uint64_t* bits, std::size_t words) {
  std::vector<std::uint64_t> out(words);
  const CellSet cells(grid, bits);
  for (std::int32_t z = 0, cell = 0; z < grid.n[2]; ++z)
    for (std::int32_t y = 0; y < grid.n[1]; ++y)
      for (std::int32_t x = 0; x < grid.n[0]; ++x, ++cell)
        if (cells.has(cell))
          around(grid, {x, y, z}, [&](std::int32_t c) {
            out[c / 64] |= std::uint64_t{1} << (c % 64);
            return false;
          });
  return out;
}

}  // namespace

void Traffic::fetch_ghosts(Bed& bed) {
  finish();
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

  // Ranks that have no cell beside one of its own share no pairs with it; both see that.
  const std::vector<std::uint64_t> beside = grown(grid, own, words);
  const auto is_near = [&](int r) {
    const std::uint64_t* const theirs = bits.data() + words * r;
    for (std::size_t w = 0; w < words; ++w)
      if (beside[w] & theirs[w]) return true;
    return false;
  };
  std::list<Parcel> parcels;  // each rank sends before it receives, so none may wait for another meanwhile
  earlier_.clear();
  for (int r = 0; r < ranks_.rank(); ++r) {
    if (!is_near(r)) continue;
    earlier_.push_back({.rank = r});
    const CellSet theirs(grid, bits.data() + words * r);
    const Index their_first = bed.order.begin_of(bed.part.first_chunks[r]);
    std::vector<Bed::Ghost> ghosts;
    for (Index i = 0; i < bed.n; ++i)
      if (theirs.has_near(bed.grain.data()[i].x))
        ghosts.push_back(
            {bed.grain.data()[i], bed.part.first + i - their_first, bed.part_of[i], bed.material_of(i)});
    parcels.emplace_back().put_list(ghosts);
    parcels.back().post(ranks_, r);
  }
  std::vector<Bed::Ghost> ghosts;
  later_.clear();
  for (int r = ranks_.rank() + 1; r < ranks_.size(); ++r) {
    if (!is_near(r)) continue;
    const auto first = static_cast<Index>(ghosts.size());
    Parcel::from(ranks_, r).add_to(ghosts);
    later_.push_back(
        {.rank = r, .first_ghost = bed.n + first, .ghosts = static_cast<Index>(ghosts.size()) - first});
  }
  for (Parcel& parcel : parcels) parcel.wait(ranks_);
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
  std::list<Parcel> parcels;
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
    Parcel& parcel = parcels.emplace_back();
    parcel.put_list(wanted), parcel.put_list(links);
    parcel.post(ranks_, l.rank);
  }
  std::erase_if(later_, [](const Later& l) { return l.ghosts == 0; });
  std::vector<Outgoing> from_others;
  for (Earlier& e : earlier_) {
    Parcel parcel = Parcel::from(ranks_, e.rank);
    e.first_link = static_cast<Index>(from_others.size());
    parcel.add_to(e.wanted), parcel.add_to(from_others);
    e.links = static_cast<Index>(from_others.size()) - e.first_link;
  }
  std::erase_if(earlier_, [](const Earlier& e) { return e.wanted.empty(); });
  for (Parcel& parcel : parcels) parcel.wait(ranks_);
  return from_others;
}

}  // namespace moraine::dem::cpu
