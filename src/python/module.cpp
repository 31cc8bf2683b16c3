// moraine._core: what the Python package needs of the program. Prose, units and habits are in python/moraine.
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "case/case.hpp"
#include "case/keys.hpp"
#include "error.hpp"

namespace nb = nanobind;
using namespace moraine;

namespace {

nb::list keys() {
  nb::list rows;
  for (const cases::Key& key : cases::keys()) {
    nb::dict row;
    row["name"] = key.name, row["type"] = cases::name_of(key.type), row["unit"] = key.unit;
    row["default"] = key.fallback, row["accepts"] = key.accepts, row["meaning"] = key.meaning;
    row["kinds"] = key.kinds;
    rows.append(row);
  }
  return rows;
}

}  // namespace

NB_MODULE(_core, m) {
  nb::exception<Error>(m, "Error");
  m.attr("version") = MORAINE_VERSION;
  m.def("keys", &keys, "The table of the keys of case.toml, a dict for each row.");
}
