#include "numbers/dependencies.hpp"

#include <algorithm>
#include <cmath>

namespace mixed_order_game {

Dependencies Dependencies::unknown() {
  Dependencies value;
  value.number_.reset();
  return value;
}

Dependencies Dependencies::known(int reference) {
  Dependencies value = unknown();
  value.on_.emplace_back(reference, DependencyKind::constant);
  return value;
}

Dependencies Dependencies::nonlinear() const {
  Dependencies value = *this;
  for (auto& [reference, kind] : value.on_) kind = DependencyKind::dependent;
  return value;
}

Dependencies Dependencies::scaled() const {
  Dependencies value = *this;
  for (auto& [reference, kind] : value.on_) kind = std::max(kind, DependencyKind::tunable);
  return value;
}

Dependencies& Dependencies::operator+=(const Dependencies& other) {
  if (number_ && other.number_) {
    *number_ += *other.number_;
    return *this;
  }
  number_.reset();
  if (other.on_.empty()) return *this;
  std::vector<std::pair<int, DependencyKind>> both;
  both.reserve(on_.size() + other.on_.size());
  auto a = on_.begin();
  auto b = other.on_.begin();
  while (a != on_.end() || b != other.on_.end()) {
    if (b == other.on_.end() || (a != on_.end() && a->first < b->first)) {
      both.push_back(*a++);
    } else if (a == on_.end() || b->first < a->first) {
      both.push_back(*b++);
    } else {
      both.emplace_back(a->first, std::max(a->second, b->second));
      ++a;
      ++b;
    }
  }
  on_ = std::move(both);
  return *this;
}

Dependencies operator-(const Dependencies& a) { return a.number_ ? Dependencies(-*a.number_) : a; }

Dependencies operator*(const Dependencies& a, const Dependencies& b) {
  if (a.number_ && b.number_) return *a.number_ * *b.number_;
  if (a.number_) return *a.number_ == 0.0 ? Dependencies() : b;
  if (b.number_) return *b.number_ == 0.0 ? Dependencies() : a;
  if (a.on_.empty()) return b.scaled();
  if (b.on_.empty()) return a.scaled();
  return a.nonlinear() + b.nonlinear();
}

Dependencies operator/(const Dependencies& a, const Dependencies& b) {
  if (b.number_) return a.number_ ? Dependencies(*a.number_ / *b.number_) : a;
  return a * b.nonlinear();
}

Dependencies exp(const Dependencies& a) { return a.number_ ? Dependencies(std::exp(*a.number_)) : a.nonlinear(); }
Dependencies tanh(const Dependencies& a) { return a.number_ ? Dependencies(std::tanh(*a.number_)) : a.nonlinear(); }
Dependencies sin(const Dependencies& a) { return a.number_ ? Dependencies(std::sin(*a.number_)) : a.nonlinear(); }

}  // namespace mixed_order_game
