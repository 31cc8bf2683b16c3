// Compiled for any x86-64 processor, and run before all else: where the rest was compiled for a newer one
// than this, it says so instead of dying of an illegal instruction.
#if defined(__x86_64__) && (defined(MORAINE_NEEDS_AVX2) || defined(MORAINE_NEEDS_SSE4))
#include <unistd.h>

#include <string_view>

__attribute__((constructor(101))) static void check_processor() {
  __builtin_cpu_init();
#if defined(MORAINE_NEEDS_AVX2)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return;
  constexpr std::string_view what =
      "moraine: this processor has no AVX2 and FMA, for which the program was built; build it here, or with "
      "-DMORAINE_ARCH=x86-64\n";
#else
  if (__builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("popcnt")) return;
  constexpr std::string_view what =
      "moraine: this processor has no SSE4.2 and POPCNT (x86-64-v2), the least that this build works with; "
      "build it from the sources, with -DMORAINE_ARCH=x86-64\n";
#endif
  if (write(STDERR_FILENO, what.data(), what.size()) < 0) _exit(3);
  _exit(2);
}
#endif
