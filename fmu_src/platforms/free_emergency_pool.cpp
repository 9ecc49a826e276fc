// The static C++ library allocates a pool for exceptions that are thrown when memory is short, 71 KiB, and keeps it
// when the FMU is unloaded, because a process that ends needs no cleaning. An importer that loads the FMU a thousand
// times does.

namespace __gnu_cxx {
[[gnu::weak]] void __freeres() noexcept;  // not in every C++ library
}

namespace {

[[gnu::destructor]] void free_emergency_pool() {
  if (__gnu_cxx::__freeres != nullptr) __gnu_cxx::__freeres();
}

}  // namespace
