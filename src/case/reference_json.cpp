// `moraine keys --format json`: the tables of the reference for programs, such as the one that makes the
// manual.
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "case/case.hpp"
#include "case/keys.hpp"
#include "output/files.hpp"

namespace moraine::cases {
namespace {

using std::string;
using Members = std::vector<std::pair<string, string>>;  // name and text

string json(const string& text) {
  string out = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20) {
      char code[8];
      std::snprintf(code, sizeof code, "\\u%04x", c);
      out += code;
      continue;
    }
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

string object(const Members& members) {
  std::vector<string> parts;
  for (const auto& [name, text] : members) parts.push_back(json(name) + ": " + json(text));
  return "{" + join(parts, ", ") + "}";
}

// Of water, of a pressed box, of histories: what a case must have for the column to be there.
string needs(std::size_t column) {
  if (column < output::dry_columns) return "";
  return column < output::side_columns    ? "pore water"
         : column < output::asked_columns ? "a pressed box"
                                          : "loads that change";
}

}  // namespace

string reference_as_json() {
  std::vector<string> of_keys, of_series;
  for (const Key& key : keys())
    of_keys.push_back(object({{"name", key.name},
                              {"type", name_of(key.type)},
                              {"unit", key.unit},
                              {"default", key.fallback},
                              {"accepts", key.accepts},
                              {"meaning", key.meaning},
                              {"kinds", key.kinds}}));
  for (std::size_t c = 0; c < output::columns().size(); ++c) {
    const auto& [name, units, meaning] = output::columns()[c];
    of_series.push_back(object({{"name", name}, {"unit", units}, {"meaning", meaning}, {"needs", needs(c)}}));
  }
  return "{\"keys\": [\n" + join(of_keys, ",\n") + "\n],\n\"series\": [\n" + join(of_series, ",\n") +
         "\n]}\n";
}

}  // namespace moraine::cases
