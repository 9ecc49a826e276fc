// Vectors of numbers that begin on a cache line, so that the kernels' loads never depend on the heap's mood.
#pragma once

#include <new>
#include <vector>

#include "types.hpp"

namespace mixed_order_game {

template <typename Value>
struct CacheLineAllocator {
  using value_type = Value;
  static constexpr std::align_val_t alignment{64};

  CacheLineAllocator() = default;
  template <typename Other>
  constexpr explicit CacheLineAllocator(const CacheLineAllocator<Other>& /*other*/) noexcept {}

  Value* allocate(std::size_t count) { return static_cast<Value*>(::operator new(count * sizeof(Value), alignment)); }
  void deallocate(Value* values, std::size_t /*count*/) noexcept { ::operator delete(values, alignment); }

  friend bool operator==(const CacheLineAllocator&, const CacheLineAllocator&) { return true; }
};

using AlignedVector = std::vector<Real, CacheLineAllocator<Real>>;

}  // namespace mixed_order_game
