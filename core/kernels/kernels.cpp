#include "kernels.hpp"

namespace mixed_order_game {

// One table for each time that level.cpp is compiled.
extern const Kernels kernels_baseline;
#ifdef MIXED_ORDER_GAME_X86_LEVELS
extern const Kernels kernels_x86_64_v3;
extern const Kernels kernels_x86_64_v4;
#endif

int kernel_level_count() {
#ifdef MIXED_ORDER_GAME_X86_LEVELS
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0 &&
      __builtin_cpu_supports("bmi2") != 0) {
    const bool wide = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512vl") != 0 &&
                      __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
                      __builtin_cpu_supports("avx512cd") != 0;
    return wide ? 3 : 2;
  }
#endif
  return 1;
}

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
