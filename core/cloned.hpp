// A pointer to a polymorphic value that is copied with its owner.
#pragma once

#include <memory>

namespace mixed_order_game {

template <typename Interface>
class Cloned {
 public:
  explicit Cloned(std::unique_ptr<Interface> value) : value_(std::move(value)) {}
  Cloned(const Cloned& other) : value_(other.value_->clone()) {}
  Cloned(Cloned&&) noexcept = default;
  Cloned& operator=(const Cloned& other) {
    if (this != &other) value_ = other.value_->clone();
    return *this;
  }
  Cloned& operator=(Cloned&&) noexcept = default;
  ~Cloned() = default;

  Interface& operator*() const { return *value_; }
  Interface* operator->() const { return value_.get(); }

 private:
  std::unique_ptr<Interface> value_;
};

}  // namespace mixed_order_game
