// Files that are written once and read back whole. Their first 512 bytes, which HDF5 leaves to the user (its
// user block), are lines of text, then line feeds:
//   moraine sha256 DIGEST     of all bytes after this line: `tail -c +81 FILE | sha256sum`
//   KIND FORMAT               such as checkpoint 5
//   bytes SIZE                of the whole file
// HDF5 believes what it reads, and hangs or crashes on damage: it sees the bytes only after the digest was
// found right.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "error.hpp"

namespace moraine::output {

// What was written is gone, or is not what the disk gives back: an older copy may serve instead.
class Damaged : public Error {
  using Error::Error;
};

constexpr std::size_t seal_size = 512;

// Fills in the first 512 bytes of a file of such a size.
void seal(std::string& bytes, const std::string& kind, std::int64_t format);

struct Sealed {
  std::string kind;  // none where the file has no seal
  std::int64_t format = 0;
  std::string bytes;  // without a seal the first of them only
};
// SHA-256 of a file's bytes. Throws Error where it cannot be read.
std::string digest_of_file(const std::filesystem::path& path);

// As the first lines say, unproved; none where the file has no seal or cannot be read.
std::string kind_of(const std::filesystem::path& path);
// Throws Damaged, or Error where the file cannot be opened.
Sealed read_sealed(const std::filesystem::path& path);

}  // namespace moraine::output
