#include "memory.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <new>
#include <stdexcept>

#include "error.hpp"

namespace moraine {

namespace {

// The limits of the control groups that this process is in, version 2 or 1, and of those above them.
void take_control_groups(Memory& least) {
  std::ifstream list("/proc/self/cgroup");
  for (std::string line; std::getline(list, line);) {  // 0::/user.slice, 4:memory:/job
    const auto first = line.find(':'), second = line.find(':', first + 1);
    if (second == line.npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const bool unified = controllers.empty();
    if (!unified && controllers.find("memory") == controllers.npos) continue;
    const std::string root = unified ? "/sys/fs/cgroup" : "/sys/fs/cgroup/memory";
    for (std::filesystem::path group = line.substr(second + 1);; group = group.parent_path()) {
      std::ifstream file(root + group.string() + (unified ? "/memory.max" : "/memory.limit_in_bytes"));
      if (double bytes; file >> bytes && bytes < least.bytes) least = {bytes, "limit of the control group"};
      if (!group.has_relative_path()) break;
    }
  }
}

}  // namespace

Memory memory_there() {
  Memory least{static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE)),
               "all of this machine"};
  take_control_groups(least);
  for (const auto resource : {RLIMIT_AS, RLIMIT_DATA})
    if (rlimit limit; getrlimit(resource, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
      if (const auto bytes = static_cast<double>(limit.rlim_cur); bytes < least.bytes)
        least = {bytes, "limit set by ulimit"};
  return least;
}

std::string in_gb(double bytes) {
  char text[32];
  std::snprintf(text, sizeof text, bytes < 9.995e11 ? "%.3g GB" : "%.0f GB", bytes / 1e9);
  return text;
}

void expect_memory(double bytes, const std::string& prefix, const std::string& hint) {
  const Memory there = memory_there();
  if (bytes <= there.bytes) return;
  throw error(prefix, " need about ", in_gb(bytes), " of memory, and there are ", in_gb(there.bytes), " (",
              there.what, ")", hint);
}

std::string in_words(const std::exception& e) {
  if (!dynamic_cast<const std::bad_alloc*>(&e) && !dynamic_cast<const std::length_error*>(&e))
    return e.what();
  const Memory there = memory_there();
  return "memory ran out: there are " + in_gb(there.bytes) + " (" + there.what +
         "), shared with what else runs; expected fewer grains (grains.count), a coarser grid of the pore "
         "water "
         "(fluid.cell), or fewer runs at once";
}

}  // namespace moraine
