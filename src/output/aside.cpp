#include "output/aside.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "error.hpp"

namespace moraine::output {

Aside::Aside(std::filesystem::path path) : path_(std::move(path)), aside_(path_.string() + ".tmp") {
  file_ = ::open(aside_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  check(file_ >= 0, "create the file");
}

Aside::~Aside() {
  if (!in_place_) {
    // A library that could not close it would keep what is in it, also without a name.
    [[maybe_unused]] const int emptied = ::ftruncate(file_, 0);
    ::unlink(aside_.c_str());
  }
  ::close(file_);
}

void Aside::check(bool done, const char* action) const {
  if (!done) throw error(path_.string(), ": cannot ", action, ": ", std::strerror(errno));
}

std::uint64_t Aside::size() const {
  struct stat about {};
  check(::fstat(file_, &about) == 0, "read back");
  return static_cast<std::uint64_t>(about.st_size);
}

void Aside::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    check(written >= 0, "write");
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void Aside::overwrite(std::uint64_t at, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (written < 0 && errno == EINTR) continue;
    check(written >= 0, "write");
    bytes.remove_prefix(static_cast<std::size_t>(written)), at += static_cast<std::uint64_t>(written);
  }
}

void Aside::read(std::uint64_t at, char* bytes, std::size_t count) const {
  while (count > 0) {
    const ssize_t got = ::pread(file_, bytes, count, static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    check(got >= 0, "read back");
    if (got == 0) throw error(path_.string(), ": cannot read back: was cut short while it was written");
    bytes += got, count -= static_cast<std::size_t>(got), at += static_cast<std::uint64_t>(got);
  }
}

void Aside::put_in_place(const std::filesystem::path& before) {
  check(::fsync(file_) == 0, "write");
  if (!before.empty() && std::rename(path_.c_str(), before.c_str()) < 0)
    check(errno == ENOENT, "rename the file that stood there");
  if (std::rename(aside_.c_str(), path_.c_str()) < 0) {
    const int cause = errno;
    if (!before.empty()) std::rename(before.c_str(), path_.c_str());
    errno = cause;
    check(false, "replace the file");
  }
  in_place_ = true;

  // The rename outlives a power cut only once the directory is on disk; some file systems cannot be asked.
  const std::filesystem::path directory = path_.has_parent_path() ? path_.parent_path() : ".";
  if (const int parent = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); parent >= 0) {
    ::fsync(parent);
    ::close(parent);
  }
}

}  // namespace moraine::output
