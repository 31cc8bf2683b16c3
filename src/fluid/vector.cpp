#include "fluid/vector.hpp"

#include "error.hpp"

namespace moraine::fluid {

double dot(const double* a, const double* b, std::size_t n) {
  constexpr std::size_t lanes = 16;
  double sum[lanes] = {};
  std::size_t i = 0;
  for (; i + lanes <= n; i += lanes)
    for (std::size_t l = 0; l < lanes; ++l) sum[l] += a[i + l] * b[i + l];
  for (std::size_t l = 0; i < n; ++i, ++l) sum[l] += a[i] * b[i];
  for (std::size_t half = lanes / 2; half > 0; half /= 2)
    for (std::size_t l = 0; l < half; ++l) sum[l] += sum[l + half];
  return sum[0];
}

namespace {

double dot_product(N_Vector x, N_Vector y) {
  return dot(NV_DATA_S(x), NV_DATA_S(y), static_cast<std::size_t>(NV_LENGTH_S(x)));
}

void linear_sum(double a, N_Vector x, double b, N_Vector y, N_Vector z) {
  const double *from = NV_DATA_S(x), *other = NV_DATA_S(y);
  double* to = NV_DATA_S(z);  // may be x or y themselves, never a shifted part of them
  const sunindextype n = NV_LENGTH_S(x);
#pragma omp simd
  for (sunindextype i = 0; i < n; ++i) to[i] = a * from[i] + b * other[i];
}

}  // namespace

N_Vector new_vector(std::size_t n, SUNContext context) {
  N_Vector v = N_VNew_Serial(static_cast<sunindextype>(n), context);
  if (!v) throw error("pore water: no memory for a vector of ", n, " cells");
  v->ops->nvdotprod = dot_product;
  v->ops->nvlinearsum = linear_sum;
  return v;
}

}  // namespace moraine::fluid
