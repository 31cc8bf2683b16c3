// The one table of the keys of case.toml. A row says what a key is called, its unit, default and range, what
// it means and which member of Case or Stage it fills; reading, checking, defaults and `moraine keys` all
// follow it.
#pragma once
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "case/case.hpp"
#include "case/load.hpp"

namespace moraine::cases {

using Value = std::variant<double, std::int64_t, bool, std::string, std::vector<std::string>, Load>;

struct Key {
  enum class Type { number, integer, boolean, text, choice, path, list, load };  // load: see load.hpp
  std::string name;  // "contact.k_n"; keys of a stage are "stage...."
  Type type;
  std::string unit;      // SI
  std::string fallback;  // TOML, or the name of the key it is taken from; "0; settle, consolidate: 1e4" by
                         // kind of stage
  std::string accepts;   // "> 0", ">= 1", "1 .. 10"; "this | that" makes a choice,
                         // ">= 0 | auto" a number or that word
  std::string meaning;
  std::string kinds;                                     // the kinds of stage it belongs to; empty: all
  void (*set)(const Key&, Case&, Stage&, const Value&);  // null: merging uses it up
  // What it decides: a run may go on with another value of what is no physics. `records` are physics with
  // model.dt = "auto", whose steps fit the times of records.
  enum class Decides { physics, records, nothing };
  Decides decides = Decides::physics;

  std::string table() const { return name.substr(0, name.find('.') + 1); }  // "contact.", or ""
};

// Whether a file may have many of these tables, each headed by its name in double brackets.
bool is_list_of_tables(const std::string& table);  // "stage"

inline const std::string required = "(required)";  // a `fallback`

const std::vector<Key>& keys();            // a default refers only to rows above its own
const Key* find(const std::string& name);  // null: no such key

// The word that may stand for a number ("auto" in ">= 0 | auto"); empty where there is none.
std::string word_of(const Key& key);
std::string or_word(const Key& key);  // for errors: `, or "auto"`

// "none: it belongs to kind shear, and this stage is settle"; empty where stages of that kind have the key.
std::string not_of_kind(const Key& key, const std::string& kind);

// Throws Error with what was expected.
void check_range(const Key& key, const Value& value);

// "did you mean contact.mu_s?", or the keys of that table where nothing is near; `shown` stands for the
// table's name where that is another ("stage.shear.").
std::string suggestion(const std::string& unknown_key, const std::string& shown = "");
// The nearest of the known words; empty where none is near.
std::string nearest(const std::string& word, const std::vector<std::string>& known);

std::vector<std::string> split(const std::string& text, const std::string& separator);
std::string join(const std::vector<std::string>& parts, const std::string& separator);
std::string to_toml(const Value& value);  // numbers in the fewest digits that give back the same bits

}  // namespace moraine::cases
