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

QuadraticCost::QuadraticCost(const Shape& shape)
    : Cost(Coefficients(declared, shape.players, shape.dimension)), shape_(shape) {
  for (int h = 0; h < shape.hosts(); ++h) host_.push_back(shape.host(h));
  refresh();
}

std::unique_ptr<Cost> QuadraticCost::clone() const { return std::make_unique<QuadraticCost>(*this); }

Real QuadraticCost::value(int i, const Real* x) const {
  const int h = shape_.host_number(i);
  Real cost = coefficients[constant][at(i)];
  for (int l = 0; l < shape_.dimension; ++l) {
    const Real* row = x + l * shape_.players;
    cost += coefficients[quadratic][at(i)] * row[i] * row[i] + coefficients[linear][at(shape_.entry(i, l))] * row[i];
    for (int k = neighbours_.start[at(h)]; k < neighbours_.start[at(h + 1)]; ++k) {
      const Real difference = row[i] - row[neighbours_.column[at(k)]];
      cost += neighbour_cost_[at(k)] * difference * difference;
    }
  }
  return cost;
}

void QuadraticCost::own_gradients(const Real* points, int stride, Real* gradient, const Real* /*held*/) const {
  const Real* q = coefficients[quadratic].data();
  const int* start = neighbours_.start.data();
  const int* neighbour = neighbours_.column.data();
  const Real* c = neighbour_cost_.data();
  const int hosts = static_cast<int>(host_.size());
  for (int l = 0; l < shape_.dimension; ++l) {
    const Real* l_il = coefficients[linear].data() + l * shape_.players;
    for (int h = 0; h < hosts; ++h) {
      const Real* row = points + h * stride + l * shape_.players;
      const int i = host_[at(h)];
      gradient[l * hosts + h] = own_gradient(i, q[i], l_il[i], row, [&](auto visit) {
        for (int k = start[h]; k < start[h + 1]; ++k) visit(neighbour[k], c[k]);
      });
    }
  }
}

template <typename Scalar>
void QuadraticCost::own_gradients_as(const CoefficientsAs<Scalar>& coefficients_as, const Scalar* points, int stride,
                                     Scalar* gradient) const {
  for (int l = 0; l < shape_.dimension; ++l) {
    for (int h = 0; h < shape_.hosts(); ++h) {
      const Scalar* row = points + h * stride + l * shape_.players;
      const int i = shape_.host(h);
      gradient[shape_.own_entry(h, l)] =
          own_gradient(i, coefficients_as.value(quadratic, i), coefficients_as.value(linear, shape_.entry(i, l)), row,
                       [&](auto visit) {
                         for (int j = 0; j < shape_.players; ++j) {
                           const int slot = i * shape_.players + j;
                           if (!coefficients_as.vanishes(coupling, slot))
                             visit(j, coefficients_as.value(coupling, slot));
                         }
                       });
    }
  }
}

void QuadraticCost::own_gradients(const CoefficientsAs<Dual>& along, const Dual* points, int stride, Dual* gradient,
                                  const Real* /*held*/) const {
  own_gradients_as(along, points, stride, gradient);
}

void QuadraticCost::own_gradients(const CoefficientsAs<Dependencies>& of, const Dependencies* points, int stride,
                                  Dependencies* gradient) const {
  own_gradients_as(of, points, stride, gradient);
}

void QuadraticCost::hessian_rows(const Real* /*points*/, int /*stride*/, Real* values, const Real* /*held*/) const {
  std::copy(hessian_.begin(), hessian_.end(), values);
}

void QuadraticCost::refresh() {
  const int N = shape_.players;
  neighbours_ = {};
  neighbour_cost_.clear();
  for (int h = 0; h < shape_.hosts(); ++h) {
    const int i = shape_.host(h);
    for (int j = 0; j < N; ++j) {
      const Real c = coefficients[coupling][at(i) * at(N) + at(j)];
      if (j != i && c != 0.0) {
        neighbours_.column.push_back(j);
        neighbour_cost_.push_back(c);
      }
    }
    neighbours_.start.push_back(neighbours_.entries());
  }
  const auto vanishes = [&](Number number) {
    return std::all_of(coefficients[number].begin(), coefficients[number].end(),
                       [](Real value) { return value == 0.0; });
  };
  has_no_gradients_ = neighbours_.entries() == 0 && vanishes(quadratic) && vanishes(linear);
  pattern_ = {};
  hessian_.clear();
  for (int l = 0; l < shape_.dimension; ++l) {
    for (int h = 0; h < shape_.hosts(); ++h) {
      const int i = shape_.host(h);
      // d^2 f_i / d x_il^2 = 2 q_i + sum_j 2 c_ij,  d^2 f_i / (d x_il d x_jl) = -2 c_ij
      Real own = 2.0 * coefficients[quadratic][at(i)];
      std::vector<std::pair<int, Real>> row;
      for (int k = neighbours_.start[at(h)]; k < neighbours_.start[at(h + 1)]; ++k) {
        own += 2.0 * neighbour_cost_[at(k)];
        row.emplace_back(shape_.entry(neighbours_.column[at(k)], l), -2.0 * neighbour_cost_[at(k)]);
      }
      row.emplace_back(shape_.entry(i, l), own);
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
