#include "case/read.hpp"

#include <toml++/toml.h>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "case/units.hpp"
#include "error.hpp"

namespace moraine::cases {
namespace {

namespace fs = std::filesystem;
using std::string;
using Type = Key::Type;

// Words of an Error, behind what they are about.
template <class Action>
decltype(auto) about(const string& stated, Action&& action) {
  try {
    return action();
  } catch (const Error& e) {
    throw error(stated, ": ", e.what());
  }
}

string text_of(const toml::node& node) {
  if (const auto number = node.value_exact<double>()) return to_toml(*number);
  if (const auto words = node.value_exact<string>()) return to_toml(*words);
  std::ostringstream text;
  node.visit([&](const auto& n) { text << n; });
  return text.str();
}

std::vector<string> words(const toml::node& node) {
  std::vector<string> list;
  if (const toml::array* array = node.as_array())
    for (const toml::node& element : *array)
      if (const auto word = element.value_exact<string>()) list.push_back(*word);
  if (!node.is_array() || list.size() != node.as_array()->size())
    throw error("expected a list of texts, such as [\"settle\", \"shear\"]");
  return list;
}

double number(const Key& key, const toml::node& node) {
  const bool pure = key.unit == "1" || key.unit.empty();
  double value = 0;
  if (node.is_number())
    value = *node.value<double>();
  else if (node.is_string() && !key.unit.empty())
    value = to_si(*node.value<string>(), key.unit);
  else
    throw error("expected ", key.type == Type::integer ? "an integer" : "a number",
                pure ? "" : " in " + key.unit + ", or a text with a unit");
  if (!std::isfinite(value)) throw error("expected a finite number");
  return value + 0.0;  // no negative zero
}

// Of a list of quantities, such as ["20 kPa", "80 kPa"].
std::vector<double> numbers(const Key& key, const toml::table& table, const string& name) {
  const toml::array* array = table[name].as_array();
  if (!array) throw error(name, ": expected a list");
  std::vector<double> list;
  for (const toml::node& element : *array) list.push_back(about(name, [&] { return number(key, element); }));
  return list;
}

Load load(const Key& key, const toml::table& table) {
  Key seconds = key;
  seconds.unit = "s";
  const auto has_only = [&](const std::vector<string>& names) {
    return std::all_of(table.begin(), table.end(), [&](const auto& entry) {
      return std::find(names.begin(), names.end(), entry.first.str()) != names.end();
    });
  };
  Load out;
  History& h = out.history;
  if (const toml::node* between = table.get("interpolation")) {
    const string word = between->value_or(string());
    if (word != "linear" && word != "steps") throw error("interpolation: expected linear or steps");
    if (word == "steps") h.between = History::Between::steps;
  }
  if (table.contains("ramp") && table.contains("over") && has_only({"ramp", "over"})) {
    out.form = Load::Form::ramp;
    h.value = numbers(key, table, "ramp");
    if (h.value.size() != 2) throw error("ramp: expected two values, [from, to]");
    h.time = {0, about("over", [&] { return number(seconds, *table.get("over")); })}, h.stays = true;
    if (!(h.time[1] > 0)) throw error("over: expected > 0 s");
  } else if (table.contains("times") && table.contains("values") &&
             has_only({"times", "values", "interpolation"})) {
    out.form = Load::Form::list;
    h.time = numbers(seconds, table, "times"), h.value = numbers(key, table, "values");
    if (h.time.size() != h.value.size() || h.time.size() < 2)
      throw error(h.time.size(), " times and ", h.value.size(), " values; expected as many, two at least");
    check_times(h, [](std::size_t k) { return "times[" + std::to_string(k) + "]"; });
  } else if (table.contains("table") && has_only({"table", "interpolation"})) {
    out.form = Load::Form::table;
    out.table = table["table"].value_or(string());
    if (out.table.empty()) throw error("table: expected the name of a CSV file");
  } else {
    throw error("expected a number, ", load_forms);
  }
  return out;
}

Value convert(const Key& key, const toml::node& node) {
  switch (key.type) {
    case Type::load:
      if (const toml::table* table = node.as_table()) return load(key, *table);
      return number(key, node);
    case Type::number:
      if (const string word = word_of(key); !word.empty() && node.is_string()) {
        if (*node.value<string>() == word) return word;
        try {
          return number(key, node);
        } catch (const Error& e) {
          throw error(e.what(), or_word(key));
        }
      }
      return number(key, node);
    case Type::integer: {
      if (const auto integer = node.value_exact<std::int64_t>()) return *integer;
      const double value = number(key, node);  // 1e4 is a float to TOML
      if (value != std::floor(value) || std::abs(value) > 0x1p53) throw error("expected an integer");
      return std::int64_t(value);
    }
    case Type::boolean:
      if (!node.is_boolean()) throw error("expected true or false");
      return *node.value<bool>();
    case Type::list:
      return words(node);
    default:
      if (!node.is_string())
        throw error("expected ", key.accepts.empty() ? "a text in quotes" : "one of " + key.accepts);
      return *node.value<string>();
  }
}

Value checked(const Key& key, const toml::node& node) {
  const Value value = convert(key, node);
  check_range(key, value);
  return value;
}

// What a person types after --set: TOML, or a text without quotes. What TOML takes for a comment is no part
// of a value.
Value parse_bare(const Key& key, const string& text) {
  const bool is_text = key.type == Type::text || key.type == Type::choice || key.type == Type::path;
  if (!is_text && text.find('#') != text.npos) return checked(key, toml::value<string>(text));
  try {
    const toml::table t = toml::parse("v = " + text);
    const toml::node* node = t.get("v");
    if (node && t.size() == 1 && (!is_text || node->is_string())) return checked(key, *node);
  } catch (const toml::parse_error&) {
  }
  return checked(key, toml::value<string>(text));
}

string& text_in(Entry& entry) { return std::get<string>(entry.value); }

// A pair has no first and second.
string turned_round(const string& table, const StageDraft& draft) {
  const auto of = draft.entries.find(table + ".of");
  if (of == draft.entries.end()) return draft.name;
  const auto& names = std::get<std::vector<string>>(of->second.value);
  return names.at(1) + "-" + names.at(0);
}
std::vector<StageDraft>::iterator find_in(std::vector<StageDraft>& list, const string& table,
                                          const string& name) {
  return std::find_if(list.begin(), list.end(), [&](const StageDraft& s) {
    return s.name == name || (table == "pair" && turned_round(table, s) == name);
  });
}
// "name" of a table, or an error that lists them.
StageDraft& listed(Draft& draft, const string& table, const string& name) {
  std::vector<StageDraft>& list = draft.list(table);
  if (const auto found = find_in(list, table, name); found != list.end()) return *found;
  std::vector<string> names;
  for (const StageDraft& s : list) names.push_back(s.name);
  throw error("no ", table, " \"", name, "\"; ", table, "s: ", names.empty() ? "none" : join(names, ", "));
}
StageDraft& stage(Draft& draft, const string& name) { return listed(draft, "stage", name); }

void select_stages(Draft& draft) {
  const auto found = draft.entries.find("stages");
  if (found == draft.entries.end()) return;
  const Entry entry = found->second;
  draft.entries.erase(found);
  const auto names = std::get<std::vector<string>>(entry.value);
  if (names.empty()) return;
  std::vector<StageDraft> chosen;
  for (const string& name : names) {
    if (std::count(names.begin(), names.end(), name) > 1)
      throw error(entry.stated, ": \"", name, "\" is there twice");
    chosen.push_back(about(entry.stated, [&] { return stage(draft, name); }));
  }
  draft.stages = chosen;
}

class File {
 public:
  // text: in place of what the file holds.
  File(const fs::path& directory, const fs::path& root, const string* text = nullptr)
      : directory_(directory), root_(root) {
    if (!text && !fs::is_regular_file(path()))
      throw error(path().string(), ": not found; a case is a directory that holds a case.toml");
    try {
      table_ = text ? toml::parse(*text) : toml::parse_file(path().string());
    } catch (const toml::parse_error& e) {
      throw error(path().string(), ":", e.source().begin.line, ": ", e.description());
    }
  }

  // A resolved case of that directory.
  File(const fs::path& directory, const string& text) : directory_(directory), root_(directory) {
    try {
      table_ = toml::parse(text);
    } catch (const toml::parse_error& e) {
      throw error("the resolved case: line ", e.source().begin.line, ": ", e.description());
    }
  }

  fs::path path() const { return directory_ / "case.toml"; }

  // "" or the directory of the case that this one extends, and the words for errors about it.
  std::pair<string, string> extends() const {
    const toml::node* node = table_.get("extends");
    if (!node) return {};
    Entry entry = read(*find("extends"), "extends", *node);
    return {text_in(entry), entry.stated};
  }

  void merge_into(Draft& draft) const {
    for (const auto& [name, node] : table_) {
      const string table = string(name.str());
      if (is_list_of_tables(table))
        merge_list(table, node, draft);
      else if (table != "extends")
        merge_key(table, node, draft);
    }
    select_stages(draft);
  }

 private:
  string at(const toml::node& node) const {
    return path().string() + ":" + std::to_string(node.source().begin.line) + ": ";
  }

  Entry read(const Key& key, const string& name, const toml::node& node) const {
    Entry entry{{}, at(node) + name + " = " + text_of(node)};
    entry.value = about(entry.stated, [&] { return checked(key, node); });
    // A path means the same file to the case that inherits it.
    const auto for_root = [&](string& path) {
      if (!path.empty() && directory_ != root_) path = fs::proximate(directory_ / path, root_).string();
    };
    if (key.type == Type::path) for_root(text_in(entry));
    if (Load* load = std::get_if<Load>(&entry.value)) for_root(load->table);
    return entry;
  }

  static bool is_table(const string& name) {
    return std::any_of(keys().begin(), keys().end(),
                       [&](const Key& key) { return key.table() == name + "."; });
  }

  // A key on top of the file, or a table of keys.
  void merge_key(const string& name, const toml::node& node, Draft& draft) const {
    if (is_table(name)) {
      if (!node.is_table())
        throw error(at(node), name, " = ", text_of(node), ": expected a table, [", name, "]");
      for (const auto& [leaf, value] : *node.as_table())
        merge_leaf(name + "." + string(leaf.str()), value, draft);
    } else if (node.is_table() || node.is_array_of_tables()) {
      std::vector<string> tables;
      for (const Key& key : keys())
        if (const string t = split(key.table(), ".")[0]; !t.empty() && (tables.empty() || tables.back() != t))
          tables.push_back(t);
      const string near = nearest(name, tables);
      throw error(at(node), "[", name, "]: unknown table; ",
                  near.empty() ? "known: " + join(tables, ", ") : "did you mean [" + near + "]?");
    } else {
      merge_leaf(name, node, draft);
    }
  }

  void merge_leaf(const string& name, const toml::node& node, Draft& draft) const {
    const Key* key = find(name);
    if (!key) throw error(at(node), name, " = ", text_of(node), ": unknown key; ", suggestion(name));
    draft.entries[name] = read(*key, name, node);
  }

  // What a table of a list is called: by its name, or by the two materials of a pair.
  std::pair<string, string> name_of(const string& list, const toml::node& element) const {
    const string key_name = list + (list == "pair" ? ".of" : ".name");
    const toml::node* node = element.as_table()->get(list == "pair" ? "of" : "name");
    if (!node)
      throw error(at(element), key_name, " is missing; expected ",
                  list == "pair" ? "of = [\"...\", \"...\"], two materials" : "name = \"...\", unique");
    Entry entry = read(*find(key_name), key_name, *node);
    if (list == "pair") {
      const auto& of = std::get<std::vector<string>>(entry.value);
      if (of.size() != 2) throw error(entry.stated, ": expected two materials, or one and \"wall\"");
      return {of[0] + "-" + of[1], entry.stated};
    }
    const string name = text_in(entry);
    if (name.empty() || name.find_first_not_of(
                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_") != name.npos)
      throw error(entry.stated, ": expected letters, digits, - and _");
    return {name, entry.stated};
  }

  void merge_list(const string& list, const toml::node& node, Draft& draft) const {
    const toml::array* tables = node.as_array();
    if (!tables || !std::all_of(tables->begin(), tables->end(), [](auto& s) { return s.is_table(); }))
      throw error(at(node), list, ": expected ", list, "s, each headed by [[", list, "]]");
    std::vector<StageDraft> seen;
    for (const toml::node& element : *tables) {
      const auto [name, stated] = name_of(list, element);
      if (find_in(seen, list, name) != seen.end())
        throw error(stated, ": there is another ", list, " of this name; expected a unique one");
      std::vector<StageDraft>& drafts = draft.list(list);
      auto target = find_in(drafts, list, name);
      if (target == drafts.end()) target = drafts.insert(target, {name, at(element) + list + "." + name, {}});
      for (const auto& [leaf, value] : *element.as_table()) {
        const string key_name = list + "." + string(leaf.str()),
                     shown = list + "." + name + "." + string(leaf.str());
        const Key* key = find(key_name);
        if (!key)
          throw error(at(value), shown, " = ", text_of(value), ": unknown key; ",
                      suggestion(key_name, list + "." + name + "."));
        target->entries[key_name] = read(*key, shown, value);
      }
      seen.push_back(*target);
    }
  }

  fs::path directory_, root_;
  toml::table table_;
};

// `chain` holds the cases that led here.
Draft read_file(const fs::path& directory, const fs::path& root, std::vector<fs::path> chain,
                const string* text = nullptr) {
  const File file(directory, root, text);
  Draft draft;
  chain.push_back(fs::weakly_canonical(directory));
  if (const auto [base, stated] = file.extends(); !base.empty()) {
    const fs::path base_directory = (directory / base).lexically_normal();
    const auto again = std::find(chain.begin(), chain.end(), fs::weakly_canonical(base_directory));
    if (again != chain.end()) {
      std::vector<string> names;
      for (auto c = again; c != chain.end(); ++c) names.push_back(c->filename().string());
      names.push_back(again->filename().string());
      throw error(stated, ": the cases extend each other in a circle: ", join(names, " -> "));
    }
    if (!fs::is_regular_file(base_directory / "case.toml"))
      throw error(stated, ": expected a directory that holds a case.toml, relative to ", directory.string());
    draft = read_file(base_directory, root, chain);
  }
  file.merge_into(draft);
  return draft;
}

string stated_as(const Override& o) { return by_set + o.key + "=" + o.value; }

// A name without its table stands for the one table that has it: "seed" for grains.seed. A key of the stages
// is meant for each stage that gives it: "normal_stress" for that of consolidate and that of shear.
std::vector<string> full_names(const Draft& draft, const Override& o) {
  if (o.key.find('.') != o.key.npos || find(o.key)) return {o.key};
  std::vector<string> found, names, stages;
  for (const Key& key : keys())
    if (key.name.substr(key.table().size()) == o.key && key.table() != "material." && key.table() != "pair.")
      found.push_back(key.name);
  if (found.empty()) return {o.key};
  if (found.size() > 1) throw error(stated_as(o), ": expected the full name, one of ", join(found, ", "));
  if (!found[0].starts_with("stage.")) return found;
  for (const StageDraft& s : draft.stages) {
    stages.push_back(s.name);
    if (s.entries.contains(found[0])) names.push_back("stage." + s.name + "." + o.key);
  }
  if (names.empty())
    throw error(stated_as(o), ": no stage gives this key in case.toml; expected stage.NAME.", o.key,
                " with NAME one of ", join(stages, ", "));
  return names;
}

void set(Draft& draft, const string& full_name, const Override& o) {
  const string stated = stated_as(o);
  const string table = split(full_name, ".")[0];
  if (full_name.size() > table.size() && is_list_of_tables(table)) {
    const std::size_t begin = table.size() + 1, dot = full_name.rfind('.');
    const string name = dot < begin ? full_name.substr(begin) : full_name.substr(begin, dot - begin),
                 key_name = table + "." + full_name.substr(dot + 1);
    StageDraft& target = about(stated, [&]() -> StageDraft& { return listed(draft, table, name); });
    const Key* key = find(key_name);
    if (!key) throw error(stated, ": unknown key; ", suggestion(key_name, table + "." + name + "."));
    if (key_name.ends_with(".name") || key_name == "pair.of")
      throw error(stated, ": a ", table, " keeps its name");
    target.entries[key_name] = {about(stated, [&] { return parse_bare(*key, o.value); }), stated};
  } else {
    const Key* key = find(full_name);
    if (!key) throw error(stated, ": unknown key; ", suggestion(full_name));
    if (key->name == "extends") throw error(stated, ": only case.toml can say what it extends");
    draft.entries[full_name] = {about(stated, [&] { return parse_bare(*key, o.value); }), stated};
  }
}

}  // namespace

Draft read(const fs::path& directory, const std::vector<Override>& overrides, const string* text) {
  Draft draft = read_file(directory, directory, {}, text);
  // In whatever order they are given: what names a stage goes before what is meant for each.
  const auto set_all = [&](bool of_stages, bool of_each) {
    std::map<string, const Override*> by;
    for (const Override& o : overrides)
      for (const string& name : full_names(draft, o)) {
        const bool stage_key = name.starts_with("stage.");
        if (stage_key != of_stages || (stage_key && o.key.find('.') == o.key.npos) != of_each) continue;
        if (const auto [same, is_new] = by.insert({name, &o}); !is_new)
          throw error(stated_as(*same->second), " and ", stated_as(o), ": expected each key once");
        set(draft, name, o);
      }
  };
  // `stages` first: a stage that does not run is none to set keys of.
  set_all(false, false);
  select_stages(draft);
  set_all(true, true), set_all(true, false);
  return draft;
}

Draft read_resolved_case(const fs::path& directory, const string& text) {
  Draft draft;
  File(directory, text).merge_into(draft);
  return draft;
}

std::map<string, string> read_resolved(const string& text) {
  std::map<string, string> values;
  std::vector<string> stages;
  const auto take = [&](const string& table, const toml::table& keys) {
    for (const auto& [leaf, value] : keys)
      if (!(value.is_table() && !value.as_table()->is_inline()) && !value.is_array_of_tables())
        values[table + string(leaf.str())] = text_of(value);
  };
  const toml::table all = toml::parse(text);
  take("", all);
  for (const auto& [name, node] : all)
    if (const toml::table* table = node.as_table()) take(string(name.str()) + ".", *table);
  if (const toml::array* list = all["material"].as_array())
    for (const toml::node& one : *list)
      take("material." + (*one.as_table())["name"].value_or(string()) + ".", *one.as_table());
  if (const toml::array* list = all["pair"].as_array())
    for (const toml::node& one : *list) {
      const toml::table& pair = *one.as_table();
      take("pair." + pair["of"][0].value_or(string()) + "-" + pair["of"][1].value_or(string()) + ".", pair);
    }
  if (const toml::array* list = all["stage"].as_array())
    for (const toml::node& stage : *list) {
      stages.push_back((*stage.as_table())["name"].value_or(string()));
      take("stage." + stages.back() + ".", *stage.as_table());
    }
  values["stages"] = join(stages, ", ");
  return values;
}

Value read_value(const string& name, const string& toml, const string& kind) {
  toml::table one;
  try {
    one = toml::parse("value = " + toml);
  } catch (const toml::parse_error& e) {
    throw error(name, " = ", toml, ": ", e.description());
  }
  const toml::node& node = *one.get("value");
  const string stated = name + " = " + text_of(node), table = split(name, ".")[0];
  const std::size_t dot = name.rfind('.');
  const bool listed = dot != name.npos && is_list_of_tables(table);
  const string key_name = listed ? table + name.substr(dot) : name;
  const Key* key = find(key_name);
  if (!key)
    throw error(stated, ": unknown key; ", suggestion(key_name, listed ? name.substr(0, dot + 1) : ""));
  if (const string why = not_of_kind(*key, kind); !kind.empty() && !why.empty())
    throw error(stated, ": expected ", why);
  return about(stated, [&] { return checked(*key, node); });
}

Value parse_default(const Key& key, const string& toml) { return parse_bare(key, toml); }

}  // namespace moraine::cases
