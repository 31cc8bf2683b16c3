// Tables as spreadsheets write them: columns by name, with units, separated by commas.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace moraine::cases {

// The first line that is neither empty nor a comment (#) names the columns, each with its unit if it is not
// the SI unit: "x, y, z, r", or "size (mm), finer (%)". All others hold numbers, but for
// columns that were named as those of words.
class CsvTable {
 public:
  // Throws Error with the line where something is wrong.
  explicit CsvTable(const std::filesystem::path& file, const std::vector<std::string>& of_words = {});

  bool has(const std::string& name) const;
  // In SI units. Throws Error where there is no such column, or one of another dimension.
  std::vector<double> column(const std::string& name, const std::string& unit) const;
  const std::vector<std::string>& words(const std::string& name) const;  // of a column that is there
  // Columns that none of these names asks for: most likely misspelled. Throws Error if there are any.
  void expect_only(const std::vector<std::string>& names) const;
  std::size_t rows() const { return lines_.size(); }
  int line(std::size_t row) const { return lines_[row]; }
  // "FILE, line N", for messages.
  std::string at(std::size_t row) const;
  const std::filesystem::path& file() const { return file_; }

 private:
  struct Column {
    std::string name, unit;  // the unit as it stands there; empty: none
    std::vector<double> values;
    std::vector<std::string> words;
  };
  const Column* find(const std::string& name) const;
  std::string names() const;

  std::filesystem::path file_;
  std::vector<Column> columns_;
  std::vector<int> lines_;  // of the file, for each row
};

}  // namespace moraine::cases
