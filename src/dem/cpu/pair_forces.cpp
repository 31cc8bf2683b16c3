// Forces of near pairs: which loop (pair_kernel.hpp) a scene takes, on this processor.
#include <cstdlib>
#include <string_view>

#include "dem/cpu/pair_kernel.hpp"

namespace moraine::dem::cpu {

template <>
struct Lines<Pack> {
  using Line = moraine::Line;
  template <class Row>
  static Line load(const Row* row) {
    return Line::load(reinterpret_cast<const double*>(row));
  }
  static Line two_rows(const Vec3d* a, const Vec3d* b) { return {row(*a), row(*b)}; }
  static Line i_minus_j() { return cpu::i_minus_j(); }
  // What of a pair's line (force, slip, f_t x n, viscous) goes to its grains.
  static Line on_i(double l) { return {1.0, Row(l, l, l, 1)}; }
  static Line on_j(double l) { return {Row(-1, -1, -1, 0), Row(l, l, l, 0)}; }
};

bool has_wide_lanes() {
#if defined(MORAINE_WIDE)
  const char* const wanted = std::getenv("MORAINE_SIMD");
  return (!wanted || std::string_view(wanted) != "avx2") && __builtin_cpu_supports("avx512f") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd");
#else
  return false;
#endif
}

ChunkTask pair_forces_for(const Scene& scene) {
  ChunkTask task = nullptr;
  with_laws(scene, [&]<class Row, Account account>() {
    task = &pair_forces<typename Row::BetweenGrains, account, Pack>;
#if defined(MORAINE_WIDE)
    if (has_wide_lanes()) task = wide_pair_forces(row_number<Row>, account);
#endif
  });
  return task;
}

}  // namespace moraine::dem::cpu
