// A load that changes with time, as a case has it: a key of Type::load takes one in place of a number.
//
//   normal_stress = { ramp = ["20 kPa", "80 kPa"], over = "0.5 s" }  # from the beginning; then it stays
//   shear_stress = { times = ["0 s", "1 s"], values = ["0 kPa", "9 kPa"], interpolation = "steps" }
//   velocity = { table = "pulses.csv", interpolation = "linear" }        # columns time and value
#pragma once
#include <filesystem>
#include <functional>
#include <string>

#include "history.hpp"

namespace moraine::cases {

struct Load {
  enum class Form { ramp, list, table };
  Form form = Form::list;
  std::string table;  // file, relative to the case
  History history;    // SI; of a table: empty until it is read
  bool operator==(const Load&) const = default;
};

inline constexpr const char* load_forms =
    "{ ramp = [from, to], over = time }, { times = [...], values = [...] } or { table = \"FILE.csv\" }, the "
    "last two with interpolation = \"linear\" or \"steps\"";

// Times that rise from 0 s or before. Throws Error; at(k) says where value k stands.
void check_times(const History& history, const std::function<std::string(std::size_t)>& at);

// The history in a CSV file with the columns time and value (of this unit). Throws Error naming file and
// line. accept: throws Error for a value that is out of range.
History read_table(const std::filesystem::path& file, const std::string& unit, History::Between between,
                   const std::function<void(double)>& accept);

std::string to_toml(const Load& load);  // in one line

// For `moraine keys`.
std::string load_reference();

}  // namespace moraine::cases
