#include "families/quadratic_cost.hpp"

#include <algorithm>

namespace mixed_order_game {

namespace {

constexpr Coefficient declared[] = {
    {.key = "quadratic",
     .variable = "cost_quadratic",
     .description = "Coefficient of |x_i|^2 in f_i",
     .indices = Indices::player,
     .declared_type = "CostCoefficient",
     .unit = {"1", "1"},
     .moves_equilibrium = true},
    {.key = "linear",
     .variable = "cost_linear",
     .description = "Coefficient of x_il in f_i",
     .indices = Indices::entry,
     .declared_type = "CostCoefficient",
     .unit = {"1", "1"},
     .moves_equilibrium = true},
    {.key = "constant", .indices = Indices::player},
    {.key = "coupling",
     .variable = "cost_coupling",
     .description = "Coefficient of |x_i - x_j|^2 in f_i",
     .symbol = "c_ij",
     .indices = Indices::pair,
     .declared_type = "CostCoefficient",
     .unit = {"1", "1"},
     .moves_equilibrium = true},
};

// grad_il f_i = 2 q_i x_il + l_il + sum_j 2 c_ij (x_il - x_jl); couplings(visit) calls visit(j, c_ij).
template <typename Scalar, typename Couplings>
Scalar own_gradient(int i, const Scalar& quadratic, const Scalar& linear, const Scalar* row, Couplings couplings) {
  Scalar pull = quadratic * row[i];
  couplings([&](int j, const Scalar& c) { pull += c * (row[i] - row[j]); });
  return 2.0 * pull + linear;
}

}  // namespace

QuadraticCost::QuadraticCost(int players, int dimension)
    : Cost(Coefficients(declared, players, dimension)), players_(players), dimension_(dimension) {
  refresh();
}

std::unique_ptr<Cost> QuadraticCost::clone() const { return std::make_unique<QuadraticCost>(*this); }

Real QuadraticCost::value(int i, const Real* x) const {
  Real cost = coefficients[constant][at(i)];
  for (int l = 0; l < dimension_; ++l) {
    const Real* row = x + l * players_;
    cost += coefficients[quadratic][at(i)] * row[i] * row[i] + coefficients[linear][at(l * players_ + i)] * row[i];
    for (int k = neighbours_.start[at(i)]; k < neighbours_.start[at(i + 1)]; ++k) {
      const Real difference = row[i] - row[neighbours_.column[at(k)]];
      cost += neighbour_cost_[at(k)] * difference * difference;
    }
  }
  return cost;
}

void QuadraticCost::own_gradients(const Real* points, int stride, Real* gradient) const {
  const std::vector<Real>& q = coefficients[quadratic];
  const std::vector<Real>& l_il = coefficients[linear];
  for (int l = 0; l < dimension_; ++l) {
    for (int i = 0; i < players_; ++i) {
      const Real* row = points + i * stride + l * players_;
      const int p = l * players_ + i;
      gradient[p] = own_gradient(i, q[at(i)], l_il[at(p)], row, [&](auto visit) {
        for (int k = neighbours_.start[at(i)]; k < neighbours_.start[at(i + 1)]; ++k) {
          visit(neighbours_.column[at(k)], neighbour_cost_[at(k)]);
        }
      });
    }
  }
}

template <typename Scalar>
void QuadraticCost::own_gradients_as(const CoefficientsAs<Scalar>& coefficients_as, const Scalar* points, int stride,
                                     Scalar* gradient) const {
  for (int l = 0; l < dimension_; ++l) {
    for (int i = 0; i < players_; ++i) {
      const Scalar* row = points + i * stride + l * players_;
      const int p = l * players_ + i;
      gradient[p] =
          own_gradient(i, coefficients_as.value(quadratic, i), coefficients_as.value(linear, p), row, [&](auto visit) {
            for (int j = 0; j < players_; ++j) {
              const int slot = i * players_ + j;
              if (!coefficients_as.vanishes(coupling, slot)) visit(j, coefficients_as.value(coupling, slot));
            }
          });
    }
  }
}

void QuadraticCost::own_gradients(const CoefficientsAs<Dual>& along, const Dual* points, int stride,
                                  Dual* gradient) const {
  own_gradients_as(along, points, stride, gradient);
}

void QuadraticCost::own_gradients(const CoefficientsAs<Dependencies>& of, const Dependencies* points, int stride,
                                  Dependencies* gradient) const {
  own_gradients_as(of, points, stride, gradient);
}

void QuadraticCost::hessian_rows(const Real* /*points*/, int /*stride*/, Real* values) const {
  std::copy(hessian_.begin(), hessian_.end(), values);
}

void QuadraticCost::refresh() {
  neighbours_ = {};
  neighbour_cost_.clear();
  for (int i = 0; i < players_; ++i) {
    for (int j = 0; j < players_; ++j) {
      const Real c = coefficients[coupling][at(i) * at(players_) + at(j)];
      if (j != i && c != 0.0) {
        neighbours_.column.push_back(j);
        neighbour_cost_.push_back(c);
      }
    }
    neighbours_.start.push_back(neighbours_.entries());
  }
  pattern_ = {};
  hessian_.clear();
  for (int l = 0; l < dimension_; ++l) {
    for (int i = 0; i < players_; ++i) {
      // d^2 f_i / d x_il^2 = 2 q_i + sum_j 2 c_ij,  d^2 f_i / (d x_il d x_jl) = -2 c_ij
      Real own = 2.0 * coefficients[quadratic][at(i)];
      std::vector<std::pair<int, Real>> row;
      for (int k = neighbours_.start[at(i)]; k < neighbours_.start[at(i + 1)]; ++k) {
        own += 2.0 * neighbour_cost_[at(k)];
        row.emplace_back(l * players_ + neighbours_.column[at(k)], -2.0 * neighbour_cost_[at(k)]);
      }
      row.emplace_back(l * players_ + i, own);
      std::sort(row.begin(), row.end());
      for (const auto& [column, value] : row) {
        pattern_.column.push_back(column);
        hessian_.push_back(value);
      }
      pattern_.start.push_back(pattern_.entries());
    }
  }
}

}  // namespace mixed_order_game
