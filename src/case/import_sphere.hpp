// Takes over a bed that the program `sphere` has left: its binary files of version 1.03 to 2.15,
// little-endian.
#pragma once
#include <filesystem>

namespace moraine::cases {

// Writes case_dir/start.h5 (the grains) and case_dir/case.toml (what the file says about box and contacts,
// and two stages to begin with). Throws Error where the file is damaged or case_dir already holds a case.
void import_sphere(const std::filesystem::path& bin, const std::filesystem::path& case_dir);

}  // namespace moraine::cases
