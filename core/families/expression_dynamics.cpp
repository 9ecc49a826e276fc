#include "families/expression_dynamics.hpp"

#include <algorithm>

namespace mixed_order_game {

ExpressionDynamics::ExpressionDynamics(PolynomialDynamics coefficients_of, PlayerExpressions values,
                                       Switching switching)
    : PolynomialDynamics(std::move(coefficients_of)),
      values_(std::move(values)),
      switching_(std::move(switching)),
      held_there_(at(switching_.count())) {
  unite(PolynomialDynamics::jacobian_pattern(), values_.pattern(LeafKind::action), pattern_, polynomial_place_,
        expression_place_);
}

LeafValues ExpressionDynamics::leaves(const Real* x, const Real* v, const Real* held) const {
  LeafValues leaves{.points = x, .stride = 0, .velocities = v, .parameters = coefficients.named.data(), .held = held};
  if (held == nullptr && switching_.count() != 0) {
    switching_.own_values(leaves, 0.0, 0.0, held_there_.data());
    leaves.held = held_there_.data();
  }
  return leaves;
}

void ExpressionDynamics::values(const Real* x, const Real* v, Real* g, const Real* held) const {
  PolynomialDynamics::values(x, v, g);
  scratch_.assign(at(pattern_.rows()), 0.0);
  values_.values(leaves(x, v, held), scratch_.data());
  for (int p = 0; p < pattern_.rows(); ++p) g[p] += coefficients[gain][at(shape().player_of_own(p))] * scratch_[at(p)];
}

template <typename Scalar>
void ExpressionDynamics::add_expressions(const CoefficientsAs<Scalar>& of, const Scalar* x, const Scalar* v, Scalar* g,
                                         const Real* held) const {
  std::vector<Scalar> values(at(pattern_.rows()));
  values_.add_values({.points = x, .stride = 0, .velocities = v, .coefficients = &of, .held = held}, values.data());
  for (int p = 0; p < pattern_.rows(); ++p) g[p] += of.value(gain, shape().player_of_own(p)) * values[at(p)];
}

void ExpressionDynamics::values(const CoefficientsAs<Dual>& along, const Dual* x, const Dual* v, Dual* g,
                                const Real* held) const {
  PolynomialDynamics::values(along, x, v, g);
  if (held == nullptr && switching_.count() != 0) {
    std::vector<Real> actions;
    std::vector<Real> velocities;
    for (int p = 0; p < shape().actions(); ++p) {
      actions.push_back(x[p].value);
      velocities.push_back(v[p].value);
    }
    held = leaves(actions.data(), velocities.data(), nullptr).held;
  }
  add_expressions(along, x, v, g, held);
}

void ExpressionDynamics::values(const CoefficientsAs<Dependencies>& of, const Dependencies* x, const Dependencies* v,
                                Dependencies* g) const {
  PolynomialDynamics::values(of, x, v, g);
  add_expressions(of, x, v, g, nullptr);
}

std::vector<int> ExpressionDynamics::actions_used() const {
  std::vector<int> used = PolynomialDynamics::actions_used();
  const std::vector<int>& in_texts = values_.used(LeafKind::action);
  used.insert(used.end(), in_texts.begin(), in_texts.end());
  return used;
}

void ExpressionDynamics::jacobian(const Real* x, const Real* v, Real* values, const Real* held) const {
  std::fill_n(values, pattern_.entries(), 0.0);
  scratch_.resize(std::max(polynomial_place_.size(), expression_place_.size()));
  PolynomialDynamics::jacobian(x, v, scratch_.data());
  for (std::size_t k = 0; k < polynomial_place_.size(); ++k) values[polynomial_place_[k]] += scratch_[k];
  const SparseRows& expressions = values_.pattern(LeafKind::action);
  values_.derivatives(LeafKind::action, leaves(x, v, held), scratch_.data());
  for (int p = 0; p < expressions.rows(); ++p) {
    for (int k = expressions.start[at(p)]; k < expressions.start[at(p + 1)]; ++k) {
      values[expression_place_[at(k)]] += coefficients[gain][at(shape().player_of_own(p))] * scratch_[at(k)];
    }
  }
}

void ExpressionDynamics::velocity_jacobian(const Real* x, const Real* v, Real* values, const Real* held) const {
  const SparseRows& rows = velocity_pattern();
  values_.derivatives(LeafKind::velocity, leaves(x, v, held), values);
  for (int p = 0; p < rows.rows(); ++p) {
    for (int k = rows.start[at(p)]; k < rows.start[at(p + 1)]; ++k) {
      values[k] *= coefficients[gain][at(shape().player_of_own(p))];
    }
  }
}

}  // namespace mixed_order_game
