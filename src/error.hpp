// The one exception of the program: a message for a person, that names what, where and what would be right.
#pragma once
#include <sstream>
#include <stdexcept>
#include <string>

namespace moraine {

class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Joins its arguments: numbers with up to nine digits.
template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream joined;
  joined.precision(9);
  (joined << ... << parts);
  return joined.str();
}

// Into an Error: `throw error("grain ", i, " left the box at step ", n);`
template <class... Parts>
Error error(const Parts&... parts) {
  return Error(text(parts...));
}

}  // namespace moraine
