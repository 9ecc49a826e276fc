// Dense LU of I - gamma J.
#include <Eigen/Dense>

#include "newton_solver.hpp"

namespace mixed_order_game {

namespace {

class DenseNewton final : public NewtonSolver {
 public:
  explicit DenseNewton(bool coupled) : coupled_(coupled) {}

  void refresh(const LoopJacobian& /*jacobian*/) override {}

  bool factor(const LoopJacobian& jacobian, Real gamma) override {
    const int size = jacobian.loop().layout().size();
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(size, size);
    for (const auto& [row, column, value] : jacobian.entries(coupled_)) matrix(row, column) -= gamma * value;
    lu_.compute(matrix);
    return lu_.matrixLU().diagonal().cwiseAbs().minCoeff() > 0.0;
  }

  void solve(Real* b) override {
    Eigen::Map<Eigen::VectorXd> rhs(b, lu_.matrixLU().rows());
    rhs = lu_.solve(rhs).eval();
  }

 private:
  bool coupled_;
  Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
};

}  // namespace

std::unique_ptr<NewtonSolver> make_dense_newton(bool coupled) { return std::make_unique<DenseNewton>(coupled); }

}  // namespace mixed_order_game
