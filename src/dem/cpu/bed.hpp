// What the CPU's engine keeps: rows of grains, dealt into chunks, and the links between chunks.
//
// A chunk has one owner at a time (a thread), who alone writes its grains and its lists. Pairs belong to the
// chunk of their lower grain. So a chunk's grains are read only by itself and by earlier chunks, and links,
// from an earlier chunk to a later one, are the only traffic between owners: rows of grains one way, and the
// other way the shares of pairs across chunks, in slots that the later chunk collects in a fixed order
// (sums.hpp).
#pragma once
#include <array>
#include <map>
#include <vector>

#include "backend/host.hpp"
#include "dem/body/motion.hpp"
#include "dem/cpu/pair_list.hpp"
#include "dem/sums.hpp"
#include "dem/uses.hpp"

namespace moraine::dem::cpu {

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

// Slots for the pairs from one chunk to another.
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
  std::map<Index, std::vector<GrainPair>> found;        // by its search, by the chunk of i
  std::vector<Index> finders;                           // chunks that have found pairs of this one
  std::array<std::vector<Index>, most_servos> members;  // its grains in each servo's layer
  Index lost = -1;                                      // a grain that went wrong

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

struct Bed {
  Scene scene;
  Sides sides;
  Uses uses;
  Index n = 0;
  double r_max = 0, margin = 0;  // m; of the candidates
  ContactOrder order{1};
  std::vector<Chunk> chunks;
  std::vector<Link> links;
  Host::Array<BodyId> part_of;
  std::vector<Material> material;  // as State has it
  Host::Array<GrainRow> grain;     // n grains, then one that never touches
  Host::Array<WayRow> searched;    // where grains were at the last search
  double plane_searched[most_planes];
  Host::Array<LoadRow> load;  // of the last step of advance()
  Host::Array<LoadRow> slot;  // the first one is for lanes without a pair
  Host::Array<Index> slot_owner;
  Host::Array<WaterRow> water;  // with pore water only: at the last exchange, for state()

  Material material_of(Index i) const {
    return material.empty() ? Material::grain : material[static_cast<std::size_t>(i)];
  }
  // Grains and springs of a state; neither lists nor links.
  void load_state(const Scene& s, const State& state, const BodyMotion& bodies);
};

// Sums over the bed.
Reaction sum_reactions(const Bed& bed, const BodyMotion& bodies);
Dissipation sum_dissipation(const Bed& bed, std::int64_t step);
// Of the present step, which the motion will add up only when it comes to it; the same sums in the same
// order.
Dissipation pending_dissipation(const Bed& bed);
// What each chunk's grains have moved since the search, into its tally of the step; and from these a bound,
// m, on how far any two bodies have come closer to each other.
void measure_ways(const Bed& bed, Chunk& chunk, std::int64_t step);
double approach_since_search(const Bed& bed, const BodyMotion& bodies);
// A bound on the speed of anything, m/s.
double fastest(const Bed& bed, const BodyMotion& bodies);

// Throws Error where a grain is lost.
void check_lost(Bed& bed, const BodyMotion& bodies, const std::vector<Index>& id);

}  // namespace moraine::dem::cpu
