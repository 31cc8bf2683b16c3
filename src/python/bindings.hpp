// Parts of the module moraine._core, each in a file of its own.
#pragma once
#include <nanobind/nanobind.h>

void bind_cases(nanobind::module_& m);
