// case.toml as it stands after `extends`, `stages` and --set: every value typed, in SI, within its range, and
// with the place it came from. What depends on several keys is checked in case.cpp.
#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "case/keys.hpp"

namespace moraine::cases {

struct Entry {
  Value value;
  std::string stated;  // for messages: "cases/x/case.toml:14: contact.mu_s = 0.3"
};
inline const std::string by_set = "--set ";    // how `stated` begins where an override has set the value
using Entries = std::map<std::string, Entry>;  // by name in the table of keys

// One of the tables of a list: a stage, a material, a pair of these ("quartz-clay").
struct StageDraft {
  std::string name;
  std::string stated;  // "cases/x/case.toml:20: stage.shear", where it first appears
  Entries entries;
};

struct Draft {
  Entries entries;
  std::vector<StageDraft> stages, materials, pairs;

  std::vector<StageDraft>& list(const std::string& table) {  // "stage"
    return table == "stage" ? stages : table == "material" ? materials : pairs;
  }
};

// Throws Error, see case.hpp. text: what is to be the case.toml of that directory, in place of the file.
Draft read(const std::filesystem::path& directory, const std::vector<Override>& overrides,
           const std::string* text = nullptr);

// One value as TOML, as if it stood in case.toml. name: "contact.k_n", "stage.shear.strain"; kind: of the
// stage, or empty. Throws Error with that name: "contact.k_n = -1.0: expected > 0 N/m".
Value read_value(const std::string& name, const std::string& toml, const std::string& kind = "");

Draft read_resolved_case(const std::filesystem::path& directory, const std::string& text);

// All keys of a resolved case, by full name ("stage.shear.f"), as they stand there, and its "stages".
std::map<std::string, std::string> read_resolved(const std::string& text);

// The value of a default written in the table of keys.
Value parse_default(const Key& key, const std::string& toml);

}  // namespace moraine::cases
