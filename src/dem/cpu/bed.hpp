// What the CPU's engine keeps: rows of grains, dealt into chunks, and the links between chunks.
//
// A chunk has one owner at a time (a thread), who alone writes its grains and its lists. Pairs belong to the
// chunk of their lower grain. So a chunk's grains are read only by itself and by earlier chunks, and links,
// from an earlier chunk to a later one, are the only traffic between owners: rows of grains one way, and the
// other way the shares of pairs across chunks, in slots that the later chunk collects in a fixed order
// (sums.hpp).
//
// Where several ranks share a bed, each has a stretch of its chunks. Grains of later ranks that its pairs
// need are its ghosts: copies, whose rows come behind its own. Links to and from other ranks are messages
// (traffic.hpp).
#pragma once
#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include "backend/host.hpp"
#include "dem/body/motion.hpp"
#include "dem/cpu/pair_list.hpp"
#include "dem/sums.hpp"
#include "dem/uses.hpp"
#include "ranks/ranks.hpp"

namespace moraine::dem::cpu {

// What of a bed a rank has, and what it must know of the whole.
struct Part {
  Ranks* ranks = nullptr;           // null: there are no others
  Index first = 0, all = 0;         // the first of its grains, and how many all ranks have
  std::vector<Index> first_chunks;  // of each rank, and one after the last
  double r_max = 0;                 // m, as the next two; see scene_check.hpp
  double margin = 0, widest_margin = 0;

  Index first_chunk() const { return ranks ? first_chunks[ranks->rank()] : 0; }
  int rank_of_chunk(Index chunk) const {
    return static_cast<int>(std::upper_bound(first_chunks.begin(), first_chunks.end(), chunk) -
                            first_chunks.begin()) -
           1;
  }
  static Part whole(const Scene& scene, const State& state);
};

// A pair within the neighbour margin, from which near pairs are drawn.
struct Candidate {
  Index i, j;
  Index link;   // for pairs across chunks: which of the chunk's
  Index place;  // in the near list, or not_near
};
constexpr Index not_near = -1, no_link = -1;

struct PlanePair {
  Index i;
  std::int32_t plane;  // in BodyMotion
  Spring<double> spring;
  bool touched = true;  // at the step before; true also where that is not known
};

// A vector in a row of its own.
struct alignas(32) WayRow {
  Vec3d x;  // m
  double unused;
};

// Slots for the pairs from one chunk to another, which may be another rank's: chunks are counted from the
// first of this rank, -1 is any of an earlier rank.
struct Link {
  Index from, to;
  Index first, used = 0, size = 0;  // in slots
};

// What a chunk's search finds of one.
struct Outgoing {
  Index to, size;
};

struct GrainPair {
  Index i, j;  // i < j
};
using FoundPairs = std::map<Index, std::vector<GrainPair>>;  // by the chunk of i

struct alignas(64) Chunk {
  Index number, begin, end;
  int owner = 0;
  std::vector<Candidate> candidates[2];  // inside the chunk, across
  PairList near[2], spare;
  WatchList watched[2];           // candidates that are not near
  double near_margin;             // m, of the near pairs
  double near_until = 0;          // m, Control::travelled up to which no pair can touch that is not watched
  double apart_until = 0;         // m, the same up to which no pair that is watched can touch
  int steps_near = 0;             // since they were drawn
  std::int64_t times_drawn = 0;   // since the search
  std::vector<PlanePair> planes;  // within the neighbour margin, sorted by grain, then plane
  std::vector<Index> incoming;    // links, by the chunk they come from
  Index first_link = 0;           // its own links are this one and the next ones,
  std::vector<Outgoing> outgoing;
  FoundPairs found;                                     // by its search
  std::vector<Index> finders;                           // chunks that have found pairs of this one
  std::array<std::vector<Index>, most_servos> members;  // its grains in each servo's layer
  Index lost = -1;                                      // a grain that went wrong
  bool needs_ghosts = false;                            // has pairs with grains of later ranks,
  bool has_ghosts = false;                              // has grains that are in pairs of earlier ranks

  // What all threads read after a step. Two, for even and odd steps: a thread may be at the next step
  // already while another still reads.
  struct alignas(64) Tally {
    Reaction reaction;
    Dissipation lost;                // in the step
    double fastest2[3] = {0, 0, 0};  // largest v^2 by component
    double ways2[2] = {0, 0};        // the two largest squares of ways since the search, where measured
  } tally[2];
  const Tally& at(std::int64_t step) const { return tally[step & 1]; }
  Tally& at(std::int64_t step) { return tally[step & 1]; }
};

// What a step of the chunk takes, in near pairs: a grain to be moved is some 0.3 of them.
inline double work_of(const Chunk& c) {
  return 0.3 * (c.end - c.begin) + static_cast<double>(c.near[0].count + c.near[1].count);
}

struct Bed {
  Scene scene;
  Sides sides;
  Uses uses;
  Part part;
  Index n = 0;                      // grains of this rank
  std::vector<Index> ghost_number;  // of each ghost, counted from this rank's first grain; they rise
  double r_max = 0, margin = 0;     // m; of the candidates
  ContactOrder order{1};
  std::vector<Chunk> chunks;
  std::vector<Link> links;
  std::vector<Chunk::Tally> tallies[2];  // of all ranks' chunks, as Chunk::at; empty where it has all chunks
  std::vector<BodyId> part_of;           // with ghosts, as the next two
  std::vector<Material> material;        // as State has it
  Host::Array<GrainRow> grain;           // then one that never touches
  Host::Array<WayRow> searched;          // where grains were at the last search
  double plane_searched[most_planes];
  Host::Array<LoadRow> load;  // of the last step of advance()
  Host::Array<LoadRow> slot;  // the first one is for lanes without a pair
  Host::Array<Index> slot_owner;
  Host::Array<WaterRow> water;  // with pore water only: at the last exchange, for state()

  Material material_of(Index i) const {
    return material.empty() ? Material::grain : material[static_cast<std::size_t>(i)];
  }
  // A grain's number, which ghosts have whatever their row; order and chunks are by it.
  Index number(Index row) const { return row < n ? row : ghost_number[static_cast<std::size_t>(row - n)]; }
  Index ghosts() const { return static_cast<Index>(ghost_number.size()); }
  Index nobody() const { return n + ghosts(); }  // the row of the one that never touches

  // Grains and springs of a state; neither lists nor links. Contacts of a part have numbers of grains of
  // later ranks beyond its own, whose rows are `ghosts`, or else those numbers and materials alone.
  void load_state(const Scene& s, const State& state, const Part& of, const BodyMotion& bodies);
  // Rows behind its own are these from now on.
  struct Ghost {
    GrainRow row;
    Index number;
    BodyId part_of;
    Material material;
  };
  void set_ghosts(const std::vector<Ghost>& ghosts);
};

// use(tally) of each chunk of the whole bed, in their order.
template <class Use>
void for_each_tally(const Bed& bed, std::int64_t step, Use&& use) {
  if (!bed.part.ranks)
    for (const Chunk& chunk : bed.chunks) use(chunk.at(step));
  else
    for (const Chunk::Tally& tally : bed.tallies[step & 1]) use(tally);
}

// Sums over the bed.
Reaction sum_reactions(const Bed& bed, const BodyMotion& bodies);
Dissipation sum_dissipation(const Bed& bed, std::int64_t step);
// Of the present step, which the motion will add up only when it comes to it; the same sums in the same
// order. On all ranks together.
Dissipation pending_dissipation(const Bed& bed);
// What each chunk's grains have moved since the search, into its tally of the step; and from these a bound,
// m, on how far any two bodies have come closer to each other.
void measure_ways(const Bed& bed, Chunk& chunk, std::int64_t step);
double approach_since_search(const Bed& bed, const BodyMotion& bodies);
// A bound on the speed of anything, m/s.
double fastest(const Bed& bed, const BodyMotion& bodies);

// Throws Error where a grain is lost.
void check_lost(const Bed& bed, const BodyMotion& bodies, const std::vector<Index>& id);

}  // namespace moraine::dem::cpu
