#include "families/expression_disturbance.hpp"

#include <algorithm>

namespace mixed_order_game {

LeafValues ExpressionDisturbance::leaves(Real t, const Real* held) const {
  LeafValues leaves{.time = time_origin + t, .parameters = coefficients.named.data(), .held = held};
  if (held == nullptr && switching_.count() != 0) {
    switching_.own_values(leaves, time_origin, t, held_there_.data());
    leaves.held = held_there_.data();
  }
  return leaves;
}

void ExpressionDisturbance::values(Real t, Real* d, const Real* held) const {
  if (is_none()) {
    std::fill_n(d, own_entries(), 0.0);
    values_.values(leaves(t, held), d);
    return;
  }
  SinusoidalDisturbance::values(t, d);
  scratch_.assign(at(own_entries()), 0.0);
  values_.values(leaves(t, held), scratch_.data());
  for (std::size_t p = 0; p < scratch_.size(); ++p) d[p] += scratch_[p];
}

void ExpressionDisturbance::values(const CoefficientsAs<Dual>& along, const Dual& t, Dual* d, const Real* held) const {
  SinusoidalDisturbance::values(along, t, d);
  const Dual absolute = time_origin + t;
  if (held == nullptr) held = leaves(t.value, nullptr).held;
  values_.add_values({.time = &absolute, .coefficients = &along, .held = held}, d);
}

void ExpressionDisturbance::values(const CoefficientsAs<Dependencies>& of, const Dependencies& t,
                                   Dependencies* d) const {
  SinusoidalDisturbance::values(of, t, d);
  values_.add_values({.time = &t, .coefficients = &of}, d);
}

}  // namespace mixed_order_game
