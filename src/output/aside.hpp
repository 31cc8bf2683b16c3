// A file that is written beside its place and put there once the disk has all of it: what the disk refuses,
// or a kill, cannot leave half a file, nor touch the one that stood there.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string_view>

namespace moraine::output {

class Aside {
 public:
  // Opens PATH.tmp, empty. All members throw Error, "PATH: cannot ACTION: CAUSE" (disk full, permission).
  explicit Aside(std::filesystem::path path);
  ~Aside();  // removes it, and gives its room back, unless it was put in its place
  Aside(const Aside&) = delete;
  Aside& operator=(const Aside&) = delete;

  const std::filesystem::path& path() const { return path_; }   // its place
  const std::filesystem::path& file() const { return aside_; }  // where it is until then
  std::uint64_t size() const;                                   // bytes
  void write(std::string_view bytes);                           // after those written so
  void overwrite(std::uint64_t at, std::string_view bytes);
  void read(std::uint64_t at, char* bytes, std::size_t count) const;

  // Waits until the disk has it, and renames it. What stood there becomes BEFORE, where given; between two
  // renames PATH is missing for a moment. After an error what stood there stands there still.
  void put_in_place(const std::filesystem::path& before = {});

 private:
  void check(bool done, const char* action) const;
  std::filesystem::path path_, aside_;
  int file_ = -1;
  bool in_place_ = false;
};

}  // namespace moraine::output
