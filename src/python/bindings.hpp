// Parts of the module moraine._core, each in a file of its own.
#pragma once
#include <nanobind/nanobind.h>

#include <string>

// Words of an Error that name options of the command line, with what these are called in Python.
std::string in_python(std::string words);

void bind_cases(nanobind::module_& m);
void bind_run(nanobind::module_& m);
