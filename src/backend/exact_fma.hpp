// fma for x86-64 processors that have none: a b + c rounded once, so that they compute the bits of all
// others. Sums and products are split into a rounded number and its exact error. Two lanes at a time; the C
// library's takes several times as long.
#pragma once
#include <algorithm>
#include <cmath>

namespace moraine::exact {

using Two = double __attribute__((vector_size(16)));
using TwoBits = long long __attribute__((vector_size(16)));

struct Split {
  Two rounded, error;  // their sum is exact
};

[[gnu::always_inline]] inline Split sum(Two a, Two b) {
  const Two s = a + b, part = s - a;
  return {s, (a - (s - part)) + (b - part)};
}

[[gnu::always_inline]] inline Split product(Two a, Two b) {
  const Two p = a * b, ta = 134217729.0 * a, tb = 134217729.0 * b;  // 2^27 + 1: halves of 26 bits
  const Two ah = ta - (ta - a), al = a - ah, bh = tb - (tb - b), bl = b - bh;
  return {p, ((ah * bh - p) + ah * bl + al * bh) + al * bl};
}

[[gnu::always_inline]] inline Two magnitude(Two a) { return Two(TwoBits(a) & 0x7fffffffffffffff); }

// In every case. After Boldo and Melquiond (2008), Emulation of a FMA and correctly rounded sums: the last
// sum but one is rounded to odd.
[[gnu::noinline]] inline Two any_fma(Two a, Two b, Two c) {
  const Split ab = product(a, b), low = sum(c, ab.error), high = sum(ab.rounded, low.rounded);
  const Split rest = sum(low.error, high.error);
  // To odd: where the sum is not exact and even, its neighbour on the side of the error.
  const TwoBits even = (TwoBits(rest.rounded) & 1) == 0, inexact = rest.error != 0;
  const TwoBits away = (rest.error > 0) == (rest.rounded > 0);
  const TwoBits step = inexact & even & ((away & 1) | (~away & -1));
  Two value = high.rounded + Two(TwoBits(rest.rounded) + step);
  // That holds where nothing overflows, and no error falls below the least number.
  for (int k = 0; k < 2; ++k) {
    const double size = std::max({std::abs(a[k]), std::abs(b[k]), std::abs(c[k]), std::abs(ab.rounded[k])});
    if (!(size < 0x1p990 && std::abs(ab.rounded[k]) > 0x1p-960)) value[k] = ::fma(a[k], b[k], c[k]);
  }
  return value;
}

[[gnu::noinline]] inline Two fma(Two a, Two b, Two c) {
  const Split ab = product(a, b), all = sum(ab.rounded, c);
  const Two rest = all.error + ab.error;  // rounded, which seldom matters: if it may, the next two differ
  const Two below = all.rounded + rest * (1 - 0x1p-51), above = all.rounded + rest * (1 + 0x1p-51);
  const TwoBits no_product = (a == 0) | (b == 0);
  const TwoBits right = no_product | ((below == above) & (magnitude(ab.rounded) > 0x1p-960));
  if (!(right[0] & right[1])) [[unlikely]]
    return any_fma(a, b, c);
  return no_product ? all.rounded : below;  // the former has the sign of a zero
}

}  // namespace moraine::exact
