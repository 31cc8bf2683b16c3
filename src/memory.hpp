// How much memory a run may take, so that one that is too large is refused in words before it begins.
#pragma once
#include <exception>
#include <string>

namespace moraine {

struct Memory {
  double bytes;
  std::string what;  // "of this machine"
};
// The least of physical memory, what a control group allows, and what `ulimit` does.
Memory memory_there();

std::string in_gb(double bytes);  // "25.3 GB"

// Throws Error where so much is not there: "PREFIX need about 4400 GB of memory, and there are 25.3 GB (...)
// HINT".
void expect_memory(double bytes, const std::string& prefix, const std::string& hint);

// What the exception says, or a plain sentence where memory ran out.
std::string in_words(const std::exception& e);

}  // namespace moraine
