// The order of every sum, in one place: what makes a result independent of threads, blocks and, in time,
// ranks.
//
//   contacts of a grain   those within its chunk, those with later chunks, those with earlier ones, chunk by
//                         chunk; each by pair of materials, then by index
//   a chunk               its groups of 32 grains one after the other, each added up by itself first
//   the bed               its chunks one after the other
//
// Grains are dealt into chunks by memory order; how many depends on the number of grains alone. A pair
// belongs to the chunk of its lower grain. Every sum over grains of a chunk is a sum over groups, so that a
// GPU can do many groups at a time.
#pragma once
#include <algorithm>

#include "dem/state.hpp"

namespace moraine::dem {

inline Index chunk_size(Index grains) {
  const Index sixteenth = (grains / 16 + 63) / 64 * 64;
  return std::clamp<Index>(sixteenth, 128, 1024);
}
inline Index chunk_count(Index grains) { return (grains + chunk_size(grains) - 1) / chunk_size(grains); }

// The order in which a grain adds up its contacts.
struct ContactOrder {
  Index chunk;                         // grains in one, at most
  const Material* material = nullptr;  // of each grain; null where all are of the first

  MORAINE_HD Index chunk_of(Index i) const { return i / chunk; }
  MORAINE_HD Index begin_of(Index c) const { return c * chunk; }
  // Pairs of the other's chunk, which leave the share of i for it to collect.
  MORAINE_HD bool comes_from_earlier_chunk(Index i, Index j) const { return j < begin_of(chunk_of(i)); }
  MORAINE_HD int rank(Index i, Index j) const { return chunk_of(i) == chunk_of(j) ? 0 : j > i ? 1 : 2; }
  MORAINE_HD bool before(Index i, Index a, Index b) const {
    const int ra = rank(i, a), rb = rank(i, b);
    if (ra != rb) return ra < rb;
    if (!material) return a < b;
    if (ra == 2 && chunk_of(a) != chunk_of(b)) return a < b;
    const int pa = pair(i, a), pb = pair(i, b);
    return pa != pb ? pa < pb : a < b;
  }
  // The pair of materials of two grains: that of the lower index comes first.
  MORAINE_HD int pair(Index i, Index j) const {
    if (!material) return 0;
    return i < j ? pair_number(material[i], material[j]) : pair_number(material[j], material[i]);
  }
};

constexpr Index group_size = 32;
MORAINE_HD bool ends_group(Index i) { return (i + 1) % group_size == 0; }

// A sum over some grains of a chunk, which come by index.
class ChunkSum {
 public:
  void add(Index i, double number) {
    if (i / group_size != group_) sum_ += group_sum_, group_sum_ = 0, group_ = i / group_size;
    group_sum_ += number;
  }
  double total() const { return sum_ + group_sum_; }

 private:
  double sum_ = 0, group_sum_ = 0;
  Index group_ = 0;
};

}  // namespace moraine::dem
