#include "loop_matrix.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace mixed_order_game {

std::vector<MatrixEntry> matrix_of(const LoopJacobian& jacobian) {
  const Parameters& parameters = jacobian.loop().parameters();
  const Shape& shape = jacobian.loop().shape();
  const StateLayout& layout = jacobian.loop().layout();
  const GainRows& gains = jacobian.loop().gains();
  const int n = shape.actions();
  const SparseRows& hessian_rows = parameters.cost->hessian_pattern();
  const SparseRows& dynamics_rows = parameters.dynamics->jacobian_pattern();
  const bool robust = parameters.strategy.robust;

  std::vector<MatrixEntry> entries;
  std::vector<Real> row(at(layout.size()), 0.0);  // one row, gathered before it is written
  std::vector<int> touched;
  const auto add = [&](int column, Real value) {
    if (value == 0.0) return;
    if (row[at(column)] == 0.0) touched.push_back(column);
    row[at(column)] += value;
  };
  const auto finish = [&](int number) {
    std::sort(touched.begin(), touched.end());
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
    for (const int column : touched) {
      entries.push_back({number, column, row[at(column)]});
      row[at(column)] = 0.0;
    }
    touched.clear();
  };
  const auto add_error = [&](int p, Real scale) {  // scale * de
    const int i = shape.player_of(p);
    if (shape.is_second_order(i)) {
      add(layout.reference() + p, scale);
      for (int k = hessian_rows.start[at(p)]; k < hessian_rows.start[at(p + 1)]; ++k) {
        add(layout.estimates_of(i) + hessian_rows.column[at(k)], scale * gains.k2[at(p)] * jacobian.hessian[at(k)]);
      }
    } else {
      add(layout.x() + p, scale);
      add(layout.reference() + p, -scale);
    }
  };
  const auto add_network = [&](int p, Real scale) {  // scale * d(w'S)
    for (int m = 0; m < shape.neurons; ++m) add(layout.weights_of(m) + p, scale * jacobian.activation[at(m * n + p)]);
  };
  const auto add_driven = [&](int p) {  // d(u + g)
    add_error(p, -jacobian.follows[at(p)] * (gains.k[at(p)] + jacobian.slope[at(p)]));
    if (robust) add_network(p, -jacobian.follows[at(p)]);
    for (int k = dynamics_rows.start[at(p)]; k < dynamics_rows.start[at(p + 1)]; ++k) {
      add(layout.x() + dynamics_rows.column[at(k)], jacobian.dynamics[at(k)]);
    }
    const SparseRows& by_velocity = parameters.dynamics->velocity_pattern();
    for (int k = by_velocity.start[at(p)]; k < by_velocity.start[at(p + 1)]; ++k) {
      add(layout.reference() + by_velocity.column[at(k)], jacobian.dynamics_by_velocity[at(k)]);
    }
  };

  for (int p = 0; p < n; ++p) {
    if (shape.is_second_order(shape.player_of(p))) {
      add(layout.reference() + p, 1.0);
    } else {
      add_driven(p);
    }
    finish(layout.x() + p);
  }
  for (int p = 0; p < n; ++p) {
    const int i = shape.player_of(p);
    if (shape.is_second_order(i)) {
      add_driven(p);
    } else {
      for (int k = hessian_rows.start[at(p)]; k < hessian_rows.start[at(p + 1)]; ++k) {
        add(layout.estimates_of(i) + hessian_rows.column[at(k)], -gains.k2[at(p)] * jacobian.hessian[at(k)]);
      }
    }
    finish(layout.reference() + p);
  }
  const NeighbourRows graph = parameters.graph.neighbours();
  for (int i = 0; i < shape.players; ++i) {
    for (int k = 0; k < n; ++k) {
      const int j = shape.player_of(k);
      for (int edge = graph.start[i]; edge < graph.start[i + 1]; ++edge) {
        add(layout.estimates_of(i) + k, -parameters.gains.k3[at(i)] * graph.weight[edge]);
        add(layout.estimates_of(graph.neighbour[edge]) + k, parameters.gains.k3[at(i)] * graph.weight[edge]);
      }
      const Real a = parameters.graph.weight(i, j);
      add(layout.estimates_of(i) + k, -parameters.gains.k3[at(i)] * a);
      add((shape.is_second_order(j) ? layout.x() : layout.reference()) + k, parameters.gains.k3[at(i)] * a);
      finish(layout.estimates_of(i) + k);
    }
  }
  for (int m = 0; robust && m < shape.neurons; ++m) {
    for (int p = 0; p < n; ++p) {
      const Real w = jacobian.weights[at(m * n + p)];
      const Real e = jacobian.error[at(p)];
      const Real r = jacobian.network[at(p)] * jacobian.inverse_bound[at(p)];
      add_error(p, gains.beta[at(p)] * (jacobian.activation[at(m * n + p)] - r * w));
      if (jacobian.inverse_bound[at(p)] != 0.0) {
        add_network(p, -gains.beta[at(p)] * e * w * jacobian.inverse_bound[at(p)]);
        add(layout.weights_of(m) + p, -gains.beta[at(p)] * e * r);
      }
      finish(layout.weights_of(m) + p);
    }
  }
  return entries;
}

namespace {

class DenseNewton final : public NewtonSolver {
 public:
  void refresh(const LoopJacobian& /*jacobian*/) override {}

  bool factor(const LoopJacobian& jacobian, Real gamma) override {
    const int size = jacobian.loop().layout().size();
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(size, size);
    for (const auto& [row, column, value] : matrix_of(jacobian)) matrix(row, column) -= gamma * value;
    lu_.compute(matrix);
    return lu_.matrixLU().diagonal().cwiseAbs().minCoeff() > 0.0;
  }

  void solve(Real* b) override {
    Eigen::Map<Eigen::VectorXd> rhs(b, lu_.matrixLU().rows());
    rhs = lu_.solve(rhs).eval();
  }

 private:
  Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
};

}  // namespace

std::unique_ptr<NewtonSolver> make_dense_newton() { return std::make_unique<DenseNewton>(); }

}  // namespace mixed_order_game
