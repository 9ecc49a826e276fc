#include "equilibrium/equilibrium_verdict.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "equilibrium/equilibrium.hpp"
#include "equilibrium/hessian_bounds.hpp"

namespace mixed_order_game {

namespace {

/// The largest of some distances within which a cost is proved convex.
Real proved_distance(const HessianBounds& bounds, int i, const std::vector<Real>& x, const Shape& shape) {
  constexpr Real everywhere = std::numeric_limits<Real>::infinity();
  if (bounds.is_convex(i, x, everywhere)) return everywhere;
  Real size = 1.0;
  for (int l = 0; l < shape.dimension; ++l) size = std::max(size, std::abs(x[at(shape.entry(i, l))]));
  for (int exponent = 12; exponent >= -6; --exponent) {
    const Real distance = std::ldexp(1.0, std::ilogb(size) + exponent);
    if (bounds.is_convex(i, x, distance)) return distance;
  }
  return 0.0;
}

}  // namespace

EquilibriumVerdict judge_equilibrium(const Parameters& parameters,
                                     const std::vector<ExpressionCost::Text>& cost_expressions) {
  constexpr Real rounding = 1e-12;
  constexpr Real everywhere = std::numeric_limits<Real>::infinity();
  const Shape& shape = parameters.shape;
  const Cost& cost = *parameters.cost;
  EquilibriumVerdict verdict;
  verdict.x_star = nash_equilibrium(cost, shape, parameters.guess);
  verdict.monotonicity = strong_monotonicity(cost, verdict.x_star);
  const HessianBounds bounds(parameters, cost_expressions);
  bool is_nash = true;
  bool is_local = true;
  verdict.is_affine = true;
  for (int i = 0; i < shape.players; ++i) {
    const auto [smallest, scale] = own_curvature(cost, shape, i, verdict.x_star);
    const bool is_quadratic = cost_expressions[at(i)].graph == nullptr;
    const Real distance = is_quadratic ? everywhere : proved_distance(bounds, i, verdict.x_star, shape);
    const Switch* kink = is_quadratic ? nullptr : bounds.kink_at(i, verdict.x_star);
    verdict.players.push_back({smallest, distance, kink == nullptr ? "" : kink->text});
    verdict.is_affine = verdict.is_affine && bounds.has_affine_gradient(i);
    is_nash = is_nash && distance == everywhere;
    is_local = is_local && (distance > 0.0 || (kink == nullptr && smallest > rounding * scale));
  }
  verdict.kind = is_nash    ? EquilibriumVerdict::Kind::nash
                 : is_local ? EquilibriumVerdict::Kind::local_nash
                            : EquilibriumVerdict::Kind::open;
  if (!verdict.is_affine) verdict.others = other_equilibria(cost, shape, verdict.x_star);
  std::vector<Real> gradient(at(shape.actions()));
  cost.own_gradients(parameters.initial.y.data(), shape.actions(), gradient.data());
  for (int i = 0; i < shape.players; ++i) {
    bool is_defined = true;
    for (int l = 0; l < shape.dimension; ++l) is_defined = is_defined && std::isfinite(gradient[at(shape.entry(i, l))]);
    if (!is_defined) verdict.undefined_at_start.push_back(i);
  }
  return verdict;
}

}  // namespace mixed_order_game
