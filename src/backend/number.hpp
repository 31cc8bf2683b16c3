// Number types for the physics: double, and Pack, as many doubles as the processor has SIMD lanes for. The
// same formula serves both through
// + - * /, fma, sqrt, min, max and select; each lane of a Pack gives the same bits as the double formula,
// because fma is always spelled out and the compiler is told not to contract on its own (-ffp-contract=off,
// --fmad=false).
#pragma once
#include <cmath>
#include <type_traits>

#include "backend/host_device.hpp"
#if defined(__AVX__) && !defined(__CUDACC__)
#include <immintrin.h>
#endif

namespace moraine {

MORAINE_HD double fma(double a, double b, double c) {
#if defined(__FMA__) || defined(__CUDA_ARCH__) || defined(__aarch64__)
  return ::fma(a, b, c);
#else
  return a * b + c;  // a processor without fma: emulating it would cost a hundredfold
#endif
}
MORAINE_HD double fnma(double a, double b, double c) { return fma(-a, b, c); }  // c - a b
MORAINE_HD double sqrt(double a) { return ::sqrt(a); }
MORAINE_HD double min(double a, double b) { return a < b ? a : b; }
MORAINE_HD double max(double a, double b) { return a > b ? a : b; }
MORAINE_HD double select(bool mask, double a, double b) { return mask ? a : b; }

#ifndef __CUDACC__

#if defined(__AVX512F__)
// Square root and quotient by Newton's iteration and a last step with the exact remainder, which rounds them
// as the hardware does (Markstein 1990; a divisor whose significand is all ones can be an ulp off). The
// divider would take three times as long, and the loop over pairs is bound by it. For numbers that are
// finite, normal and not 0; NaN may come of others.
inline __m512d newton_sqrt(__m512d a) {
  const __m512d half = _mm512_set1_pd(0.5);
  const __m512d seed = _mm512_rsqrt14_pd(a);
  __m512d g = _mm512_mul_pd(a, seed), h = _mm512_mul_pd(half, seed);  // to sqrt(a), 1/(2 sqrt(a))
  for (int k = 0; k < 2; ++k) {
    const __m512d e = _mm512_fnmadd_pd(g, h, half);
    g = _mm512_fmadd_pd(g, e, g), h = _mm512_fmadd_pd(h, e, h);
  }
  return _mm512_fmadd_pd(_mm512_fnmadd_pd(g, g, a), h, g);
}
inline __m512d newton_quotient(__m512d a, __m512d b) {
  __m512d y = _mm512_rcp14_pd(b);
  for (int k = 0; k < 2; ++k) y = _mm512_fmadd_pd(y, _mm512_fnmadd_pd(b, y, _mm512_set1_pd(1)), y);
  const __m512d q = _mm512_mul_pd(a, y);
  return _mm512_fmadd_pd(_mm512_fnmadd_pd(b, q, a), y, q);
}
#endif

template <int N>
struct Vector;  // of the compiler
template <>
struct Vector<4> {
  using Lanes = double __attribute__((vector_size(32)));
  using Bits = long long __attribute__((vector_size(32)));
};
template <>
struct Vector<8> {
  using Lanes = double __attribute__((vector_size(64)));
  using Bits = long long __attribute__((vector_size(64)));
};

template <int N>
struct Simd {
  static constexpr int width = N;
  using Lanes = typename Vector<N>::Lanes;
  using Bits = typename Vector<N>::Bits;
  Lanes v;

  Simd() {}
  // Spelled out so that GCC copies structs of packs by whole lanes rather than by eight bytes at a time
  // (measured: 1.5x).
  Simd(const Simd& other) : v(other.v) {}
  Simd& operator=(const Simd& other) {
    v = other.v;
    return *this;
  }
  Simd(Lanes lanes) : v(lanes) {}
  Simd(double all) {
    for (int k = 0; k < N; ++k) v[k] = all;
  }
  template <class... D>
  requires(sizeof...(D) == N && (std::is_arithmetic_v<D> && ...)) Simd(D... lane)
      : v{static_cast<double>(lane)...} {}

  // p must be aligned to the size of the lanes.
  static Simd load(const double* p) { return *reinterpret_cast<const Lanes*>(p); }
  void store(double* p) const { *reinterpret_cast<Lanes*>(p) = v; }
  double operator[](int lane) const { return v[lane]; }

  friend Simd operator+(Simd a, Simd b) { return a.v + b.v; }
  friend Simd operator-(Simd a, Simd b) { return a.v - b.v; }
  friend Simd operator*(Simd a, Simd b) { return a.v * b.v; }
  friend Simd operator/(Simd a, Simd b) {
#if defined(__AVX512F__)
    if constexpr (N == 8) return newton_quotient(a.v, b.v);
#endif
    return a.v / b.v;
  }
  friend Simd operator-(Simd a) { return -a.v; }
  Simd& operator+=(Simd b) { return *this = *this + b; }

  struct Mask {
    Bits b;
    friend Mask operator&(Mask a, Mask c) { return {a.b & c.b}; }
  };
  friend Mask operator<(Simd a, Simd b) { return {a.v < b.v}; }
  friend Mask operator>(Simd a, Simd b) { return {a.v > b.v}; }
  friend Simd select(Mask m, Simd a, Simd b) { return m.b ? a.v : b.v; }
  friend Simd min(Simd a, Simd b) { return select(a < b, a, b); }
  friend Simd max(Simd a, Simd b) { return select(a > b, a, b); }

  friend Simd fma(Simd a, Simd b, Simd c) {
#if defined(__AVX512F__)
    if constexpr (N == 8) return _mm512_fmadd_pd(a.v, b.v, c.v);
#endif
#if defined(__FMA__)
    if constexpr (N == 4) return _mm256_fmadd_pd(a.v, b.v, c.v);
#endif
    Simd r;
    for (int k = 0; k < N; ++k) r.v[k] = moraine::fma(a.v[k], b.v[k], c.v[k]);
    return r;
  }
  friend Simd fnma(Simd a, Simd b, Simd c) {
#if defined(__AVX512F__)
    if constexpr (N == 8) return _mm512_fnmadd_pd(a.v, b.v, c.v);
#endif
#if defined(__FMA__)
    if constexpr (N == 4) return _mm256_fnmadd_pd(a.v, b.v, c.v);
#endif
    return fma(-a, b, c);
  }
  friend Simd sqrt(Simd a) {
#if defined(__AVX512F__)
    if constexpr (N == 8) return newton_sqrt(a.v);
#endif
#if defined(__AVX__)
    if constexpr (N == 4) return _mm256_sqrt_pd(a.v);
#endif
    Simd r;
    for (int k = 0; k < N; ++k) r.v[k] = ::sqrt(a.v[k]);
    return r;
  }
  friend Simd round(Simd a) {
#if defined(__AVX512F__)
    if constexpr (N == 8) return _mm512_roundscale_pd(a.v, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
#endif
#if defined(__AVX__)
    if constexpr (N == 4) return _mm256_round_pd(a.v, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
#endif
    Simd r;
    for (int k = 0; k < N; ++k) r.v[k] = ::rint(a.v[k]);
    return r;
  }
};

#if defined(__AVX512F__)
using Pack = Simd<8>;
#else
using Pack = Simd<4>;
#endif

// Rows a, b, c, d become columns.
[[gnu::always_inline]] inline void transpose(Simd<4>& a, Simd<4>& b, Simd<4>& c, Simd<4>& d) {
  using I = Simd<4>::Bits;
  const Simd<4>::Lanes ab_low = __builtin_shuffle(a.v, b.v, I{0, 4, 2, 6}),
                       ab_high = __builtin_shuffle(a.v, b.v, I{1, 5, 3, 7});
  const Simd<4>::Lanes cd_low = __builtin_shuffle(c.v, d.v, I{0, 4, 2, 6}),
                       cd_high = __builtin_shuffle(c.v, d.v, I{1, 5, 3, 7});
  a = __builtin_shuffle(ab_low, cd_low, I{0, 1, 4, 5});
  b = __builtin_shuffle(ab_high, cd_high, I{0, 1, 4, 5});
  c = __builtin_shuffle(ab_low, cd_low, I{2, 3, 6, 7});
  d = __builtin_shuffle(ab_high, cd_high, I{2, 3, 6, 7});
}

// A cache line as the loop over pairs reads and writes it: two rows of four.
#if defined(__AVX512F__)
using Line = Simd<8>;
#else
struct Line {
  Simd<4> low, high;

  Line() {}
  Line(Simd<4> low, Simd<4> high) : low(low), high(high) {}
  Line(double a, double b, double c, double d, double e, double f, double g, double h)
      : low(a, b, c, d), high(e, f, g, h) {}
  static Line load(const double* p) { return {Simd<4>::load(p), Simd<4>::load(p + 4)}; }
  void store(double* p) const { low.store(p), high.store(p + 4); }
  friend Line operator*(Line a, Line b) { return {a.low * b.low, a.high * b.high}; }
  friend Line fma(Line a, Line b, Line c) { return {fma(a.low, b.low, c.low), fma(a.high, b.high, c.high)}; }
};
#endif

// A line of two rows that are apart in memory.
[[gnu::always_inline]] inline Line line_of(const double* low, const double* high) {
#if defined(__AVX512F__)
  return _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_load_pd(low)), _mm256_load_pd(high), 1);
#else
  return {Simd<4>::load(low), Simd<4>::load(high)};
#endif
}
// `low`, then four times `high`.
[[gnu::always_inline]] inline Line line_of(Simd<4> low, double high) {
#if defined(__AVX512F__)
  return _mm512_mask_broadcastsd_pd(_mm512_castpd256_pd512(low.v), 0xf0, _mm_set_sd(high));
#else
  return {low, high};
#endif
}

// One line for each lane of a Pack, and the eight packs with one number of each line.
#if defined(__AVX512F__)
[[gnu::always_inline]] inline void transpose_eight(const Simd<8> (&from)[8], Simd<8> (&to)[8]) {
  using I = Simd<8>::Bits;
  Simd<8>::Lanes a[8], b[8];
  for (int k = 0; k < 8; k += 2) {
    a[k] = __builtin_shuffle(from[k].v, from[k + 1].v, I{0, 8, 2, 10, 4, 12, 6, 14});
    a[k + 1] = __builtin_shuffle(from[k].v, from[k + 1].v, I{1, 9, 3, 11, 5, 13, 7, 15});
  }
  for (int k = 0; k < 8; k += 4)
    for (int q = 0; q < 2; ++q) {
      b[k + q] = __builtin_shuffle(a[k + q], a[k + q + 2], I{0, 1, 8, 9, 4, 5, 12, 13});
      b[k + q + 2] = __builtin_shuffle(a[k + q], a[k + q + 2], I{2, 3, 10, 11, 6, 7, 14, 15});
    }
  for (int q = 0; q < 4; ++q) {
    to[q] = __builtin_shuffle(b[q], b[q + 4], I{0, 1, 2, 3, 8, 9, 10, 11});
    to[q + 4] = __builtin_shuffle(b[q], b[q + 4], I{4, 5, 6, 7, 12, 13, 14, 15});
  }
}
[[gnu::always_inline]] inline void to_columns(const Line (&lines)[8], Pack (&columns)[8]) {
  transpose_eight(lines, columns);
}
[[gnu::always_inline]] inline void to_lines(const Pack (&columns)[8], Line (&lines)[8]) {
  transpose_eight(columns, lines);
}
#else
[[gnu::always_inline]] inline void to_columns(const Line (&lines)[4], Pack (&columns)[8]) {
  for (int k = 0; k < 4; ++k) columns[k] = lines[k].low, columns[4 + k] = lines[k].high;
  for (int half = 0; half < 8; half += 4)
    transpose(columns[half], columns[half + 1], columns[half + 2], columns[half + 3]);
}
[[gnu::always_inline]] inline void to_lines(const Pack (&columns)[8], Line (&lines)[4]) {
  Pack c[8];
  for (int k = 0; k < 8; ++k) c[k] = columns[k];
  for (int half = 0; half < 8; half += 4) transpose(c[half], c[half + 1], c[half + 2], c[half + 3]);
  for (int k = 0; k < 4; ++k) lines[k] = {c[k], c[4 + k]};
}
#endif

#endif

MORAINE_HD double round(double a) { return ::rint(a); }

}  // namespace moraine
