#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "error.hpp"
#include "output/files.hpp"

namespace moraine::output {

void write_text(const std::filesystem::path& path, std::string_view text,
                const std::filesystem::path& before) {
  const std::filesystem::path aside = path.string() + ".tmp";
  int file = -1;
  const auto check = [&](auto result, const char* action) {
    if (result >= 0) return;
    const int cause = errno;
    if (file >= 0) {
      ::close(file);
      ::unlink(aside.c_str());
    }
    throw error(path.string(), ": cannot ", action, ": ", std::strerror(cause));
  };

  check(file = ::open(aside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666), "create the file");
  while (!text.empty()) {
    const ssize_t written = ::write(file, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    check(written, "write");
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  check(::fsync(file), "write");
  if (!before.empty() && std::rename(path.c_str(), before.c_str()) < 0 && errno != ENOENT)
    check(-1, "rename the file that stood there");
  if (std::rename(aside.c_str(), path.c_str()) < 0) {
    const int cause = errno;
    if (!before.empty()) std::rename(before.c_str(), path.c_str());
    errno = cause;
    check(-1, "replace the file");
  }
  ::close(file);

  // The rename outlives a power cut only once the directory is on disk; some file systems cannot be asked.
  const std::filesystem::path directory = path.has_parent_path() ? path.parent_path() : ".";
  if (const int parent = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); parent >= 0) {
    ::fsync(parent);
    ::close(parent);
  }
}

}  // namespace moraine::output
