// moraine._core: what the Python package needs of the program. Prose, units and habits are in python/moraine.
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "bindings.hpp"
#include "case/case.hpp"
#include "case/keys.hpp"
#include "error.hpp"

namespace nb = nanobind;
using namespace moraine;

namespace {

PyObject* error_type = nullptr;

const char* name_of(cases::Key::Type type) {
  switch (type) {
    case cases::Key::Type::number:
      return "number";
    case cases::Key::Type::integer:
      return "integer";
    case cases::Key::Type::boolean:
      return "boolean";
    case cases::Key::Type::text:
      return "text";
    case cases::Key::Type::choice:
      return "choice";
    case cases::Key::Type::path:
      return "path";
    case cases::Key::Type::list:
      return "list";
    case cases::Key::Type::load:
      return "load";
  }
  return "";
}

nb::list keys() {
  nb::list rows;
  for (const cases::Key& key : cases::keys()) {
    nb::dict row;
    row["name"] = key.name, row["type"] = name_of(key.type), row["unit"] = key.unit;
    row["default"] = key.fallback, row["accepts"] = key.accepts, row["meaning"] = key.meaning;
    row["kinds"] = key.kinds;
    rows.append(row);
  }
  return rows;
}

}  // namespace

std::string in_python(std::string words) {
  for (const auto& [option, argument] : {std::pair<std::string, std::string>{"--resume", "resume=True"},
                                         {"--force", "force=True"},
                                         {"--set ", "set "}})
    for (std::size_t at; (at = words.find(option)) != words.npos;) words.replace(at, option.size(), argument);
  return words;
}

NB_MODULE(_core, m) {
  error_type = PyErr_NewException("moraine.Error", PyExc_RuntimeError, nullptr);
  m.attr("Error") = nb::handle(error_type);
  nb::register_exception_translator([](const std::exception_ptr& thrown, void*) {
    try {
      std::rethrow_exception(thrown);
    } catch (const Error& e) {
      PyErr_SetString(error_type, in_python(e.what()).c_str());
    }
  });
  m.attr("version") = MORAINE_VERSION;
  m.def("keys", &keys, "The table of the keys of case.toml, a dict for each row.");
  bind_cases(m);
  bind_run(m);
}
