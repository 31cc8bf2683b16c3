// SUNDIALS' serial vector with the two operations that conjugate gradients spend their time in done in SIMD
// lanes: the library's own are compiled without, and its dot product waits for each sum before the next.
#pragma once
#include <nvector/nvector_serial.h>

#include <cstddef>

namespace moraine::fluid {

double dot(const double* a, const double* b, std::size_t n);  // the same bits for the same arguments
N_Vector new_vector(std::size_t n, SUNContext context);       // throws Error where there is no memory

}  // namespace moraine::fluid
