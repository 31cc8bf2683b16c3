#include "case/load.hpp"

#include "case/csv.hpp"
#include "case/keys.hpp"
#include "error.hpp"

namespace moraine::cases {

namespace {

using std::string;

string list_of(const std::vector<double>& numbers) {
  std::vector<string> parts;
  for (const double number : numbers) parts.push_back(to_toml(Value(number)));
  string list = "[";
  return list.append(join(parts, ", ")).append("]");
}

}  // namespace

void check_times(const History& h, const std::function<string(std::size_t)>& at) {
  if (h.time[0] > 0)
    throw error(at(0), ": begins at ", h.time[0], " s; expected a value at 0 s, where the stage begins");
  for (std::size_t k = 1; k < h.time.size(); ++k) {
    if (h.time[k] == h.time[k - 1])
      throw error(at(k), ": two values at ", h.time[k],
                  " s; expected one (interpolation = \"steps\" jumps by itself)");
    if (h.time[k] < h.time[k - 1])
      throw error(at(k), ": ", h.time[k], " s after ", h.time[k - 1],
                  " s runs backwards; expected each time later than the one before");
  }
}

History read_table(const std::filesystem::path& file, const string& unit, History::Between between,
                   const std::function<void(double)>& accept) {
  const CsvTable table(file);
  table.expect_only({"time", "value"});
  History h{between, false, table.column("time", "s"), table.column("value", unit)};
  for (std::size_t k = 0; k < h.value.size(); ++k) try {
      accept(h.value[k]);
    } catch (const Error& e) {
      throw error(table.at(k), ": value = ", h.value[k], ": ", e.what());
    }
  check_times(h, [&](std::size_t k) { return table.at(k); });
  return h;
}

string to_toml(const Load& load) {
  const History& h = load.history;
  if (load.form == Load::Form::ramp)
    return "{ ramp = " + list_of(h.value) + ", over = " + to_toml(Value(h.time[1])) + " }";
  const string between = h.between == History::Between::steps ? "\"steps\" }" : "\"linear\" }";
  const string of = load.form == Load::Form::table
                        ? "table = " + to_toml(Value(load.table))
                        : "times = " + list_of(h.time) + ", values = " + list_of(h.value);
  return "{ " + of + ", interpolation = " + between;
}

string load_reference() {
  return "\nA load may change with time. In place of a number it takes\n"
         "  { ramp = [\"20 kPa\", \"80 kPa\"], over = \"0.5 s\" }    from the beginning of the stage; then "
         "it "
         "stays\n"
         "  { times = [\"0 s\", \"1 s\"], values = [\"20 kPa\", \"80 kPa\"], interpolation = \"linear\" }\n"
         "  { table = \"FILE.csv\", interpolation = \"steps\" }    columns time and value, relative to the "
         "case\n"
         "Times count from the beginning of the stage and reach to its end; \"steps\" keeps each value until "
         "the "
         "next.\nA sinusoid (..._amplitude, ..._frequency, ..._phase) is added to any of them.\n";
}

}  // namespace moraine::cases
