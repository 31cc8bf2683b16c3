#include "dem/memory_order.hpp"

#include <algorithm>
#include <cmath>
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
  Halving(const Sides& sides, const std::vector<Vec3d>& x, const std::vector<Index>& id)
      : sides_(sides), x_(x), id_(id) {}

  // Orders the grains [begin, end) of the list.
  void operator()(Index* begin, Index* end, Index chunk) const {
    const auto n = static_cast<Index>(end - begin);
    if (n <= leaf) return;
    const Index whole = n > chunk ? (n / 2 + chunk / 2) / chunk * chunk : n / 2;
    Index* const middle = begin + std::clamp<Index>(whole, 1, n - 1);
    const int axis = longest(begin, end);
    std::nth_element(begin, middle, end, [&](Index a, Index b) {
      return std::pair(x_[a][axis], id_[a]) < std::pair(x_[b][axis], id_[b]);
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
      double low = x_[*begin][a], high = low;
      for (const Index* i = begin; i != end; ++i)
        low = std::min(low, x_[*i][a]), high = std::max(high, x_[*i][a]);
      double length = high - low;
      if (length > 0.9 * sides_.side[a] && sides_.side[a] > 0) length *= 0.4;
      if (length > most) axis = a, most = length;
    }
    return axis;
  }

  const Sides& sides_;
  const std::vector<Vec3d>& x_;  // m, in the box
  const std::vector<Index>& id_;
};

struct Order {
  std::vector<Index> row;    // by new place
  std::vector<Index> place;  // by present row
};

// m, whole boxes that a place is away along periodic sides.
Vec3d boxes_beyond(const Sides& sides, const Vec3d& x) {
  Vec3d shift{0, 0, 0};
  for (int a = 0; a < 3; ++a)
    if (sides.side[a] > 0) shift[a] = sides.side[a] * std::floor(x[a] * sides.inverse[a]);
  return shift;
}

// x: m, in the box.
Order spatial_order(const Sides& sides, const std::vector<Vec3d>& x, const std::vector<Index>& id) {
  const auto n = static_cast<Index>(x.size());
  Order order{std::vector<Index>(n), std::vector<Index>(n)};
  std::iota(order.row.begin(), order.row.end(), 0);
  std::sort(order.row.begin(), order.row.end(), [&](Index a, Index b) { return id[a] < id[b]; });
  Halving{sides, x, id}(order.row.data(), order.row.data() + n, chunk_size(n));
  for (Index k = 0; k < n; ++k) order.place[order.row[k]] = k;
  return order;
}

void take(const Order& order, State& s, std::vector<Vec3d>* also = nullptr) {
  const auto permute = [&](auto& v) {
    if (v.empty()) return;
    auto sorted = v;
    for (std::size_t k = 0; k < v.size(); ++k) sorted[k] = v[order.row[k]];
    v = std::move(sorted);
  };
  permute(s.id), permute(s.r), permute(s.x), permute(s.v), permute(s.omega), permute(s.rotation);
  permute(s.force), permute(s.torque), permute(s.water_force), permute(s.x_start), permute(s.part_of);
  permute(s.material);
  if (also) permute(*also);
  for (Contact& c : s.contacts) {
    c.i = order.place[c.i], c.j = order.place[c.j];
    if (c.i > c.j) std::swap(c.i, c.j), turn_round(c.spring);
  }
  for (WallContact& w : s.wall_contacts) w.i = order.place[w.i];
  sort_contacts(s);
}

}  // namespace

void sort_spatially(const Scene& scene, State& s) {
  const Sides sides = Sides::of(scene);
  for (Index i = 0; i < s.size(); ++i) {
    const Vec3d shift = boxes_beyond(sides, s.x[i]);
    s.x[i] -= shift, s.x_start[i] -= shift;
  }
  take(spatial_order(sides, s.x, s.id), s);
}

bool renew_order(const Scene& scene, State& s, double lost, std::vector<Vec3d>* also) {
  const Sides sides = Sides::of(scene);
  std::vector<Vec3d> x = s.x;
  for (Vec3d& at : x) {
    at -= boxes_beyond(sides, at);
    if (!std::isfinite(at.x + at.y + at.z)) return false;  // for others to tell
  }
  const Order order = spatial_order(sides, x, s.id);
  const Index chunk = chunk_size(s.size());
  std::int64_t across = 0, across_anew = 0;
  for (const Contact& c : s.contacts) {
    across += c.i / chunk != c.j / chunk;
    across_anew += order.place[c.i] / chunk != order.place[c.j] / chunk;
  }
  if (!(static_cast<double>(across) > lost * static_cast<double>(across_anew))) return false;
  take(order, s, also);
  return true;
}

void sort_contacts(State& s) {
  std::sort(s.contacts.begin(), s.contacts.end(),
            [](const Contact& a, const Contact& b) { return std::tie(a.i, a.j) < std::tie(b.i, b.j); });
  std::sort(s.wall_contacts.begin(), s.wall_contacts.end(), [](const WallContact& a, const WallContact& b) {
    return std::tie(a.wall, a.i) < std::tie(b.wall, b.i);
  });
}

}  // namespace moraine::dem
