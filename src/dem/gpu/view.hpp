// Everything a step on the GPU reads and writes, as plain pointers; [2]: for even and odd steps.
#pragma once
#include "dem/control.hpp"
#include "dem/gpu/tally.hpp"
#include "dem/sums.hpp"

namespace moraine::dem::gpu {

// Aligned for loads of 16 bytes.
struct alignas(16) SpringRow : Spring<double> {};

struct GatherView {
  Scene scene;
  Sides sides;
  Index n;
  ContactOrder order;  // chunks and materials
  double margin;       // m
  TallyLayout tallies;
  GrainRow* grain[2];
  LoadRow* load;          // of the last step of a launch; with a layer driven by stress, of each
  const WaterRow* water;  // of the last exchange; null without pore water
  const BodyId* part_of;
  const std::int64_t* row;
  const Index* neighbour;
  SpringRow *spring, *plane_spring;  // the latter by grain, then plane
  Tally* tally[2];                   // by group
  Tally* chunk_tally[2];             // where blocks have whole chunks
  Control* control;

  MORAINE_HD Material material(Index i) const { return order.material ? order.material[i] : Material::grain; }
  MORAINE_HD Index chunks() const { return (n + order.chunk - 1) / order.chunk; }
  MORAINE_HD Index groups() const { return (n + group_size - 1) / group_size; }
  MORAINE_HD Index chunk_groups() const { return order.chunk / group_size; }
  // The groups of a chunk: from c * chunk_groups(), so many.
  MORAINE_HD Index groups_of(Index c) const {
    const Index left = groups() - c * chunk_groups();
    return left < chunk_groups() ? left : chunk_groups();
  }
};

}  // namespace moraine::dem::gpu
