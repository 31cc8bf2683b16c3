// Whether two states have the same bits.
#pragma once
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <vector>

#include "dem/state.hpp"

namespace moraine::dem {

// Every number of the two states, bit by bit.
inline void expect_same_bits(const State& a, const State& b) {
  const auto same = [](const auto& p, const auto& q, const char* name) {
    ASSERT_EQ(p.size(), q.size()) << name;
    using T = std::decay_t<decltype(p[0])>;
    for (std::size_t k = 0; k < p.size(); ++k)
      ASSERT_EQ(std::memcmp(&p[k], &q[k], sizeof(T)), 0) << name << "[" << k << "] differs";
  };
  same(a.id, b.id, "id"), same(a.r, b.r, "r"), same(a.part_of, b.part_of, "part_of");
  same(a.x, b.x, "x"), same(a.v, b.v, "v"), same(a.omega, b.omega, "omega");
  same(a.rotation, b.rotation, "rotation"), same(a.force, b.force, "force"),
      same(a.torque, b.torque, "torque");
  same(a.x_start, b.x_start, "x_start"), same(a.material, b.material, "material");
  same(a.contacts, b.contacts, "contacts");
  const auto members = [](const std::vector<WallContact>& contacts) {  // without what lies between them
    std::vector<std::array<double, 12>> out;
    for (const auto& [i, wall, s] : contacts) {
      const Vec3d &d = s.delta_t, &v = s.v_before, &f = s.f_viscous;
      out.push_back({double(i), double(wall), d.x, d.y, d.z, s.slipping, v.x, v.y, v.z, f.x, f.y, f.z});
    }
    return out;
  };
  same(members(a.wall_contacts), members(b.wall_contacts), "wall_contacts");
  const auto numbers = [](const State& s) {
    const Ledger& l = s.ledger;
    return std::vector<double>{l.slip, l.viscous, l.planes, l.layers};
  };
  same(a.bodies, b.bodies, "bodies"), same(numbers(a), numbers(b), "ledger");
  EXPECT_EQ(a.step, b.step);
  EXPECT_EQ(a.staggered, b.staggered);
}

}  // namespace moraine::dem
