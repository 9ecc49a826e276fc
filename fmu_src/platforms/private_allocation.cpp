// operator new and delete of the library's own, for Mach-O: those of the C++ library would be exported, and the dynamic
// linker would then share them with everything else in the process.
#include <cstdlib>
#include <new>

#define HIDDEN __attribute__((visibility("hidden")))

namespace {

void* allocated(std::size_t size, std::size_t alignment) {
  void* memory = nullptr;
  if (posix_memalign(&memory, alignment, size == 0 ? 1 : size) != 0) throw std::bad_alloc();
  return memory;
}

constexpr std::size_t usual = __STDCPP_DEFAULT_NEW_ALIGNMENT__;

}  // namespace

HIDDEN void* operator new(std::size_t size) { return allocated(size, usual); }
HIDDEN void* operator new[](std::size_t size) { return allocated(size, usual); }
HIDDEN void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocated(size, static_cast<std::size_t>(alignment));
}
HIDDEN void* operator new[](std::size_t size, std::align_val_t alignment) {
  return allocated(size, static_cast<std::size_t>(alignment));
}
HIDDEN void operator delete(void* memory) noexcept { std::free(memory); }
HIDDEN void operator delete[](void* memory) noexcept { std::free(memory); }
HIDDEN void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
HIDDEN void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
HIDDEN void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
HIDDEN void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
HIDDEN void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
HIDDEN void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
