// Eight doubles in the lanes of an AVX-512 register: as Pack (number.hpp), with the same bits in each lane.
// Only for files that are compiled for such processors.
#pragma once
#include "backend/number.hpp"

namespace moraine {

struct Wide {
  static constexpr int width = 8;
  __m512d v;

  Wide() {}
  Wide(__m512d lanes) : v(lanes) {}
  Wide(double all) : v(_mm512_set1_pd(all)) {}

  // p must be aligned to 64 bytes.
  static Wide load(const double* p) { return _mm512_load_pd(p); }
  void store(double* p) const { _mm512_store_pd(p, v); }

  friend Wide operator+(Wide a, Wide b) { return _mm512_add_pd(a.v, b.v); }
  friend Wide operator-(Wide a, Wide b) { return _mm512_sub_pd(a.v, b.v); }
  friend Wide operator*(Wide a, Wide b) { return _mm512_mul_pd(a.v, b.v); }
  friend Wide operator/(Wide a, Wide b) { return _mm512_div_pd(a.v, b.v); }
  friend Wide operator-(Wide a) { return _mm512_xor_pd(a.v, _mm512_set1_pd(-0.0)); }
  Wide& operator+=(Wide b) { return *this = *this + b; }

  struct Mask {
    __mmask8 b;
    friend Mask operator&(Mask a, Mask c) { return {static_cast<__mmask8>(a.b & c.b)}; }
  };
  friend Mask operator<(Wide a, Wide b) { return {_mm512_cmp_pd_mask(a.v, b.v, _CMP_LT_OQ)}; }
  friend Mask operator>(Wide a, Wide b) { return {_mm512_cmp_pd_mask(a.v, b.v, _CMP_GT_OQ)}; }
  friend Wide select(Mask m, Wide a, Wide b) { return _mm512_mask_blend_pd(m.b, b.v, a.v); }
  friend unsigned bits(Mask m) { return m.b; }
};

inline Wide fma(Wide a, Wide b, Wide c) { return _mm512_fmadd_pd(a.v, b.v, c.v); }
inline Wide fnma(Wide a, Wide b, Wide c) { return _mm512_fnmadd_pd(a.v, b.v, c.v); }
inline Wide sqrt(Wide a) { return _mm512_sqrt_pd(a.v); }
inline Wide round(Wide a) { return _mm512_roundscale_pd(a.v, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC); }
inline Wide min(Wide a, Wide b) { return select(a < b, a, b); }
inline Wide max(Wide a, Wide b) { return select(a > b, a, b); }

// Eight rows become columns.
[[gnu::always_inline]] inline void transpose(const Wide (&row)[8], Wide (&column)[8]) {
  __m512d pair[8], quad[8];
  for (int k = 0; k < 8; k += 2) {
    pair[k] = _mm512_unpacklo_pd(row[k].v, row[k + 1].v);      // numbers 0 2 4 6 of both
    pair[k + 1] = _mm512_unpackhi_pd(row[k].v, row[k + 1].v);  // 1 3 5 7
  }
  for (int k = 0; k < 8; k += 4)
    for (int odd = 0; odd < 2; ++odd) {
      quad[k + odd] = _mm512_shuffle_f64x2(pair[k + odd], pair[k + 2 + odd], 0x88);      // 0 4 of four rows
      quad[k + 2 + odd] = _mm512_shuffle_f64x2(pair[k + odd], pair[k + 2 + odd], 0xdd);  // 2 6
    }
  for (int k = 0; k < 4; ++k) {
    column[k] = _mm512_shuffle_f64x2(quad[k], quad[4 + k], 0x88);
    column[4 + k] = _mm512_shuffle_f64x2(quad[k], quad[4 + k], 0xdd);
  }
}

// A cache line of eight doubles is one register here (compare Line).
[[gnu::always_inline]] inline void to_columns(const Wide (&lines)[8], Wide (&columns)[8]) {
  transpose(lines, columns);
}
[[gnu::always_inline]] inline void to_lines(const Wide (&columns)[8], Wide (&lines)[8]) {
  transpose(columns, lines);
}

}  // namespace moraine
