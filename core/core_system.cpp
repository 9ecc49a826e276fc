#include "core_system.hpp"

#include <Eigen/SparseLU>
#include <algorithm>

#include "aligned_vector.hpp"
#include "kernels/kernels.hpp"

namespace mixed_order_game {

namespace {

class DenseCore final : public CoreSystem {
 public:
  explicit DenseCore(int unknowns)
      : unknowns_(unknowns), matrix_(at(unknowns) * at(unknowns)), pivot_(at(unknowns)) {}

  void clear() override { std::fill(matrix_.begin(), matrix_.end(), 0.0); }
  void add(int row, int column, Real value) override { matrix_[at(column * unknowns_ + row)] += value; }
  bool factor() override { return kernels().lu_factor(unknowns_, matrix_.data(), pivot_.data()); }
  void solve(Real* b) override { kernels().lu_solve(unknowns_, matrix_.data(), pivot_.data(), b); }

 private:
  int unknowns_;
  AlignedVector matrix_;
  std::vector<int> pivot_;
};

class SparseCore final : public CoreSystem {
 public:
  explicit SparseCore(const std::vector<std::vector<int>>& rows) {
    const auto size = static_cast<int>(rows.size());
    std::vector<Eigen::Triplet<Real, int>> entries;
    for (int row = 0; row < size; ++row) {
      for (const int column : rows[at(row)]) entries.emplace_back(row, column, 0.0);
    }
    matrix_.resize(size, size);
    matrix_.setFromTriplets(entries.begin(), entries.end());
    matrix_.makeCompressed();
    lu_.analyzePattern(matrix_);
  }

  void clear() override { std::fill_n(matrix_.valuePtr(), matrix_.nonZeros(), 0.0); }
  void add(int row, int column, Real value) override { matrix_.coeffRef(row, column) += value; }
  bool factor() override {
    lu_.factorize(matrix_);
    return lu_.info() == Eigen::Success;
  }
  void solve(Real* b) override {
    Eigen::Map<Eigen::VectorXd> rhs(b, matrix_.rows());
    rhs = lu_.solve(rhs).eval();
  }

 private:
  Eigen::SparseMatrix<Real> matrix_;
  Eigen::SparseLU<Eigen::SparseMatrix<Real>> lu_;
};

}  // namespace

std::unique_ptr<CoreSystem> make_dense_core(int unknowns) { return std::make_unique<DenseCore>(unknowns); }

std::unique_ptr<CoreSystem> make_sparse_core(const std::vector<std::vector<int>>& rows) {
  return std::make_unique<SparseCore>(rows);
}

}  // namespace mixed_order_game
