#include "quadratic_cost.hpp"

#include <algorithm>

namespace mixed_order_game {

QuadraticCost::QuadraticCost(int players, int dimension)
    : quadratic(at(players)),
      linear(at(players) * at(dimension)),
      constant(at(players)),
      coupling(at(players) * at(players)),
      players_(players),
      dimension_(dimension) {
  refresh();
}

std::unique_ptr<Cost> QuadraticCost::clone() const { return std::make_unique<QuadraticCost>(*this); }

Real QuadraticCost::value(int i, const Real* x) const {
  Real cost = constant[at(i)];
  for (int l = 0; l < dimension_; ++l) {
    const Real* row = x + l * players_;
    cost += quadratic[at(i)] * row[i] * row[i] + linear[at(l * players_ + i)] * row[i];
    for (int k = neighbours_.start[at(i)]; k < neighbours_.start[at(i + 1)]; ++k) {
      const Real difference = row[i] - row[neighbours_.column[at(k)]];
      cost += neighbour_cost_[at(k)] * difference * difference;
    }
  }
  return cost;
}

void QuadraticCost::own_gradients(const Real* points, int stride, Real* gradient) const {
  for (int l = 0; l < dimension_; ++l) {
    for (int i = 0; i < players_; ++i) {
      const Real* row = points + i * stride + l * players_;
      // grad_il f_i = 2 q_i x_il + l_il + sum_j 2 c_ij (x_il - x_jl)
      Real pull = quadratic[at(i)] * row[i];
      for (int k = neighbours_.start[at(i)]; k < neighbours_.start[at(i + 1)]; ++k) {
        pull += neighbour_cost_[at(k)] * (row[i] - row[neighbours_.column[at(k)]]);
      }
      gradient[l * players_ + i] = 2.0 * pull + linear[at(l * players_ + i)];
    }
  }
}

void QuadraticCost::hessian_rows(const Real* /*points*/, int /*stride*/, Real* values) const {
  std::copy(hessian_.begin(), hessian_.end(), values);
}

std::unique_ptr<Cost> QuadraticCost::zero_direction() const {
  return std::make_unique<QuadraticCost>(players_, dimension_);
}

// the gradients are linear in the coefficients
void QuadraticCost::own_gradients_along(const Cost& direction, const Real* points, int stride, Real* derivative) const {
  direction.own_gradients(points, stride, derivative);
}

void QuadraticCost::refresh() {
  neighbours_ = {};
  neighbour_cost_.clear();
  for (int i = 0; i < players_; ++i) {
    for (int j = 0; j < players_; ++j) {
      const Real c = coupling[at(i) * at(players_) + at(j)];
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
      Real own = 2.0 * quadratic[at(i)];
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
