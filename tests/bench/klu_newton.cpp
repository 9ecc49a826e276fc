#include "klu_newton.hpp"

#include <klu.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <numeric>
#include <utility>

namespace mixed_order_game {

namespace {

/// Calls term(row, column, value) for every term of the Jacobian, in an order that depends only on the patterns and on
/// which columns are on the sphere; terms of one position add up.
template <typename Term>
void for_each_term(const LoopJacobian& jacobian, Term term) {
  const ClosedLoop& loop = jacobian.loop();
  const Parameters& parameters = loop.parameters();
  const Shape& shape = loop.shape();
  const StateLayout& layout = loop.layout();
  const Gains& gains = parameters.gains;
  const GainRows& rows = loop.gains();
  const SparseRows& hessian_rows = parameters.cost->hessian_pattern();
  const SparseRows& dynamics_rows = parameters.dynamics->jacobian_pattern();
  const NeighbourRows graph = parameters.graph.neighbours();
  const int n = shape.actions();
  const int q = shape.neurons;

  for (int p = 0; p < n; ++p) {
    const int i = shape.player_of(p);
    const bool second = shape.is_second_order(i);
    const int own = layout.estimates_of(i);
    const auto error = [&](int row, Real scale) {  // scale * de
      if (!second) {
        term(row, layout.x() + p, scale);
        term(row, layout.reference() + p, -scale);
        return;
      }
      term(row, layout.reference() + p, scale);
      for (int k = hessian_rows.start[at(p)]; k < hessian_rows.start[at(p + 1)]; ++k) {
        term(row, own + hessian_rows.column[at(k)], scale * rows.k2[at(p)] * jacobian.hessian[at(k)]);
      }
    };
    const int driven = second ? layout.reference() + p : layout.x() + p;
    if (second) {
      term(layout.x() + p, layout.reference() + p, 1.0);
    } else {
      for (int k = hessian_rows.start[at(p)]; k < hessian_rows.start[at(p + 1)]; ++k) {
        term(layout.reference() + p, own + hessian_rows.column[at(k)], -rows.k2[at(p)] * jacobian.hessian[at(k)]);
      }
    }
    error(driven, -(rows.k[at(p)] + jacobian.slope[at(p)]));
    for (int k = dynamics_rows.start[at(p)]; k < dynamics_rows.start[at(p + 1)]; ++k) {
      term(driven, layout.x() + dynamics_rows.column[at(k)], jacobian.dynamics[at(k)]);
    }
    if (!parameters.strategy.robust) continue;

    for (int m = 0; m < q; ++m) term(driven, layout.weights_of(m) + p, -jacobian.activation[at(m * n + p)]);
    const Real theta = jacobian.inverse_bound[at(p)];
    const Real r = jacobian.network[at(p)] * theta;
    const Real push = rows.beta[at(p)] * jacobian.error[at(p)];
    for (int m = 0; m < q; ++m) {
      const int row = layout.weights_of(m) + p;
      const Real w = jacobian.weights[at(m * n + p)];
      const Real S = jacobian.activation[at(m * n + p)];
      error(row, rows.beta[at(p)] * (S - r * w));
      if (theta != 0.0) {
        const Real onto_weight = push * w * theta;
        for (int h = 0; h < q; ++h) {
          term(row, layout.weights_of(h) + p, -onto_weight * jacobian.activation[at(h * n + p)]);
        }
        term(row, row, -push * r);
      }
    }
  }
  for (int i = 0; i < shape.players; ++i) {
    for (int k = 0; k < n; ++k) {
      const int j = shape.player_of(k);
      const int row = layout.estimates_of(i) + k;
      Real own = -gains.k3[at(i)] * parameters.graph.weight(i, j);
      for (int edge = graph.start[i]; edge < graph.start[i + 1]; ++edge) {
        own -= gains.k3[at(i)] * graph.weight[edge];
        term(row, layout.estimates_of(graph.neighbour[edge]) + k, gains.k3[at(i)] * graph.weight[edge]);
        if (graph.neighbour[edge] == j) {
          term(row, (shape.is_second_order(j) ? layout.x() : layout.reference()) + k,
               gains.k3[at(i)] * graph.weight[edge]);
        }
      }
      term(row, row, own);
    }
  }
}

class KluNewton final : public NewtonSolver {
 public:
  explicit KluNewton(bool informed) : informed_(informed) {
    if (klu_defaults(&common_) == 0) throw std::bad_alloc();
  }
  ~KluNewton() override { release(); }
  KluNewton(const KluNewton&) = delete;
  KluNewton& operator=(const KluNewton&) = delete;

  void refresh(const LoopJacobian& /*jacobian*/) override { release(); }

  bool factor(const LoopJacobian& jacobian, Real gamma) override {
    const bool same_pattern =
        symbolic_ != nullptr && std::equal(on_sphere_.begin(), on_sphere_.end(), jacobian.inverse_bound.begin(),
                                           [](auto on, Real bound) { return on == (bound != 0.0); });
    if (!same_pattern) analyse(jacobian);
    assemble(jacobian, gamma);
    const auto refactor = [&] {
      return klu_refactor(start_.data(), row_.data(), value_.data(), symbolic_, numeric_, &common_) != 0;
    };
    // the pivots of the last full factorization serve as long as the matrix stays well conditioned with them
    if (numeric_ != nullptr && refactor() && klu_rcond(symbolic_, numeric_, &common_) != 0 &&
        common_.rcond > std::pow(std::numeric_limits<Real>::epsilon(), 2.0 / 3.0)) {
      return true;
    }
    klu_free_numeric(&numeric_, &common_);
    numeric_ = klu_factor(start_.data(), row_.data(), value_.data(), symbolic_, &common_);
    return numeric_ != nullptr && common_.status == KLU_OK;
  }

  void solve(Real* b) override { klu_solve(symbolic_, numeric_, size_, 1, b, &common_); }

 private:
  void release() {
    klu_free_numeric(&numeric_, &common_);
    klu_free_symbolic(&symbolic_, &common_);
  }

  /// The compressed columns of I - gamma J for the present modes, and for each term its place in them.
  void analyse(const LoopJacobian& jacobian) {
    release();
    size_ = jacobian.loop().layout().size();
    on_sphere_.resize(jacobian.inverse_bound.size());
    std::transform(jacobian.inverse_bound.begin(), jacobian.inverse_bound.end(), on_sphere_.begin(),
                   [](Real bound) { return bound != 0.0; });
    std::vector<std::pair<int, int>> position;  // column, row
    for_each_term(jacobian, [&](int row, int column, Real) { position.emplace_back(column, row); });
    for (int k = 0; k < size_; ++k) position.emplace_back(k, k);
    std::vector<int> order(position.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](int a, int b) { return position[at(a)] < position[at(b)]; });
    start_.assign(at(size_) + 1, 0);
    row_.clear();
    place_.resize(position.size());
    for (std::size_t k = 0; k < order.size(); ++k) {
      const auto& [column, row] = position[at(order[k])];
      if (k == 0 || position[at(order[k - 1])] != position[at(order[k])]) {
        row_.push_back(row);
        ++start_[at(column) + 1];
      }
      place_[at(order[k])] = static_cast<int>(row_.size()) - 1;
    }
    std::partial_sum(start_.begin(), start_.end(), start_.begin());
    value_.resize(row_.size());
    choose_order(jacobian.loop());
    if (symbolic_ == nullptr) throw std::bad_alloc();
  }

  /// Elimination order: one that knows the loop's structure, or the better of the two that KLU finds.
  void choose_order(const ClosedLoop& loop) {
    common_.btf = 0;  // measured: no better with it
    if (informed_) {
      const Shape& shape = loop.shape();
      const StateLayout& layout = loop.layout();
      std::vector<int> given(at(layout.size() - layout.weights()));
      std::iota(given.begin(), given.end(), layout.weights());
      for (int k = 0; k < shape.actions(); ++k) {
        for (int i = 0; i < shape.players; ++i) given.push_back(layout.estimates_of(i) + k);
      }
      for (int k = 0; k < layout.estimates(); ++k) given.push_back(k);
      symbolic_ = klu_analyze_given(size_, start_.data(), row_.data(), given.data(), given.data(), &common_);
      return;
    }
    constexpr int amd = 0;
    constexpr int colamd = 1;
    if (ordering_ < 0) {
      double least = std::numeric_limits<double>::infinity();
      for (const int candidate : {amd, colamd}) {
        common_.ordering = candidate;
        symbolic_ = klu_analyze(size_, start_.data(), row_.data(), &common_);
        std::vector<Real> pattern_only(row_.size());
        for (std::size_t k = 0; k < row_.size(); ++k) pattern_only[k] = 1.0 / (1.0 + static_cast<double>(k % 97));
        numeric_ = klu_factor(start_.data(), row_.data(), pattern_only.data(), symbolic_, &common_);
        const double fill = numeric_ != nullptr ? static_cast<double>(numeric_->lnz) + numeric_->unz : least;
        if (fill < least) {
          least = fill;
          ordering_ = candidate;
        }
        release();
      }
      ordering_ = std::max(ordering_, amd);
    }
    common_.ordering = ordering_;
    symbolic_ = klu_analyze(size_, start_.data(), row_.data(), &common_);
  }

  void assemble(const LoopJacobian& jacobian, Real gamma) {
    std::fill(value_.begin(), value_.end(), 0.0);
    const int* place = place_.data();
    Real* value = value_.data();
    for_each_term(jacobian, [&](int, int, Real term) { value[*place++] -= gamma * term; });
    for (int k = 0; k < size_; ++k) value[*place++] += 1.0;
  }

  bool informed_;
  int ordering_ = -1;
  klu_common common_{};
  klu_symbolic* symbolic_ = nullptr;
  klu_numeric* numeric_ = nullptr;
  int size_ = 0;
  std::vector<std::uint8_t> on_sphere_;
  std::vector<int> start_;
  std::vector<int> row_;
  std::vector<int> place_;
  std::vector<Real> value_;
};

}  // namespace

std::unique_ptr<NewtonSolver> make_klu_newton(bool informed) { return std::make_unique<KluNewton>(informed); }

}  // namespace mixed_order_game
