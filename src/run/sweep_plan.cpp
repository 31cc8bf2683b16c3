#include "run/sweep_plan.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>

#include "error.hpp"

namespace moraine::run {

namespace {

using std::string;

string trimmed(const string& text) {
  const auto begin = text.find_first_not_of(" \t");
  return begin == text.npos ? "" : text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

struct Value {
  string number, unit;  // a text that begins with no number is all `number`
  string text() const { return number + (unit.empty() ? "" : " " + unit); }
};

Value split_unit(const string& text) {
  char* after = nullptr;
  std::strtod(text.c_str(), &after);
  if (after == text.c_str()) return {text, ""};
  return {text.substr(0, after - text.c_str()), trimmed(after)};
}

// What stands between the commas outside of quotes and brackets; a last comma ends the list.
std::vector<string> parts_of(const string& text) {
  std::vector<string> parts(1);
  int depth = 0;
  char quote = 0;
  for (const char c : text) {
    if (quote) {
      if (c == quote) quote = 0;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '[') {
      ++depth;
    } else if (c == ']') {
      --depth;
    }
    if (c == ',' && !quote && depth == 0)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

bool is_list(const cases::Override& set) { return parts_of(set.value).size() > 1; }

std::vector<Value> values_of(const cases::Override& set) {
  std::vector<string> parts = parts_of(set.value);
  if (trimmed(parts.back()).empty()) parts.pop_back();
  std::vector<Value> values;
  for (const string& part : parts) {
    values.push_back(split_unit(trimmed(part)));
    if (values.back().number.empty())
      throw error("--set ", set.key, "=", set.value, ": a value of the list is empty; expected 10,20,40 kPa");
  }
  const auto is_number = [](const Value& v) { return split_unit(v.number + "_").unit == "_"; };
  for (Value& v : values)
    if (v.unit.empty() && is_number(v)) v.unit = values.back().unit;
  return values;
}

// Letters, digits, and . + - _ are safe in every shell.
string safe(const Value& value) {
  const auto kept = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-';
  };
  const bool apart = !value.unit.empty() && !std::isalpha(static_cast<unsigned char>(value.unit[0]));
  string out;
  for (const char c : value.number + (apart ? " " : "") + value.unit)
    if (kept(c))
      out += c;
    else if (!out.empty() && !out.ends_with('_'))
      out += '_';
  while (out.ends_with('_')) out.pop_back();
  return out;
}

// The last word of the key; all of it, but for "stage.", where another list has the same last word.
string short_name(const string& key, const std::vector<cases::Override>& lists) {
  const auto leaf = [](const string& k) { return k.substr(k.rfind('.') + 1); };
  const auto same = [&](const cases::Override& o) { return leaf(o.key) == leaf(key); };
  if (std::count_if(lists.begin(), lists.end(), same) == 1) return leaf(key);
  return key.starts_with("stage.") ? key.substr(6) : key;
}

}  // namespace

Plan plan_sweep(const std::vector<cases::Override>& sets) {
  std::vector<cases::Override> fixed, lists;
  for (const cases::Override& set : sets) (is_list(set) ? lists : fixed).push_back(set);
  if (lists.empty())
    throw error(
        "sweep: nothing to sweep; expected a list of values, such as --set normal_stress=10,20,40kPa, or of "
        "one: --set normal_stress=10kPa,");

  Plan plan{{}, {{"", fixed, {}}}};
  for (const cases::Override& list : lists) {
    const std::vector<Value> values = values_of(list);
    const string name = short_name(list.key, lists), unit = values[0].unit;
    const bool one_unit =
        std::all_of(values.begin(), values.end(), [&](const Value& v) { return v.unit == unit; });
    plan.columns.push_back(one_unit && !unit.empty() ? name + " (" + unit + ")" : name);
    std::vector<PlannedCase> product;
    for (const PlannedCase& c : plan.cases)
      for (const Value& v : values) {
        PlannedCase& next = product.emplace_back(c);
        if (!next.name.empty()) next.name += "+";
        next.name += name + "-" + safe(v);
        next.overrides.push_back({list.key, v.text()});
        next.values.push_back(one_unit ? v.number : v.text());
      }
    plan.cases = std::move(product);
  }
  for (const PlannedCase& c : plan.cases)
    if (std::count_if(plan.cases.begin(), plan.cases.end(),
                      [&](const PlannedCase& other) { return other.name == c.name; }) > 1)
      throw error("sweep: two cases would be ", c.name, "; expected every value once");
  return plan;
}

}  // namespace moraine::run
