// Sorting changes where grains stand in memory, nothing else.
#include "dem/memory_order.hpp"

#include <numeric>

#include "backends.hpp"
#include "physics/same_bits.hpp"
#include "physics/scenes.hpp"

namespace moraine::dem {
namespace {

// Rows dealt at random; contacts follow.
State shuffled(const State& s) {
  std::vector<Index> from(s.size());
  std::iota(from.begin(), from.end(), 0);
  std::shuffle(from.begin(), from.end(), std::mt19937_64(4));
  State out = s;
  std::vector<Index> place(s.size());
  for (Index k = 0; k < s.size(); ++k) {
    const Index i = from[k];
    place[i] = k;
    out.id[k] = s.id[i], out.r[k] = s.r[i], out.x[k] = s.x[i], out.v[k] = s.v[i], out.omega[k] = s.omega[i];
    out.rotation[k] = s.rotation[i], out.force[k] = s.force[i], out.torque[k] = s.torque[i];
    out.x_start[k] = s.x_start[i], out.part_of[k] = s.part_of[i];
  }
  for (Contact& c : out.contacts) {
    c.i = place[c.i], c.j = place[c.j];
    if (c.i > c.j) std::swap(c.i, c.j), c.spring.delta_t = -c.spring.delta_t;
  }
  std::sort(out.contacts.begin(), out.contacts.end(),
            [](const Contact& a, const Contact& b) { return std::pair(a.i, a.j) < std::pair(b.i, b.j); });
  for (WallContact& w : out.wall_contacts) w.i = place[w.i];
  std::sort(out.wall_contacts.begin(), out.wall_contacts.end(),
            [](const WallContact& a, const WallContact& b) {
              return std::pair(a.wall, a.i) < std::pair(b.wall, b.i);
            });
  return out;
}

// By the state alone: any order of rows gives the same one.
TEST(Order, DependsOnTheStateAlone) {
  Bed bed = sheared_bed();
  bed.state = run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, 300);
  State a = bed.state, b = shuffled(bed.state);
  EXPECT_NE(b.id, a.id);
  sort_spatially(bed.scene, a), sort_spatially(bed.scene, b);
  expect_same_bits(a, b);
  EXPECT_GT(a.contacts.size(), 100u);
  sort_spatially(bed.scene, b);  // sorting what is sorted changes nothing
  expect_same_bits(a, b);
}

TEST(Order, WrapsIntoTheBoxWithTheStartingPoint) {
  Bed bed = cloud(50, 0.1, 2);
  State moved = bed.state;
  for (Index i = 0; i < moved.size(); ++i) {
    const Vec3d shift{0.1 * (i % 3 - 1), 0.1 * (i % 5 - 2), 0.2};
    moved.x[i] += shift, moved.x_start[i] += shift + Vec3d{0.01, 0, 0};
  }
  sort_spatially(bed.scene, moved);
  for (Index i = 0; i < moved.size(); ++i) {
    for (int a = 0; a < 3; ++a) EXPECT_TRUE(moved.x[i][a] >= 0 && moved.x[i][a] < 0.1);
    EXPECT_LT(length(moved.x[i] - moved.x_start[i] + Vec3d{0.01, 0, 0}), 1e-15);
  }
}

// Where chunks have spread through each other, and there alone; positions stay as they are.
TEST(Order, RenewsWhatIsLost) {
  Bed bed = sheared_bed();
  bed.state = run(*make_engine(Backend::cpu, 1), bed.scene, bed.state, 300);
  State good = bed.state;
  sort_spatially(bed.scene, good);
  State s = good;
  EXPECT_FALSE(renew_order(bed.scene, s, 1.25));
  expect_same_bits(s, good);

  s = shuffled(good);
  s.x[0] += Vec3d{bed.scene.box.x, 0, 0};  // one box further
  s.water_force = s.torque;
  std::vector<Vec3d> also = s.x;
  EXPECT_TRUE(renew_order(bed.scene, s, 1.25, &also));
  EXPECT_TRUE(also == s.x);
  EXPECT_TRUE(s.water_force == s.torque);
  const auto further = std::ranges::count_if(s.x, [&](const Vec3d& x) { return x.x >= bed.scene.box.x; });
  EXPECT_EQ(further, 1);
  s.water_force.clear();
  sort_spatially(bed.scene, s);  // which wraps
  for (Index i = 0; i < s.size(); ++i) EXPECT_LT(length(s.x[i] - good.x[i]), 1e-14);
  s.x = good.x, s.x_start = good.x_start;
  expect_same_bits(s, good);

  s.x[3].y = std::nan("");
  EXPECT_FALSE(renew_order(bed.scene, s, -1));
}

class OrderOnBackends : public OnEveryBackend {};

// Forces follow the ids, springs turn round with their pairs: the same course in any order, to rounding.
TEST_P(OrderOnBackends, KeepsThePhysics) {
  const auto engine = make();
  Bed bed = sheared_bed();
  bed.state = run(*engine, bed.scene, bed.state, 300);
  const State plain = run(*engine, bed.scene, bed.state, 50);
  const State other = run(*engine, bed.scene, shuffled(bed.state), 50);
  std::vector<Index> row(plain.size());
  for (Index k = 0; k < other.size(); ++k) row[other.id[k]] = k;
  double largest = 0;
  for (const Vec3d& f : plain.force) largest = std::max(largest, length(f));
  for (Index i = 0; i < plain.size(); ++i) {
    const Index k = row[plain.id[i]];
    EXPECT_LT(length(other.force[k] - plain.force[i]), 1e-9 * largest);
    EXPECT_LT(length(other.x[k] - plain.x[i]), 1e-13);
  }
  EXPECT_EQ(plain.contacts.size(), other.contacts.size());
}

ON_EVERY_BACKEND(OrderOnBackends);

}  // namespace
}  // namespace moraine::dem
