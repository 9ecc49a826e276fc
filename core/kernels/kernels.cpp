#include "kernels.hpp"

#ifdef MIXED_ORDER_GAME_X86_LEVELS
#include <cpuid.h>

#include <algorithm>
#include <initializer_list>
#endif

namespace mixed_order_game {

// One table for each time that level.cpp is compiled.
extern const Kernels kernels_baseline;
#ifdef MIXED_ORDER_GAME_X86_LEVELS
extern const Kernels kernels_x86_64_v3;
extern const Kernels kernels_x86_64_v4;
#endif

#ifdef MIXED_ORDER_GAME_X86_LEVELS
namespace {

bool has(unsigned word, std::initializer_list<int> bits) {
  return std::all_of(bits.begin(), bits.end(), [&](int bit) { return (word >> bit & 1U) != 0; });
}

// Levels of the psABI. The processor is asked itself: not every compiler's library fills the table behind
// __builtin_cpu_supports, and it must also be known whether the system keeps the registers.
int x86_level_count() {
  unsigned eax = 0;
  unsigned ebx = 0;
  unsigned ecx = 0;
  unsigned edx = 0;
  constexpr int fma = 12, movbe = 22, osxsave = 27, avx = 28, f16c = 29;
  if (__get_cpuid(1, &eax, &ebx, &ecx, &edx) == 0 || !has(ecx, {fma, movbe, osxsave, avx, f16c})) return 1;
  constexpr int lzcnt = 5;
  if (__get_cpuid(0x80000001, &eax, &ebx, &ecx, &edx) == 0 || !has(ecx, {lzcnt})) return 1;
  constexpr int bmi1 = 3, avx2 = 5, bmi2 = 8;
  if (__get_cpuid_count(7, 0, &eax, &ebx, &ecx, &edx) == 0 || !has(ebx, {bmi1, avx2, bmi2})) return 1;

  unsigned kept = 0;
  unsigned upper = 0;
  __asm__("xgetbv" : "=a"(kept), "=d"(upper) : "c"(0));
  constexpr int xmm = 1, ymm = 2, masks = 5, upper_zmm = 6, more_zmm = 7;
  if (!has(kept, {xmm, ymm})) return 1;
  constexpr int avx512f = 16, avx512dq = 17, avx512cd = 28, avx512bw = 30, avx512vl = 31;
  return has(kept, {masks, upper_zmm, more_zmm}) && has(ebx, {avx512f, avx512dq, avx512cd, avx512bw, avx512vl}) ? 3 : 2;
}

}  // namespace

int kernel_level_count() { return x86_level_count(); }
#else
int kernel_level_count() { return 1; }
#endif

const Kernels& kernels_of_level(int level) {
#ifdef MIXED_ORDER_GAME_X86_LEVELS
  if (level == 2) return kernels_x86_64_v4;
  if (level == 1) return kernels_x86_64_v3;
#endif
  static_cast<void>(level);
  return kernels_baseline;
}

const Kernels& kernels() {
  static const Kernels& best = kernels_of_level(kernel_level_count() - 1);
  return best;
}

}  // namespace mixed_order_game
