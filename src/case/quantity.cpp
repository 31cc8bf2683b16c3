#include "case/quantity.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>
#include <utility>

#include "error.hpp"

namespace moraine::cases {
namespace {

using std::string;

bool digit(char c) { return c >= '0' && c <= '9'; }
bool letter(char c) {  // or a byte of one outside of ASCII: µ, Å
  return std::isalpha(static_cast<unsigned char>(c)) || static_cast<unsigned char>(c) >= 0x80;
}

// What typesetting puts for a space, a minus, a product or a power; control characters count as spaces.
string in_ascii(const string& text) {
  static const std::pair<std::string_view, std::string_view> signs[] = {
      {"\u00a0", " "}, {"\u2007", " "}, {"\u2009", " "}, {"\u202f", " "}, {"\u2212", "-"}, {"\u00b7", "*"},
      {"\u22c5", "*"}, {"\u207b", "-"}, {"\u2070", "0"}, {"\u00b9", "1"}, {"\u00b2", "2"}, {"\u00b3", "3"},
      {"\u2074", "4"}, {"\u2075", "5"}, {"\u2076", "6"}, {"\u2077", "7"}, {"\u2078", "8"}, {"\u2079", "9"}};
  constexpr std::size_t first_power = 7;
  string out;
  bool raised = false;
  for (std::string_view rest = text; !rest.empty();) {
    std::size_t s = 0;
    while (s < std::size(signs) && !rest.starts_with(signs[s].first)) ++s;
    const bool known = s < std::size(signs), power = known && s >= first_power;
    if (power && !raised) out += '^';
    raised = power;
    if (known)
      out += signs[s].second;
    else
      out += static_cast<unsigned char>(rest[0]) < ' ' ? ' ' : rest[0];
    rest.remove_prefix(known ? signs[s].first.size() : 1);
  }
  return out;
}

string trimmed(const string& text) {
  const auto begin = text.find_first_not_of(' ');
  return begin == text.npos ? "" : text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

// A factor is a name or a product in brackets, with an exponent; factors follow each other after a space, a
// sign of multiplication, a bar or "per".
class Reader {
 public:
  explicit Reader(const string& text) : text_(text) {}

  UnitExpression unit() {
    std::size_t ahead = 0;
    if (at(0) == '1') {  // of 1/Pa
      for (ahead = 1; at(ahead) == ' ';) ++ahead;
      if (at(ahead) != '/') fail();
      at_ = ahead;
    }
    if (take_bar()) out_.plain = "1/";
    product();
    if (at_ < text_.size()) fail();
    return out_;
  }

 private:
  char at(std::size_t place) const { return place < text_.size() ? text_[place] : '\0'; }
  char next() const { return at(at_); }
  void skip_spaces() {
    while (next() == ' ') ++at_;
  }

  [[noreturn]] void fail() const {
    const string rest = "\"" + text_.substr(std::min(at_, text_.size())) + "\"";
    if (next() == '\0') throw error("a unit is missing at its end");
    if (next() == ',') throw error(rest, " begins with a comma; decimals take a point, thousands none");
    if (digit(next()) || (next() == '.' && digit(at(at_ + 1)))) throw error(rest, " is another number");
    throw error(rest, " is no part of a unit");
  }

  bool take_bar() {
    const std::size_t length = next() == '/' ? 1 : name_ahead() == "per" ? 3 : 0;
    if (length == 0) return false;
    at_ += length, skip_spaces();
    return below_ = true;
  }

  void product() {
    factor();
    while (true) {
      const std::size_t before = at_;
      skip_spaces();
      if (next() == '\0' || next() == ')') return;
      if (take_bar()) {
        out_.plain += '/';
      } else {
        if (next() == '*' || next() == '.' || (next() == '-' && at_ == before && letter(at(at_ + 1))))
          ++at_, skip_spaces();
        else if (at_ == before)
          fail();
        out_.plain += ' ';
      }
      factor();
    }
  }

  void factor() {
    const bool below = std::exchange(below_, false);
    const std::size_t first = out_.factors.size();
    if (next() == '(') {
      ++at_, skip_spaces();
      out_.plain += '(';
      product();
      if (next() != ')') throw error("a ) is missing");
      ++at_;
      out_.plain += ')';
    } else {
      const string name = name_ahead();
      if (name.empty()) fail();
      at_ += name.size();
      out_.plain += name;
      out_.factors.push_back({name, 1});
    }
    const int power = exponent();
    if (power != 1) out_.plain += std::to_string(power);
    for (std::size_t k = first; k < out_.factors.size(); ++k) out_.factors[k].power *= below ? -power : power;
  }

  // Letters, and digits between them: cmH2O. Digits at the end are the exponent.
  string name_ahead() const {
    const char c = next();
    if (c == '%' || c == '\'' || c == '"') return {c};
    if (!letter(c)) return "";
    std::size_t end = at_ + 1;
    while (letter(at(end)) || digit(at(end)) || at(end) == '_') ++end;
    while (digit(at(end - 1))) --end;
    return text_.substr(at_, end - at_);
  }

  // A single digit, as in m2, m^2, m**2, m-2; 1 where there is none.
  int exponent() {
    std::size_t place = at_;
    if (at(place) == '^')
      place += 1;
    else if (at(place) == '*' && at(place + 1) == '*')
      place += 2;
    const bool raised = place > at_, negative = at(place) == '-';
    if (negative || (raised && at(place) == '+')) ++place;
    const bool whole = !digit(at(place + 1)) && !(at(place + 1) == '.' && digit(at(place + 2)));
    if (!digit(at(place))) {
      if (raised) fail();
      return 1;  // N-m
    }
    if (at(place) == '0' || !whole)
      throw error("\"", text_.substr(at_), "\" begins with no exponent from 1 to 9");
    at_ = place + 1;
    return (at(place) - '0') * (negative ? -1 : 1);
  }

  string text_;
  std::size_t at_ = 0;
  bool below_ = false;  // the bar, of the next factor
  UnitExpression out_;
};

}  // namespace

Quantity split_quantity(const string& text) {
  const string plain = trimmed(in_ascii(text));
  std::size_t at = 0;
  const auto digits_at = [&](std::size_t from) {
    std::size_t end = from;
    while (end < plain.size() && digit(plain[end])) ++end;
    return end - from;
  };
  string number;
  if (plain.starts_with('+') || plain.starts_with('-')) number += plain[at++] == '-' ? "-" : "";
  std::size_t whole = digits_at(at), decimals = 0;
  number += plain.substr(at, whole);
  at += whole;
  if (whole > 0 && whole <= 3 && plain[at - whole] != '0')
    while (at < plain.size() && plain[at] == ' ' && digits_at(at + 1) == 3)
      number += plain.substr(at + 1, 3), at += 4;
  if (at < plain.size() && plain[at] == '.') {
    decimals = digits_at(at + 1);
    if (whole + decimals > 0) number += plain.substr(at, 1 + decimals), at += 1 + decimals;
  }
  if (whole + decimals == 0) return {"", plain};
  if (at < plain.size() && (plain[at] == 'e' || plain[at] == 'E')) {
    const bool sign = at + 1 < plain.size() && (plain[at + 1] == '+' || plain[at + 1] == '-');
    if (const std::size_t n = digits_at(at + 1 + sign); n > 0)
      number += plain.substr(at, 1 + sign + n), at += 1 + sign + n;
  }
  return {number, trimmed(plain.substr(at))};
}

UnitExpression read_unit(const string& unit) { return Reader(unit).unit(); }

}  // namespace moraine::cases
