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

// Joins its arguments into an Error: `throw error("grain ", i, " left the box at step ", n);`
template <class... Parts>
Error error(const Parts&... parts) {
  std::ostringstream text;
  text.precision(9);
  (text << ... << parts);
  return Error(text.str());
}

}  // namespace moraine
