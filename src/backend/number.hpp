// Number types for the physics: double, and Pack, four doubles in SIMD lanes. The same formula serves both
// through
// + - * /, fma, sqrt, min, max and select; each lane of a Pack gives the same bits as the double formula,
// because fma is always spelled out and the compiler is told not to contract on its own (-ffp-contract=off,
// --fmad=false).
#pragma once
#include <cmath>

#include "backend/host_device.hpp"
#if defined(__AVX__) && !defined(__CUDACC__)
#include <immintrin.h>
#endif

// x86-64 without FMA: fma takes other instructions, and a multiple of the time, for the same bits.
#if defined(__x86_64__) && !defined(__FMA__) && !defined(__CUDACC__)
#define MORAINE_EMULATES_FMA
#include "backend/exact_fma.hpp"
#endif

namespace moraine {

MORAINE_HD double fma(double a, double b, double c) {
#if defined(MORAINE_EMULATES_FMA)
  return exact::fma(exact::Two{a, a}, exact::Two{b, b}, exact::Two{c, c})[0];
#else
  return ::fma(a, b, c);
#endif
}
MORAINE_HD double fnma(double a, double b, double c) { return fma(-a, b, c); }  // c - a b
MORAINE_HD double sqrt(double a) { return ::sqrt(a); }
MORAINE_HD double min(double a, double b) { return a < b ? a : b; }
MORAINE_HD double max(double a, double b) { return a > b ? a : b; }
MORAINE_HD double select(bool mask, double a, double b) { return mask ? a : b; }

// The sine to some 1e-16, the same bits on every processor, which libraries do not promise.
MORAINE_HD double sine(double x) {
  // x = k pi/2 + r. pi/2 in three parts, of which the first two have 33 bits: k times them is exact.
  const double k = ::floor(x * 0x1.45f306dc9c883p-1 + 0.5);
  const double r = x - k * 0x1.921fb54400000p+0 - k * 0x1.0b4611a600000p-34 - k * 0x1.3198a2e037073p-69;
  const double r2 = r * r;
  const double quarter = k - 4 * ::floor(0.25 * k);
  const bool by_cosine = quarter == 1 || quarter == 3;
  double sum = 0;  // of the series behind its first term
  for (int n = by_cosine ? 18 : 19; n > 1; n -= 2) sum = fma(-r2 / (n * (n - 1)), sum, -r2 / (n * (n - 1)));
  const double value = by_cosine ? 1 + sum : fma(r, sum, r);
  return quarter < 2 ? value : -value;
}

#ifndef __CUDACC__

struct Pack {
  static constexpr int width = 4;
  using Lanes = double __attribute__((vector_size(32)));
  using Bits = long long __attribute__((vector_size(32)));
  Lanes v;

  Pack() {}
  // Spelled out so that GCC copies structs of packs by whole lanes rather than by eight bytes at a time
  // (measured: 1.5x).
  Pack(const Pack& other) : v(other.v) {}
  Pack& operator=(const Pack& other) {
    v = other.v;
    return *this;
  }
  Pack(Lanes lanes) : v(lanes) {}
  Pack(double all) : v(Lanes{all, all, all, all}) {}
  Pack(double a, double b, double c, double d) : v(Lanes{a, b, c, d}) {}

  // p must be aligned to 32 bytes.
  static Pack load(const double* p) { return *reinterpret_cast<const Lanes*>(p); }
  void store(double* p) const { *reinterpret_cast<Lanes*>(p) = v; }
  double operator[](int lane) const { return v[lane]; }

  friend Pack operator+(Pack a, Pack b) { return a.v + b.v; }
  friend Pack operator-(Pack a, Pack b) { return a.v - b.v; }
  friend Pack operator*(Pack a, Pack b) { return a.v * b.v; }
  friend Pack operator/(Pack a, Pack b) { return a.v / b.v; }
  friend Pack operator-(Pack a) { return -a.v; }
  Pack& operator+=(Pack b) { return *this = *this + b; }

  struct Mask {
    Bits b;
    friend Mask operator&(Mask a, Mask c) { return {a.b & c.b}; }
  };
  friend Mask operator<(Pack a, Pack b) { return {a.v < b.v}; }
  friend Mask operator>(Pack a, Pack b) { return {a.v > b.v}; }
  friend Pack select(Mask m, Pack a, Pack b) { return m.b ? a.v : b.v; }
  // Bit k says what lane k does.
  friend unsigned bits(Mask m) {
#if defined(__AVX__)
    return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<__m256d>(m.b)));
#else
    return (m.b[0] & 1) | (m.b[1] & 2) | (m.b[2] & 4) | (m.b[3] & 8);
#endif
  }
};

#if defined(__FMA__)
inline Pack fma(Pack a, Pack b, Pack c) { return _mm256_fmadd_pd(a.v, b.v, c.v); }
inline Pack fnma(Pack a, Pack b, Pack c) { return _mm256_fnmadd_pd(a.v, b.v, c.v); }
#elif defined(MORAINE_EMULATES_FMA)
inline Pack fma(Pack a, Pack b, Pack c) {
  const auto low = [](Pack p) { return __builtin_shufflevector(p.v, p.v, 0, 1); };
  const auto high = [](Pack p) { return __builtin_shufflevector(p.v, p.v, 2, 3); };
  return Pack::Lanes(__builtin_shufflevector(exact::fma(low(a), low(b), low(c)),
                                             exact::fma(high(a), high(b), high(c)), 0, 1, 2, 3));
}
inline Pack fnma(Pack a, Pack b, Pack c) { return fma(-a, b, c); }
#else  // lane by lane; compilers make vectors of it
inline Pack fma(Pack a, Pack b, Pack c) {
  return {::fma(a[0], b[0], c[0]), ::fma(a[1], b[1], c[1]), ::fma(a[2], b[2], c[2]), ::fma(a[3], b[3], c[3])};
}
inline Pack fnma(Pack a, Pack b, Pack c) { return fma(-a, b, c); }
#endif
#if defined(__AVX__)
inline Pack sqrt(Pack a) { return _mm256_sqrt_pd(a.v); }
inline Pack round(Pack a) { return _mm256_round_pd(a.v, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC); }
#else
inline Pack sqrt(Pack a) { return {::sqrt(a[0]), ::sqrt(a[1]), ::sqrt(a[2]), ::sqrt(a[3])}; }
inline Pack round(Pack a) { return {::rint(a[0]), ::rint(a[1]), ::rint(a[2]), ::rint(a[3])}; }
#endif
inline Pack min(Pack a, Pack b) { return select(a < b, a, b); }
inline Pack max(Pack a, Pack b) { return select(a > b, a, b); }
inline Pack abs(Pack a) {
  const Pack sign(-0.0);
  return Pack::Lanes(Pack::Bits(a.v) & ~Pack::Bits(sign.v));
}

// Rows a, b, c, d become columns.
[[gnu::always_inline]] inline void transpose(Pack& a, Pack& b, Pack& c, Pack& d) {
  const Pack::Lanes ab_low = __builtin_shufflevector(a.v, b.v, 0, 4, 2, 6),
                    ab_high = __builtin_shufflevector(a.v, b.v, 1, 5, 3, 7);
  const Pack::Lanes cd_low = __builtin_shufflevector(c.v, d.v, 0, 4, 2, 6),
                    cd_high = __builtin_shufflevector(c.v, d.v, 1, 5, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  c = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

// The sums of all lanes of a, b and c, in the first three lanes; each as (0 + 1) + (2 + 3).
inline Pack sums_of(Pack a, Pack b, Pack c) {
#if defined(__AVX__)
  const __m256d ab = _mm256_hadd_pd(a.v, b.v), c_ = _mm256_hadd_pd(c.v, _mm256_setzero_pd());
  return _mm256_add_pd(_mm256_permute2f128_pd(ab, c_, 0x21), _mm256_blend_pd(ab, c_, 0b1100));
#else
  const auto sum = [](Pack p) { return (p[0] + p[1]) + (p[2] + p[3]); };
  return {sum(a), sum(b), sum(c), 0};
#endif
}

// A cache line of eight doubles: two rows of four.
struct Line {
  Pack low, high;

  // p must be aligned to 64 bytes.
  static Line load(const double* p) { return {Pack::load(p), Pack::load(p + 4)}; }
  void store(double* p) const { low.store(p), high.store(p + 4); }
  friend Line operator*(Line a, Line b) { return {a.low * b.low, a.high * b.high}; }
  friend Line fma(Line a, Line b, Line c) { return {fma(a.low, b.low, c.low), fma(a.high, b.high, c.high)}; }
};

// One line for each lane of a Pack, and eight packs, each with one number of every line.
[[gnu::always_inline]] inline void to_columns(const Line (&lines)[Pack::width], Pack (&columns)[8]) {
  for (int k = 0; k < 4; ++k) columns[k] = lines[k].low, columns[4 + k] = lines[k].high;
  for (Pack* c = columns; c != columns + 8; c += 4) transpose(c[0], c[1], c[2], c[3]);
}
[[gnu::always_inline]] inline void to_lines(const Pack (&columns)[8], Line (&lines)[Pack::width]) {
  Pack c[8];
  for (int k = 0; k < 8; ++k) c[k] = columns[k];
  for (int half = 0; half < 8; half += 4) transpose(c[half], c[half + 1], c[half + 2], c[half + 3]);
  for (int k = 0; k < 4; ++k) lines[k] = {c[k], c[4 + k]};
}

#endif

MORAINE_HD double round(double a) { return ::rint(a); }

}  // namespace moraine
