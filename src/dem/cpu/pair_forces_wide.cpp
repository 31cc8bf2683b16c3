// The loop over near pairs, compiled for AVX-512. Nothing here but templates over Wide may be left as a
// function of its own: the linker would take it for the one that runs on all processors
// (tests/dem/wide-symbols tells).
#include "backend/wide.hpp"
#include "dem/cpu/pair_kernel.hpp"

namespace moraine::dem::cpu {

template <>
struct Lines<Wide> {
  using Line = Wide;
  template <class Row>
  static Wide load(const Row* row) {
    return Wide::load(reinterpret_cast<const double*>(row));
  }
  static Wide two_rows(const Vec3d* a, const Vec3d* b) {
    const auto row = [](const Vec3d* v) { return _mm256_load_pd(reinterpret_cast<const double*>(v)); };
    return _mm512_insertf64x4(_mm512_castpd256_pd512(row(a)), row(b), 1);
  }
  static Wide i_minus_j() { return _mm512_setr_pd(-1, -1, -1, -1, -1, -1, -1, 1); }
  static Wide on_i(double l) {
    return _mm512_mask_blend_pd(0b01110000, _mm512_set1_pd(1), _mm512_set1_pd(l));
  }
  static Wide on_j(double l) {
    return _mm512_mask_blend_pd(0b01110000, _mm512_setr_pd(-1, -1, -1, 0, 0, 0, 0, 0), _mm512_set1_pd(l));
  }
};

ChunkTask wide_pair_forces(int row, Account account) {
  return [&]<class... Rows>(std::tuple<Rows...>*) {
    static constexpr ChunkTask tasks[][2] = {
        {&pair_forces<typename Rows::BetweenGrains, Account::none, Wide>,
         &pair_forces<typename Rows::BetweenGrains, Account::energy, Wide>}...};
    return tasks[row][account == Account::energy];
  }(static_cast<CompiledLaws*>(nullptr));
}

}  // namespace moraine::dem::cpu
