#include "output/sealed.hpp"

#include <fcntl.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string_view>

namespace moraine::output {
namespace {

constexpr std::string_view mark = "moraine sha256 ";
constexpr std::size_t first_line = mark.size() + 64 + 1;

std::string digest_of(std::string_view bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
  unsigned size = 0;
  if (!EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr))
    throw error("libcrypto has no SHA-256");
  std::string text;
  for (unsigned k = 0; k < size; ++k)
    for (const int digit : {digest[k] >> 4, digest[k] & 15}) text += "0123456789abcdef"[digit];
  return text;
}

class Reader {
 public:
  explicit Reader(const std::filesystem::path& path)
      // Not waiting: a pipe in the file's place would never be written to.
      : path_(path.string()), file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
    const std::string why = std::string(": cannot open the file: ") + std::strerror(errno);
    if (file_ < 0 && errno == ENOENT) throw Damaged(path_ + why);
    if (file_ < 0) throw Error(path_ + why);
    if (::fstat(file_, &about_) != 0 || !S_ISREG(about_.st_mode)) {
      ::close(file_);
      throw error(path_, ": not a file", S_ISDIR(about_.st_mode) ? " but a directory" : "");
    }
  }
  ~Reader() { ::close(file_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  std::uint64_t size() const { return static_cast<std::uint64_t>(about_.st_size); }
  // So many bytes more, or all there are.
  void append_to(std::string& bytes, std::uint64_t count) const {
    const std::size_t before = bytes.size();
    bytes.resize(before + std::min<std::uint64_t>(count, size() - before));
    for (std::size_t at = before; at < bytes.size();) {
      const ssize_t got = ::read(file_, bytes.data() + at, bytes.size() - at);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) throw Damaged(path_ + ": cannot read: " + std::strerror(errno));
      if (got == 0) throw Damaged(path_ + ": damaged: was cut short while it was read");
      at += static_cast<std::size_t>(got);
    }
  }

 private:
  std::string path_;
  int file_;
  struct stat about_ {};
};

}  // namespace

std::string digest_of_file(const std::filesystem::path& path) {
  const Reader file(path);
  std::string bytes;
  file.append_to(bytes, file.size());
  return digest_of(bytes);
}

void seal(std::string& bytes, const std::string& kind, std::int64_t format) {
  std::string rest = kind + " " + std::to_string(format) + "\nbytes " + std::to_string(bytes.size()) + "\n";
  rest.resize(seal_size - first_line, '\n');
  bytes.replace(first_line, rest.size(), rest);
  const std::string digest = digest_of(std::string_view(bytes).substr(first_line));
  bytes.replace(0, first_line, std::string(mark) + digest + "\n");
}

std::string kind_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string head(seal_size, '\0');
  file.read(head.data(), seal_size);
  if (!head.starts_with(mark)) return {};
  std::istringstream words(head.substr(first_line));
  std::string kind;
  words >> kind;
  return kind;
}

Sealed read_sealed(const std::filesystem::path& path) {
  const Reader file(path);
  Sealed out;
  file.append_to(out.bytes, seal_size);
  if (!out.bytes.starts_with(mark)) {
    file.append_to(out.bytes, 1 << 20);
    return out;
  }
  std::istringstream words(out.bytes.substr(std::min(first_line, out.bytes.size())));
  std::string kind, size_name;
  std::uint64_t size = 0;
  const bool readable = words >> kind >> out.format >> size_name >> size && size_name == "bytes";
  // A size on the disk that the file does not claim is not read at all: it may be anything.
  if (readable && file.size() != size)
    throw Damaged(path.string() + ": damaged: " + (file.size() < size ? "truncated, " : "") +
                  std::to_string(file.size()) + " bytes where it had " + std::to_string(size));
  if (readable) file.append_to(out.bytes, size);
  const std::string_view all = out.bytes;
  if (!readable || all.substr(mark.size(), 64) != digest_of(all.substr(first_line)) ||
      all[first_line - 1] != '\n')
    throw Damaged(path.string() + ": damaged: its SHA-256 is not the one that it was written with");
  out.kind = kind;
  return out;
}

}  // namespace moraine::output
