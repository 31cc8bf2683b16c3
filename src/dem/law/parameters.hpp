// The parameters of a contact law belong to its parts, each of which lists its own by name: what the
// checkpoint keeps. Most parts stand in one header each in this folder; laws.hpp puts them together.
#pragma once
#include <tuple>

namespace moraine::dem {

template <class Part>
struct Parameter {
  const char* name;  // as in case.toml and the checkpoint
  double Part::*value;
};

}  // namespace moraine::dem
