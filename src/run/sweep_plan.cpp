#include "run/sweep_plan.hpp"

#include <algorithm>
#include <cctype>

#include "case/keys.hpp"
#include "case/quantity.hpp"
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
  string text;          // as it is set
};

Value value_of(const string& text) {
  const cases::Quantity q = cases::split_quantity(text);
  if (q.number.empty()) return {text, "", text};
  return {q.number, q.unit, text};
}

bool is_number(const Value& v) { return !cases::split_quantity(v.number).number.empty(); }

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
    } else if (c == '[' || c == '{') {
      ++depth;
    } else if (c == ']' || c == '}') {
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
  const string stated = "--set " + set.key + "=" + set.value + ": ";
  std::vector<string> parts = parts_of(set.value);
  if (trimmed(parts.back()).empty()) parts.pop_back();
  std::vector<Value> values;
  for (const string& part : parts) {
    values.push_back(value_of(trimmed(part)));
    const string& number = values.back().number;
    if (number.empty()) throw error(stated, "a value of the list is empty; expected 10,20,40 kPa");
    if (parts.size() > 1 && number.size() > 1 && number.find_first_not_of("0123456789") == number.npos &&
        number[0] == '0')
      throw error(stated, "understood a list of ", parts.size(), " values, with \"", values.back().text,
                  "\" among them; expected thousands and decimals without a comma");
  }
  const auto last = std::find_if(values.rbegin(), values.rend(), is_number);
  if (last == values.rend()) return values;
  const Value unit_giver = *last;
  for (Value& v : values) {
    if (!is_number(v)) continue;
    if (unit_giver.unit.empty() && !v.unit.empty())
      throw error(stated, "\"", v.text, "\" has a unit and \"", unit_giver.text,
                  "\" has none; expected one behind the last number, which is that of all, or behind each");
    if (v.unit.empty() && !unit_giver.unit.empty()) v.unit = unit_giver.unit, v.text += " " + v.unit;
  }
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
  for (const cases::Override& set : sets) {
    for (const cases::Override& other : sets)
      if (&other != &set && other.key == set.key)
        throw error("--set ", set.key, "=", set.value, " and --set ", other.key, "=", other.value,
                    ": expected each key once");
    (is_list(set) ? lists : fixed).push_back(set);
  }
  if (lists.empty())
    throw error(
        "sweep: nothing to sweep; expected a list of values, such as --set normal_stress=10,20,40kPa, or of "
        "one: --set normal_stress=10kPa,");

  Plan plan{{}, {{"", fixed, {}}}, ""};
  std::vector<std::vector<string>> names(1);  // of each case, a part for each list
  for (const cases::Override& list : lists) {
    const std::vector<Value> values = values_of(list);
    const string name = short_name(list.key, lists), unit = values[0].unit;
    const bool one_unit =
        std::all_of(values.begin(), values.end(), [&](const Value& v) { return v.unit == unit; });
    plan.columns.push_back(one_unit && !unit.empty() ? name + " (" + unit + ")" : name);
    std::vector<PlannedCase> product;
    std::vector<std::vector<string>> product_names;
    for (std::size_t k = 0; k < plan.cases.size(); ++k)
      for (const Value& v : values) {
        PlannedCase& next = product.emplace_back(plan.cases[k]);
        next.overrides.push_back({list.key, v.text});
        next.values.push_back(one_unit ? v.number : v.text);
        product_names.emplace_back(names[k]).push_back(name + "-" + safe(v));
      }
    plan.cases = std::move(product), names = std::move(product_names);
    std::vector<string> texts;
    for (const Value& v : values) texts.push_back(v.text);
    plan.understood += (plan.understood.empty() ? "" : "; ") + name + " = " + cases::join(texts, ", ");
  }
  for (std::size_t k = 0; k < plan.cases.size(); ++k) {
    std::sort(names[k].begin(), names[k].end());
    plan.cases[k].name = cases::join(names[k], "+");
  }
  for (const PlannedCase& c : plan.cases)
    if (std::count_if(plan.cases.begin(), plan.cases.end(),
                      [&](const PlannedCase& other) { return other.name == c.name; }) > 1)
      throw error("sweep: two cases would be ", c.name, "; expected every value once");
  return plan;
}

}  // namespace moraine::run
