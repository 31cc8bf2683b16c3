// What a part of a contact law has beside its formulas. A part stands in a header of its own in this folder;
// laws.hpp puts parts together.
//
//   Parameters   doubles by name, as in case.toml and the checkpoint:  list() of Named
//   Memory<T>    what a contact remembers from step to step:  list() of Named. Vectors (Vec3<T>) are of i
//   against j and
//                change sign where these change places; numbers (T) do not
//   keeps(p)     whether it remembers anything with these parameters; else its memory is zero between stages
#pragma once
#include <tuple>

#include "dem/vec3.hpp"

namespace moraine::dem {

template <class Struct, class Value>
struct Named {
  const char* name;
  Value Struct::*member;
};
template <class Struct, class Value>
Named(const char*, Value Struct::*) -> Named<Struct, Value>;

// For parts that remember nothing: struct Cohesion : WithoutMemory<Cohesion>.
template <class Part>
struct WithoutMemory {
  template <class T>
  struct Memory {
    static constexpr auto list() { return std::tuple{}; }
  };
  template <class P>
  static bool keeps(const P&) {
    return false;
  }
};

// use(name, member of a, member of b), for two structs with the same list.
template <class A, class B, class Use>
void for_each_named(A& a, B& b, Use&& use) {
  std::apply(
      [&](const auto&... of_a) {
        std::apply([&](const auto&... of_b) { (use(of_a.name, a.*of_a.member, b.*of_b.member), ...); },
                   std::remove_const_t<B>::list());
      },
      std::remove_const_t<A>::list());
}

}  // namespace moraine::dem
