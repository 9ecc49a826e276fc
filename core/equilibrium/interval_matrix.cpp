#include "equilibrium/interval_matrix.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace mixed_order_game {

namespace {

using Matrix = Eigen::MatrixXd;

constexpr Real infinite = std::numeric_limits<Real>::infinity();

/// Rounding of Eigen's eigenvalues and norms, relative to the matrix.
constexpr Real rounding = 1e-13;

}  // namespace

Real norm_bound(const std::vector<Interval>& rows, int D) {
  const auto n = static_cast<Eigen::Index>(rows.size()) / D;
  Matrix magnitude(D, n);
  Matrix middle(D, n);
  Matrix radius(D, n);
  for (Eigen::Index l = 0; l < D; ++l) {
    for (Eigen::Index k = 0; k < n; ++k) {
      const Interval& entry = rows[at(static_cast<int>(l * n + k))];
      magnitude(l, k) = entry.magnitude();
      middle(l, k) = middle_of(entry);
      radius(l, k) = std::max(entry.upper - middle(l, k), middle(l, k) - entry.lower);
    }
  }
  if (!magnitude.allFinite()) return infinite;
  const auto norm = [](const Matrix& matrix) {
    return matrix.rows() == 1 ? matrix.norm()
                              : std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Matrix>(
                                                            matrix * matrix.transpose(), Eigen::EigenvaluesOnly)
                                                            .eigenvalues()
                                                            .maxCoeff()));
  };
  const Real least = D == 1 ? norm(magnitude) : std::min(norm(magnitude), norm(middle) + radius.norm());
  return least * (1.0 + 10.0 * rounding);
}

// A symmetric matrix of the intervals is at least the one in the middle, less on the diagonal its own radius and
// (R v)_k / v_k, R the radii beside the diagonal and v any positive vector: |2 r x_k x_p| <= r (v_p / v_k x_k^2 + v_k /
// v_p x_p^2). The first v balances all radii, which is as good as the norm of R; the next ones come closer to the sizes
// in the least eigenvector, where nothing is lost.
Real least_eigenvalue(const std::vector<Interval>& entries, int size) {
  const auto n = static_cast<Eigen::Index>(size);
  constexpr int most_vectors = 6;
  Matrix middle(n, n);
  Matrix radius(n, n);
  for (Eigen::Index p = 0; p < n; ++p) {
    for (Eigen::Index k = 0; k <= p; ++k) {
      const Interval one = entries[at(static_cast<int>(p * n + k))] + entries[at(static_cast<int>(k * n + p))];
      middle(p, k) = middle(k, p) = 0.5 * middle_of(one);
      radius(p, k) = radius(k, p) =
          0.5 * std::max(one.upper - middle_of(one), middle_of(one) - one.lower) * (1.0 + rounding);
    }
  }
  if (!middle.allFinite() || !radius.allFinite()) return -infinite;
  const bool is_exact = radius.maxCoeff() == 0.0;
  Eigen::VectorXd v = Eigen::VectorXd::Ones(n);
  for (int sweep = 0; sweep < 20 && !is_exact; ++sweep) {
    const Eigen::VectorXd next = radius * v;
    v = next + Eigen::VectorXd::Constant(n, 1e-3 * next.maxCoeff());
    v /= v.maxCoeff();
  }
  const Real scale = middle.cwiseAbs().rowwise().sum().maxCoeff();
  Real least = -infinite;
  for (int count = 0; count < (is_exact ? 1 : most_vectors); ++count) {
    const Eigen::VectorXd less = (radius * v).cwiseQuotient(v) * (1.0 + static_cast<Real>(n) * rounding);
    Matrix lower = middle;
    lower.diagonal() -= less;
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(lower);
    const Real here = solver.eigenvalues()(0) - rounding * static_cast<Real>(n) * (scale + less.maxCoeff());
    if (count > 0 && here <= least + 1e-3 * std::abs(least)) return std::max(least, here);
    least = here;
    v = 0.5 * v / v.maxCoeff() +
        0.5 * solver.eigenvectors().col(0).cwiseAbs() / solver.eigenvectors().col(0).cwiseAbs().maxCoeff();
  }
  return least;
}

}  // namespace mixed_order_game
