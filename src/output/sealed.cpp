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
#include <memory>
#include <sstream>
#include <string_view>

namespace moraine::output {
namespace {

constexpr std::string_view mark = "moraine sha256 ";
constexpr std::size_t first_line = mark.size() + 64 + 1;

constexpr std::size_t block = 1 << 20;

// SHA-256 of bytes that come one after the other.
class Digest {
 public:
  Digest() : context_(EVP_MD_CTX_new()) { expect(EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr)); }
  void add(std::string_view bytes) { expect(EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size())); }
  std::string text() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
    unsigned size = 0;
    expect(EVP_DigestFinal_ex(context_.get(), digest.data(), &size));
    std::string text;
    for (unsigned k = 0; k < size; ++k)
      for (const int digit : {digest[k] >> 4, digest[k] & 15}) text += "0123456789abcdef"[digit];
    return text;
  }

 private:
  static void expect(int done) {
    if (done != 1) throw error("libcrypto has no SHA-256");
  }
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context_;
};

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
  // So many bytes more, or all that are left.
  std::string next(std::uint64_t count) {
    std::string bytes(std::min(count, size() - read_), '\0');
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t got = ::read(file_, bytes.data() + at, bytes.size() - at);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) throw Damaged(path_ + ": cannot read: " + std::strerror(errno));
      if (got == 0) throw Damaged(path_ + ": damaged: was cut short while it was read");
      at += static_cast<std::size_t>(got);
    }
    read_ += bytes.size();
    return bytes;
  }
  void add_rest_to(Digest& digest) {
    while (read_ < size()) digest.add(next(block));
  }

 private:
  std::string path_;
  int file_;
  struct stat about_ {};
  std::uint64_t read_ = 0;
};

}  // namespace

std::string digest_of_file(const std::filesystem::path& path) {
  Reader file(path);
  Digest digest;
  file.add_rest_to(digest);
  return digest.text();
}

void seal(Aside& file, const std::string& kind, std::int64_t format) {
  const std::uint64_t size = file.size();
  std::string rest = kind + " " + std::to_string(format) + "\nbytes " + std::to_string(size) + "\n";
  rest.resize(seal_size - first_line, '\n');
  Digest digest;
  digest.add(rest);
  std::string bytes;
  for (std::uint64_t at = seal_size; at < size; at += bytes.size()) {
    bytes.resize(std::min<std::uint64_t>(block, size - at));
    file.read(at, bytes.data(), bytes.size());
    digest.add(bytes);
  }
  file.overwrite(0, std::string(mark) + digest.text() + "\n" + rest);
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

Sealed check_seal(const std::filesystem::path& path) {
  Reader file(path);
  Sealed out;
  const std::string head = file.next(seal_size);
  if (!head.starts_with(mark)) {
    out.first = head + file.next(block);
    return out;
  }
  const std::string_view rest = std::string_view(head).substr(std::min(first_line, head.size()));
  std::istringstream words{std::string(rest)};
  std::string kind, size_name;
  std::uint64_t size = 0;
  const bool readable = words >> kind >> out.format >> size_name >> size && size_name == "bytes";
  // A size on the disk that the file does not claim is not read at all: it may be anything.
  if (readable && file.size() != size)
    throw Damaged(path.string() + ": damaged: " + (file.size() < size ? "truncated, " : "") +
                  std::to_string(file.size()) + " bytes where it had " + std::to_string(size));
  Digest digest;
  digest.add(rest);
  if (readable) file.add_rest_to(digest);
  if (!readable || head.substr(mark.size(), 64) != digest.text() || head[first_line - 1] != '\n')
    throw Damaged(path.string() + ": damaged: its SHA-256 is not the one that it was written with");
  out.kind = kind;
  return out;
}

}  // namespace moraine::output
