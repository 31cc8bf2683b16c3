// Samples for round trips, with doubles of every sign and size, so that a lost bit shows; and what tests of
// files share.
#pragma once
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include "error.hpp"
#include "output/files.hpp"

namespace moraine::output {

class RandomNumbers {
 public:
  double operator()() {
    for (;;) {
      const double number = std::bit_cast<double>(bits_());
      if (std::isfinite(number)) return number;
    }
  }
  dem::Vec3d vector() { return {(*this)(), (*this)(), (*this)()}; }
  Row row() {
    std::array<double, sizeof(Row) / sizeof(double)> numbers;
    for (double& number : numbers) number = (*this)();
    return std::bit_cast<Row>(numbers);
  }

 private:
  std::mt19937_64 bits_{2013};
};

inline bool same_bits(const Row& a, const Row& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

inline dem::State random_state(RandomNumbers& number, dem::Index n) {
  dem::State s;
  const auto spring = [&](double slipping) {
    dem::Spring<double> all;
    dem::for_each_named(all, all, [&](const char*, auto& value, const auto&) {
      if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, double>)
        value = number();
      else
        value = number.vector();
    });
    all.slipping = slipping;
    return all;
  };
  for (dem::Index k = 0; k < n; ++k) {
    s.id.push_back((k + n / 2) % n);
    s.r.push_back(number());
    for (auto* list : {&s.x, &s.v, &s.omega, &s.rotation, &s.force, &s.torque, &s.x_start}) {
      list->push_back(number.vector());
    }
    s.part_of.push_back(static_cast<dem::BodyId>(k % 3));
    if (k > 0) s.contacts.push_back({k - 1, k, spring(k % 2)});
    s.wall_contacts.push_back({k, dem::BodyId::floor, spring(1)});
  }
  if (n > 0) s.wall_contacts.push_back({0, dem::BodyId::top_wall, spring(0)});
  for (dem::BodyState& body : s.bodies) body = {number.vector(), number.vector(), number.vector()};
  for (double* value : {&s.ledger.slip, &s.ledger.viscous, &s.ledger.planes, &s.ledger.layers}) {
    *value = number();
  }
  s.step = (std::int64_t{1} << 53) + 1;
  s.staggered = true;
  return s;
}

inline std::string contents(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// What an Error says, or nothing if there is none.
template <class F>
std::string message(F f) {
  try {
    f();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != text.npos;
}

}  // namespace moraine::output
