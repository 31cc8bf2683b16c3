#include "case/csv.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>

#include "case/units.hpp"
#include "error.hpp"

namespace moraine::cases {

namespace {

using std::string;

string trimmed(const string& text) {
  const char* const blank = " \t\r\"";
  const auto begin = text.find_first_not_of(blank);
  return begin == text.npos ? "" : text.substr(begin, text.find_last_not_of(blank) - begin + 1);
}

std::vector<string> cells_of(const string& line) {
  std::vector<string> cells;
  std::size_t from = 0;
  while (true) {
    const std::size_t comma = line.find(',', from);
    cells.push_back(trimmed(line.substr(from, comma == line.npos ? comma : comma - from)));
    if (comma == line.npos) return cells;
    from = comma + 1;
  }
}

}  // namespace

CsvTable::CsvTable(const std::filesystem::path& file, const std::vector<string>& of_words) : file_(file) {
  std::ifstream in(file);
  if (!in) throw error(file.string(), ": cannot be read");
  string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (number == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);  // a mark that spreadsheets write
    const string text = trimmed(line);
    if (text.empty() || text[0] == '#') continue;
    const string here = file.string() + ", line " + std::to_string(number);
    const std::vector<string> cells = cells_of(line);
    if (columns_.empty()) {
      for (const string& cell : cells) {
        const auto open = cell.find('('), close = cell.rfind(')');
        const bool has_unit = open != cell.npos && close != cell.npos && close > open;
        Column column{trimmed(cell.substr(0, open)),
                      has_unit ? trimmed(cell.substr(open + 1, close - open - 1)) : "",
                      {},
                      {}};
        if (column.name.empty() || std::isdigit(static_cast<unsigned char>(column.name[0])) ||
            column.name[0] == '-')
          throw error(here, ": \"", cell,
                      "\" is no name of a column; expected a line of names, such as x, y, z, r");
        if (find(column.name)) throw error(here, ": the column ", column.name, " is there twice");
        columns_.push_back(std::move(column));
      }
      continue;
    }
    if (cells.size() != columns_.size())
      throw error(here, ": ", cells.size(), " values; expected ", columns_.size(), ", one for each of ",
                  names());
    for (std::size_t c = 0; c < cells.size(); ++c) {
      if (std::ranges::find(of_words, columns_[c].name) != of_words.end()) {
        columns_[c].words.push_back(cells[c]);
        continue;
      }
      double value = 0;
      const char* const end = cells[c].data() + cells[c].size();
      const auto result = std::from_chars(cells[c].data() + (cells[c].starts_with("+") ? 1 : 0), end, value);
      if (result.ec != std::errc() || result.ptr != end || !std::isfinite(value))
        throw error(here, ": ", columns_[c].name, " = \"", cells[c], "\"; expected a number");
      columns_[c].values.push_back(value);
    }
    lines_.push_back(number);
  }
  if (columns_.empty())
    throw error(file.string(),
                ": is empty; expected a line of names, one for each column, and numbers below");
  if (lines_.empty()) throw error(file.string(), ": has no rows below the names of its columns");
}

const CsvTable::Column* CsvTable::find(const string& name) const {
  const auto found = std::ranges::find(columns_, name, &Column::name);
  return found == columns_.end() ? nullptr : &*found;
}

string CsvTable::names() const {
  string all;
  for (const Column& column : columns_) all += (all.empty() ? "" : ", ") + column.name;
  return all;
}

bool CsvTable::has(const string& name) const { return find(name) != nullptr; }

std::vector<double> CsvTable::column(const string& name, const string& unit) const {
  const Column* const found = find(name);
  if (!found) throw error(file_.string(), ": there is no column ", name, "; it has ", names());
  std::vector<double> values = found->values;
  if (found->unit.empty()) return values;
  double factor = 1;
  try {
    factor = to_si("1 " + found->unit, unit);
  } catch (const Error& why) {
    throw error(file_.string(), ": ", name, " (", found->unit, "): ", why.what());
  }
  for (double& value : values) value *= factor;
  return values;
}

const std::vector<string>& CsvTable::words(const string& name) const { return find(name)->words; }

void CsvTable::expect_only(const std::vector<string>& names) const {
  for (const Column& column : columns_)
    if (std::ranges::find(names, column.name) == names.end()) {
      string known;
      for (const string& name : names) known += (known.empty() ? "" : ", ") + name;
      throw error(file_.string(), ": unknown column ", column.name, "; expected ", known);
    }
}

string CsvTable::at(std::size_t row) const {
  return file_.string() + ", line " + std::to_string(lines_[row]);
}

}  // namespace moraine::cases
