// Parts of the module moraine._core, each in a file of its own.
#pragma once
#include <nanobind/nanobind.h>

void bind_run(nanobind::module_& m);
