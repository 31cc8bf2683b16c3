#include "dem/memory_order.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "dem/grain.hpp"
#include "dem/sums.hpp"

namespace moraine::dem {

namespace {

constexpr Index leaf = 4;  // grains that are close enough in any order

// As j sees it.
void turn_round(Spring<double>& spring) {
  const auto turn = [](const char*, auto& value, const auto&) {
    if constexpr (std::is_same_v<std::remove_reference_t<decltype(value)>, Vec3d>) value = Vec3d{} - value;
  };
  MoreParts::for_each_memory([&]<class Part>() {
    typename Part::template Memory<double>& memory = spring;
    for_each_named(memory, memory, turn);
  });
}

class Halving {
 public:
  Halving(const Sides& sides, const State& state) : sides_(sides), state_(state) {}

  // Orders the grains [begin, end) of the list.
  void operator()(Index* begin, Index* end, Index chunk) const {
    const auto n = static_cast<Index>(end - begin);
    if (n <= leaf) return;
    const Index whole = n > chunk ? (n / 2 + chunk / 2) / chunk * chunk : n / 2;
    Index* const middle = begin + std::clamp<Index>(whole, 1, n - 1);
    const int axis = longest(begin, end);
    std::nth_element(begin, middle, end, [&](Index a, Index b) {
      return std::pair(state_.x[a][axis], state_.id[a]) < std::pair(state_.x[b][axis], state_.id[b]);
    });
    (*this)(begin, middle, chunk), (*this)(middle, end, chunk);
  }

 private:
  // A cut across a periodic side has two faces while the part goes all the way round. Where both would have
  // about as many grains beside them, the open side it is: then fewer chunks are next to another thread's.
  int longest(const Index* begin, const Index* end) const {
    int axis = 0;
    double most = -1;
    for (int a = 0; a < 3; ++a) {
      double low = state_.x[*begin][a], high = low;
      for (const Index* i = begin; i != end; ++i)
        low = std::min(low, state_.x[*i][a]), high = std::max(high, state_.x[*i][a]);
      double length = high - low;
      if (length > 0.9 * sides_.side[a] && sides_.side[a] > 0) length *= 0.4;
      if (length > most) axis = a, most = length;
    }
    return axis;
  }

  const Sides& sides_;
  const State& state_;
};

}  // namespace

void sort_spatially(const Scene& scene, State& s) {
  const Index n = s.size();
  const Sides sides = Sides::of(scene);
  for (Index i = 0; i < n; ++i)
    for (int a = 0; a < 3; ++a)
      if (sides.side[a] > 0) {
        const double shift = sides.side[a] * std::floor(s.x[i][a] * sides.inverse[a]);
        s.x[i][a] -= shift, s.x_start[i][a] -= shift;
      }

  std::vector<Index> order(n), place(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return s.id[a] < s.id[b]; });
  Halving{sides, s}(order.data(), order.data() + n, chunk_size(n));
  for (Index k = 0; k < n; ++k) place[order[k]] = k;

  const auto permute = [&](auto& v) {
    auto sorted = v;
    for (Index k = 0; k < n; ++k) sorted[k] = v[order[k]];
    v = std::move(sorted);
  };
  permute(s.id), permute(s.r), permute(s.x), permute(s.v), permute(s.omega), permute(s.rotation);
  permute(s.force), permute(s.torque), permute(s.x_start), permute(s.part_of);
  if (!s.material.empty()) permute(s.material);
  for (Contact& c : s.contacts) {
    c.i = place[c.i], c.j = place[c.j];
    if (c.i > c.j) std::swap(c.i, c.j), turn_round(c.spring);
  }
  for (WallContact& w : s.wall_contacts) w.i = place[w.i];
  sort_contacts(s);
}

void sort_contacts(State& s) {
  std::sort(s.contacts.begin(), s.contacts.end(),
            [](const Contact& a, const Contact& b) { return std::tie(a.i, a.j) < std::tie(b.i, b.j); });
  std::sort(s.wall_contacts.begin(), s.wall_contacts.end(), [](const WallContact& a, const WallContact& b) {
    return std::tie(a.wall, a.i) < std::tie(b.wall, b.i);
  });
}

}  // namespace moraine::dem
