// Files that are written once and read back whole. Their first 512 bytes, which HDF5 leaves to the user (its
// user block), are lines of text, then line feeds:
//   moraine sha256 DIGEST     of all bytes after this line: `tail -c +81 FILE | sha256sum`
//   KIND FORMAT               such as checkpoint 5
//   bytes SIZE                of the whole file
// HDF5 believes what it reads, and hangs or crashes on damage: it opens a file only after the digest was
// found right. Digests are taken over blocks of bytes as they come by, so that no file has to fit into
// memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "error.hpp"
#include "output/aside.hpp"

namespace moraine::output {

// What was written is gone, or is not what the disk gives back: an older copy may serve instead.
class Damaged : public Error {
  using Error::Error;
};

constexpr std::size_t seal_size = 512;

// Fills in the first 512 bytes of a file.
void seal(Aside& file, const std::string& kind, std::int64_t format);

struct Sealed {
  std::string kind;  // none where the file has no seal
  std::int64_t format = 0;
  std::string first;  // bytes of a file without a seal: a million, or all
};
// SHA-256 of a file's bytes. Throws Error where it cannot be read.
std::string digest_of_file(const std::filesystem::path& path);

// As the first lines say, unproved; none where the file has no seal or cannot be read.
std::string kind_of(const std::filesystem::path& path);
// What the seal says, once all bytes were found to be those that were sealed. Throws Damaged, or Error where
// the file cannot be opened.
Sealed check_seal(const std::filesystem::path& path);

}  // namespace moraine::output
