#include "families/expression_disturbance.hpp"

namespace mixed_order_game {

void ExpressionDisturbance::values(Real t, Real* d) const {
  SinusoidalDisturbance::values(t, d);
  scratch_.assign(at(own_entries()), 0.0);
  values_.values({.time = t, .parameters = coefficients.named.data()}, scratch_.data());
  for (std::size_t p = 0; p < scratch_.size(); ++p) d[p] += scratch_[p];
}

void ExpressionDisturbance::values(const CoefficientsAs<Dual>& along, const Dual& t, Dual* d) const {
  SinusoidalDisturbance::values(along, t, d);
  values_.add_values({.time = &t, .coefficients = &along}, d);
}

void ExpressionDisturbance::values(const CoefficientsAs<Dependencies>& of, const Dependencies& t,
                                   Dependencies* d) const {
  SinusoidalDisturbance::values(of, t, d);
  values_.add_values({.time = &t, .coefficients = &of}, d);
}

}  // namespace mixed_order_game
