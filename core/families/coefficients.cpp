#include "families/coefficients.hpp"

namespace mixed_order_game {

Coefficients::Coefficients(std::span<const Coefficient> declared, int players, int dimension)
    : declared_(declared), players_(players), dimension_(dimension), terms_(declared.size()) {
  for (const Coefficient& coefficient : declared) {
    const bool listed = coefficient.indices != Indices::term;
    values_.emplace_back(listed ? at(slots(coefficient.indices)) : 0, coefficient.start);
  }
}

int Coefficients::slots(Indices indices) const {
  switch (indices) {
    case Indices::player:
      return players_;
    case Indices::entry:
      return players_ * dimension_;
    case Indices::pair:
      return players_ * players_;
    case Indices::term:
      return players_ * dimension_ * players_;
  }
  return 0;
}

Real Coefficients::value(int number, int slot) const {
  if (declared_[at(number)].indices != Indices::term) return values_[at(number)][at(slot)];
  const auto found = terms_[at(number)].find(slot);
  return found == terms_[at(number)].end() ? 0.0 : found->second;
}

void Coefficients::set(int number, int slot, Real value) {
  if (declared_[at(number)].indices != Indices::term) {
    values_[at(number)][at(slot)] = value;
  } else {
    terms_[at(number)][slot] = value;
  }
}

void Coefficients::set_all_to_zero() {
  for (std::vector<Real>& values : values_) values.assign(values.size(), 0.0);
  for (std::map<int, Real>& terms : terms_) terms.clear();
}

}  // namespace mixed_order_game
