// Neighbour lists against a search of all pairs.
#include "dem/neighbours.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

#include "dem/touching.hpp"

#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

struct Case {
  Vec3d box;
  bool periodic_x, periodic_y, periodic_z;
  Index n;
  double r_min, r_max;
};

void expect_all_pairs(const Case& c, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
  };
  Scene s;
  s.box = c.box;
  s.periodic_x = c.periodic_x, s.periodic_y = c.periodic_y, s.periodic_z = c.periodic_z;
  std::vector<GrainRow> grains(c.n);
  for (GrainRow& g : grains) {  // some well outside the box: within a stage nothing is wrapped
    g = {};
    for (int a = 0; a < 3; ++a) g.x[a] = uniform(-1.5, 2.5) * c.box[a];
    g.r = g.r_again =
        std::exp(uniform(std::log(c.r_min), std::log(c.r_max)));  // as many in each class of sizes
  }
  const std::vector<BodyId> part_of(c.n, BodyId::none);
  const double margin = 0.1 * c.r_max;
  const Sides sides = Sides::of(s);
  const ContactOrder order{chunk_size(c.n)};
  Neighbours<Host> lists;
  lists.build(Host{}, s, grains.data(), part_of.data(), c.n, margin);
  std::int64_t total = 0;
  for (Index i = 0; i < c.n; ++i) {
    std::vector<Index> expected;
    for (Index j = 0; j < c.n; ++j) {
      const Vec3d d = nearest_image(sides, grains[i].x - grains[j].x);
      if (j != i && length(d) < grains[i].r + grains[j].r + margin) expected.push_back(j);
    }
    std::sort(expected.begin(), expected.end(), [&](Index a, Index b) { return order.before(i, a, b); });
    const std::vector<Index> row(lists.neighbour.data() + lists.row.data()[i],
                                 lists.neighbour.data() + lists.row.data()[i + 1]);
    ASSERT_EQ(row, expected) << "grain " << i;
    total += static_cast<std::int64_t>(row.size());
  }
  EXPECT_EQ(lists.total, total);

  std::map<std::array<Index, 2>, double> touching, found;
  for (Index i = 0; i < c.n; ++i)
    for (Index j = i + 1; j < c.n; ++j) {
      const Vec3d d = nearest_image(sides, grains[i].x - grains[j].x);
      const double reach = grains[i].r + grains[j].r;
      if (dot(d, d) < reach * reach) touching[{i, j}] = reach - std::sqrt(dot(d, d));
    }
  TouchingPairs().each(s, grains.data(), c.n, [&](Index i, Index j, double overlap) {
    EXPECT_TRUE(found.insert({{std::min(i, j), std::max(i, j)}, overlap}).second)
        << i << ' ' << j << " twice";
  });
  if (c.n >= 40) {
    EXPECT_GT(touching.size(), 0u);
  }
  EXPECT_EQ(found, touching);

  CloseGrains close;
  close.sort(Host{}, s, grains.data(), c.n, margin);
  std::set<std::array<Index, 2>> expected, near;
  for (Index i = 0; i < c.n; ++i)
    for (Index j = i + 1; j < c.n; ++j)
      if (length(nearest_image(sides, grains[i].x - grains[j].x)) < grains[i].r + grains[j].r + margin)
        expected.insert({i, j});
  for (Index i = 0; i < c.n; ++i) {
    ASSERT_EQ(close.grain(close.place(i)), i);
    close.after(close.place(i), margin, [&](Index k, double, double) {
      const Index j = close.grain(k);
      EXPECT_TRUE(near.insert({std::min(i, j), std::max(i, j)}).second) << i << ' ' << j << " twice";
    });
  }
  EXPECT_EQ(near, expected);
}

TEST(Neighbours, RefuseWhatIsNoPlace) {
  Scene s;
  s.box = {1, 1, 1};
  for (const Index n : {1, 300, 2000})
    for (const Index at : {0, n / 3, n - 1})
      for (const double wrong : {std::nan(""), HUGE_VAL}) {
        std::vector<GrainRow> grains(n, GrainRow{});
        for (GrainRow& g : grains) g.x = {0.5, 0.5, 0.5}, g.r = 0.01;
        grains[at].x.y = wrong;
        EXPECT_THROW(TouchingPairs().each(s, grains.data(), n, [](Index, Index, double) {}), Error);
      }
}

TEST(Neighbours, AllPairs) {
  const double r = 0.01;
  const Case cases[] = {
      {{0.3, 0.3, 0.3}, true, true, true, 800, r, r},               // many cells
      {{0.3, 0.3, 0.3}, true, true, false, 800, r, r},              // open above
      {{0.3, 0.3, 0.3}, false, false, false, 800, r, r},            // open
      {{0.3, 0.3, 0.3}, true, true, true, 600, 0.1 * r, 2 * r},     // 1:20
      {{0.5, 0.5, 0.5}, true, true, false, 900, 0.05 * r, 5 * r},   // 1:100
      {{0.3, 0.3, 0.3}, false, true, false, 900, 1e-5 * r, 2 * r},  // more than there are levels for
      {{0.044, 0.066, 0.088}, true, true, true, 100, r, r},         // 2, 3 and 4 cells
      {{0.042, 0.042, 0.042}, true, true, true, 40, r, r},          // the smallest box allowed
      {{0.042, 0.3, 1}, true, true, false, 500, 0.5 * r, r},
      {{1, 1, 1}, true, true, true, 30, r, r},  // more cells than grains
      {{0.1, 0.1, 0.1}, true, true, true, 1, r, r},
  };
  for (const Case& c : cases)
    for (const std::uint64_t seed : {1, 2}) {
      SCOPED_TRACE(testing::Message()
                   << "box " << c.box.x << " " << c.box.y << " " << c.box.z << ", seed " << seed);
      expect_all_pairs(c, seed);
    }
}

TEST(Neighbours, OneGrainFarOff) {
  Scene s;
  s.box = {0.1, 0.1, 0.1};
  std::vector<GrainRow> grains(3);
  grains[0] = {{0.05, 0.05, 0.01}, 0.01, {}, 0.01, {}, 0, {}, 0};
  grains[1] = {{0.05, 0.05, 0.029}, 0.01, {}, 0.01, {}, 0, {}, 0};
  grains[2] = {{0.05, 0.05, 1e12}, 0.01, {}, 0.01, {}, 0, {}, 0};
  Neighbours<Host> lists;
  lists.build(Host{}, s, grains.data(), std::vector<BodyId>(3, BodyId::none).data(), 3, 1e-3);
  EXPECT_EQ(lists.total, 2);  // one pair, in both rows
}

}  // namespace
}  // namespace moraine::dem
