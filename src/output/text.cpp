#include "output/aside.hpp"
#include "output/files.hpp"

namespace moraine::output {

void write_text(const std::filesystem::path& path, std::string_view text) {
  Aside file(path);
  file.write(text);
  file.put_in_place();
}

}  // namespace moraine::output
