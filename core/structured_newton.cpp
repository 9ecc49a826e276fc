// Solves (I - gamma J) delta = b by eliminating, in this order:
//
//  1. the weights, column by column: w' = beta e (S - r w) enters the rest only through w'S, so that
//         d(w'S) = h + A de                  with scalars h, A for each column;
//  2. the estimates: dy_i = B^-1 b + T_i dxbar by EstimateBlocks;
//  3. velocities and references, which follow from the actions.
//
// What remains is a sparse core system of at most 2 N D unknowns: dxbar, and dx of the first-order players. The
// derivatives of the activations with respect to the estimates are left out (dS = 0): they would make it full. Measured
// at N = 2 to 200 and widths from 0.3 to 7, CVODE needs the same number of iterations without them, and each costs
// less.
#include <algorithm>
#include <optional>

#include "core_system.hpp"
#include "estimate_blocks.hpp"
#include "kernels/kernels.hpp"
#include "newton_solver.hpp"

namespace mixed_order_game {

namespace {

class StructuredNewton final : public NewtonSolver {
 public:
  void refresh(const LoopJacobian& jacobian) override;
  bool factor(const LoopJacobian& jacobian, Real gamma) override;
  void solve(Real* b) override;

 private:
  void factor_weights();
  void factor_core();
  void apply_hessian(const std::vector<int>& rows, const Real* dy);

  [[nodiscard]] const ClosedLoop& loop() const { return jacobian_->loop(); }

  const LoopJacobian* jacobian_ = nullptr;
  Real gamma_ = 0.0;
  EstimateBlocks blocks_;
  std::optional<CoreSystem> core_;

  // sizes
  int n_ = 0;                         // N D
  std::vector<int> player_;           // per entry
  std::vector<std::uint8_t> second_;  // per entry: order 2
  std::vector<int> velocity_driven_;  // entries of order 1
  std::vector<int> accelerated_;      // entries of order 2
  std::vector<int> all_;
  std::vector<int> first_order_;   // per entry: number of dx in the core system, -1 for order 2
  std::vector<int> shared_place_;  // per entry: place of dxbar in the core system
  std::vector<int> action_place_;  // per entry: place of dx
  std::vector<int> hessian_gain_;  // per entry of the Hessian rows: where its dy_i / dxbar lies

  // weights; all per column p
  AlignedVector stiffness_;       // k1 or k4, plus d phi/d e, plus A
  AlignedVector inverse_driven_;  // 1 / (1 + gamma stiffness)
  AlignedVector inverse_a2_;      // h = S'b / a2
  AlignedVector inverse_a1_;
  AlignedVector squares_;       // |S|^2
  AlignedVector network_gain_;  // A
  // a1 dw = b + gamma beta (S - r w) de - gamma beta e theta w d(w'S)
  AlignedVector activation_per_error_, weight_per_error_, weight_per_network_;

  // one solve
  AlignedVector network_rhs_;  // h
  AlignedVector core_rhs_;
  AlignedVector shared_;    // dxbar
  AlignedVector gradient_;  // Hessian rows times dy
  AlignedVector error_change_, from_error_, onto_weight_;
  AlignedVector velocity_;  // b_x, then dv
};

void StructuredNewton::refresh(const LoopJacobian& jacobian) {
  jacobian_ = &jacobian;
  const Parameters& parameters = loop().parameters();
  const Shape& shape = parameters.shape;
  n_ = shape.actions();
  blocks_.analyse(parameters.graph, parameters.gains.k3, shape.dimension);
  player_.resize(at(n_));
  second_.resize(at(n_));
  first_order_.resize(at(n_));
  for (std::vector<int>* entries : {&velocity_driven_, &accelerated_, &all_}) entries->clear();
  int unknowns = n_;
  for (int p = 0; p < n_; ++p) {
    player_[at(p)] = shape.player_of(p);
    second_[at(p)] = shape.is_second_order(shape.player_of(p)) ? 1 : 0;
    first_order_[at(p)] = second_[at(p)] != 0 ? -1 : unknowns++;
    all_.push_back(p);
    (second_[at(p)] != 0 ? accelerated_ : velocity_driven_).push_back(p);
  }
  const std::size_t n = at(n_);
  for (AlignedVector* vector : {&stiffness_, &inverse_driven_, &inverse_a2_, &inverse_a1_, &squares_, &network_gain_,
                                &activation_per_error_, &weight_per_error_, &weight_per_network_, &network_rhs_,
                                &shared_, &gradient_, &error_change_, &from_error_, &onto_weight_, &velocity_}) {
    vector->assign(n, 0.0);
  }
  core_rhs_.assign(at(unknowns), 0.0);

  // the core system's sparse pattern
  std::vector<std::vector<int>> rows(at(unknowns));
  const SparseRows& hessian = parameters.cost->hessian_pattern();
  const SparseRows& dynamics = parameters.dynamics->jacobian_pattern();
  hessian_gain_.clear();
  for (int p = 0; p < n_; ++p) {
    for (int k = hessian.start[at(p)]; k < hessian.start[at(p + 1)]; ++k) {
      hessian_gain_.push_back(player_[at(p)] * shape.players + player_[at(hessian.column[at(k)])]);
    }
  }
  for (int p = 0; p < n_; ++p) {
    const int driven = second_[at(p)] != 0 ? p : first_order_[at(p)];
    rows[at(p)].push_back(p);
    rows[at(driven)].push_back(p);
    rows[at(driven)].push_back(driven);
    for (int k = hessian.start[at(p)]; k < hessian.start[at(p + 1)]; ++k) rows[at(p)].push_back(hessian.column[at(k)]);
    for (int k = dynamics.start[at(p)]; k < dynamics.start[at(p + 1)]; ++k) {
      const int column = dynamics.column[at(k)];
      rows[at(driven)].push_back(second_[at(column)] != 0 ? column : first_order_[at(column)]);
    }
    const SparseRows& by_velocity = parameters.dynamics->velocity_pattern();
    for (int k = by_velocity.start[at(p)]; k < by_velocity.start[at(p + 1)]; ++k) {
      rows[at(driven)].push_back(by_velocity.column[at(k)]);
    }
  }
  core_.emplace(rows);
  shared_place_.resize(at(n_));
  action_place_.resize(at(n_));
  for (int p = 0; p < n_; ++p) {
    shared_place_[at(p)] = core_->place(p);
    action_place_[at(p)] = core_->place(second_[at(p)] != 0 ? p : first_order_[at(p)]);
  }
}

// Column p, with r = w'S / W_max on the sphere and 0 inside, theta = 1 / W_max or 0:
//     a1 = 1 + gamma beta e r,  a2 = 1 + 2 gamma beta e r,
//     d(w'S) = S'dw = (S'b + gamma beta (|S|^2 - w'S r) de) / a2 = S'b / a2 + A de,
//     A = gamma beta (|S|^2 - w'S r) / a2.
void StructuredNewton::factor_weights() {
  const Parameters& parameters = loop().parameters();
  const GainRows& gains = loop().gains();
  const LoopJacobian& jacobian = *jacobian_;
  for (int p = 0; p < n_; ++p) stiffness_[at(p)] = gains.k[at(p)] + jacobian.slope[at(p)];
  if (!parameters.strategy.robust) return;

  const Real* activation = jacobian.activation.data();
  kernels().column_products(n_, parameters.shape.neurons, activation, activation, squares_.data());
  for (int p = 0; p < n_; ++p) {
    const Real s = jacobian.network[at(p)];
    const Real theta = jacobian.inverse_bound[at(p)];
    const Real r = s * theta;
    const Real gamma_beta = gamma_ * gains.beta[at(p)];
    const Real push = gamma_beta * jacobian.error[at(p)];
    const Real inverse_a1 = 1.0 / (1.0 + push * r);
    inverse_a1_[at(p)] = inverse_a1;
    inverse_a2_[at(p)] = 1.0 / (1.0 + 2.0 * push * r);
    network_gain_[at(p)] = gamma_beta * (squares_[at(p)] - s * r) * inverse_a2_[at(p)];
    stiffness_[at(p)] += network_gain_[at(p)];
    activation_per_error_[at(p)] = gamma_beta * inverse_a1;
    weight_per_error_[at(p)] = -gamma_beta * r * inverse_a1;
    weight_per_network_[at(p)] = -push * theta * inverse_a1;
  }
}

// Rows of the core system, B = stiffness, H the cost's Hessian rows, G the dynamics' Jacobian, T the gains of xbar:
//   order 1:  dz + gamma k2 (H T) dz               = b_z - gamma k2 H r
//             (1 + gamma B) dx - gamma B dz - gamma G dx = b_x - gamma h
//   order 2:  dx - gamma dv = b_x and (1 + gamma B) dv + gamma (B k2 H dy - G dx) = b_v - gamma h give
//             (1 + gamma B) dx + gamma^2 (B k2 H dy - G dx) = (1 + gamma B) b_x + gamma (b_v - gamma h)
void StructuredNewton::factor_core() {
  const Parameters& parameters = loop().parameters();
  const AlignedVector& k2 = loop().gains().k2;
  const SparseRows& hessian = parameters.cost->hessian_pattern();
  const SparseRows& dynamics = parameters.dynamics->jacobian_pattern();
  const AlignedVector& gain = blocks_.shared_signal_gain();
  core_->clear();
  for (int p = 0; p < n_; ++p) {
    const bool second = second_[at(p)] != 0;
    const Real B = stiffness_[at(p)];
    inverse_driven_[at(p)] = 1.0 / (1.0 + gamma_ * B);
    const int driven = second ? p : first_order_[at(p)];
    const Real weight = second ? gamma_ * gamma_ : gamma_;
    const Real gradient_weight = second ? weight * B * k2[at(p)] : gamma_ * k2[at(p)];
    for (int k = hessian.start[at(p)]; k < hessian.start[at(p + 1)]; ++k) {
      const Real T = gain[at(hessian_gain_[at(k)])];
      core_->add(p, hessian.column[at(k)], gradient_weight * jacobian_->hessian[at(k)] * T);
    }
    if (second) {
      core_->add(p, p, 1.0 + gamma_ * B);
    } else {
      core_->add(p, p, 1.0);
      core_->add(driven, driven, 1.0 + gamma_ * B);
      core_->add(driven, p, -gamma_ * B);
    }
    for (int k = dynamics.start[at(p)]; k < dynamics.start[at(p + 1)]; ++k) {
      const int column = dynamics.column[at(k)];
      core_->add(driven, second_[at(column)] != 0 ? column : first_order_[at(column)],
                 -weight * jacobian_->dynamics[at(k)]);
    }
    // dv = (dx - b_x) / gamma
    const SparseRows& by_velocity = parameters.dynamics->velocity_pattern();
    for (int k = by_velocity.start[at(p)]; k < by_velocity.start[at(p + 1)]; ++k) {
      core_->add(driven, by_velocity.column[at(k)], -(second ? gamma_ : 1.0) * jacobian_->dynamics_by_velocity[at(k)]);
    }
  }
}

bool StructuredNewton::factor(const LoopJacobian& jacobian, Real gamma) {
  jacobian_ = &jacobian;
  gamma_ = gamma;
  factor_weights();
  blocks_.factor(gamma);
  factor_core();
  return core_->factor();
}

/// Rows of the cost's Hessian times dy: changes of the gradients.
void StructuredNewton::apply_hessian(const std::vector<int>& rows, const Real* dy) {
  const SparseRows& hessian = loop().parameters().cost->hessian_pattern();
  for (const int p : rows) {
    const Real* own = dy + player_[at(p)] * n_;
    Real sum = 0.0;
    for (int k = hessian.start[at(p)]; k < hessian.start[at(p + 1)]; ++k) {
      sum += jacobian_->hessian[at(k)] * own[hessian.column[at(k)]];
    }
    gradient_[at(p)] = sum;
  }
}

void StructuredNewton::solve(Real* b) {
  const Kernels& kernel = kernels();
  const Parameters& parameters = loop().parameters();
  const Shape& shape = parameters.shape;
  const StateLayout& layout = loop().layout();
  const bool robust = parameters.strategy.robust;
  const AlignedVector& k2 = loop().gains().k2;
  const SparseRows& dynamics = parameters.dynamics->jacobian_pattern();
  Real* dx = b + layout.x();
  Real* dreference = b + layout.reference();
  Real* dy = b + layout.estimates();
  Real* dW = b + layout.weights();
  Real* h = network_rhs_.data();

  // estimates and weights without the unknowns of the core
  blocks_.solve(dy);
  apply_hessian(all_, dy);
  if (robust) {
    kernel.column_products(n_, shape.neurons, jacobian_->activation.data(), dW, h);
    for (int p = 0; p < n_; ++p) h[p] *= inverse_a2_[at(p)];
  } else {
    std::fill_n(h, n_, 0.0);
  }

  // core
  const auto along_velocities = [&](int p, const Real* dv) {
    const SparseRows& by_velocity = parameters.dynamics->velocity_pattern();
    Real dg = 0.0;
    for (int k = by_velocity.start[at(p)]; k < by_velocity.start[at(p + 1)]; ++k) {
      dg += jacobian_->dynamics_by_velocity[at(k)] * dv[by_velocity.column[at(k)]];
    }
    return dg;
  };
  const bool has_velocities = parameters.dynamics->velocity_pattern().entries() != 0;
  if (has_velocities) std::copy_n(dx, n_, velocity_.begin());
  for (const int p : velocity_driven_) {
    core_rhs_[at(shared_place_[at(p)])] = dreference[p] - gamma_ * k2[at(p)] * gradient_[at(p)];
    core_rhs_[at(action_place_[at(p)])] = dx[p] - gamma_ * h[p];
    if (has_velocities) core_rhs_[at(action_place_[at(p)])] -= along_velocities(p, velocity_.data());
  }
  for (const int p : accelerated_) {
    const Real B = stiffness_[at(p)];
    const Real known = h[p] + B * k2[at(p)] * gradient_[at(p)];
    core_rhs_[at(shared_place_[at(p)])] = (1.0 + gamma_ * B) * dx[p] + gamma_ * (dreference[p] - gamma_ * known);
    if (has_velocities) core_rhs_[at(shared_place_[at(p)])] -= gamma_ * along_velocities(p, velocity_.data());
  }
  core_->solve(core_rhs_.data());

  // back to estimates, actions, references and velocities
  for (int p = 0; p < n_; ++p) {
    shared_[at(p)] = core_rhs_[at(shared_place_[at(p)])];
    dx[p] = core_rhs_[at(action_place_[at(p)])];
  }
  if (has_velocities) {
    for (int p = 0; p < n_; ++p) velocity_[at(p)] = (dx[p] - velocity_[at(p)]) / gamma_;
  }
  kernel.add_shared_signal(shape.players, shape.dimension, blocks_.shared_signal_gain().data(), shared_.data(), dy);
  for (const int p : velocity_driven_) {
    dreference[p] = shared_[at(p)];
    error_change_[at(p)] = dx[p] - dreference[p];
  }
  apply_hessian(accelerated_, dy);
  for (const int p : accelerated_) {
    Real dg = 0.0;
    for (int k = dynamics.start[at(p)]; k < dynamics.start[at(p + 1)]; ++k) {
      dg += jacobian_->dynamics[at(k)] * dx[dynamics.column[at(k)]];
    }
    if (has_velocities) dg += along_velocities(p, velocity_.data());
    const Real push = h[p] + stiffness_[at(p)] * k2[at(p)] * gradient_[at(p)] - dg;
    dreference[p] = (dreference[p] - gamma_ * push) * inverse_driven_[at(p)];
    error_change_[at(p)] = dreference[p] + k2[at(p)] * gradient_[at(p)];
  }
  if (!robust) return;

  for (int p = 0; p < n_; ++p) {
    const Real de = error_change_[at(p)];
    const Real dnetwork = h[p] + network_gain_[at(p)] * de;  // d(w'S)
    from_error_[at(p)] = activation_per_error_[at(p)] * de;
    onto_weight_[at(p)] = weight_per_error_[at(p)] * de + weight_per_network_[at(p)] * dnetwork;
  }
  kernel.weight_corrections(n_, shape.neurons, inverse_a1_.data(), from_error_.data(), onto_weight_.data(),
                            jacobian_->activation.data(), jacobian_->weights.data(), dW);
}

}  // namespace

std::unique_ptr<NewtonSolver> make_structured_newton() { return std::make_unique<StructuredNewton>(); }

}  // namespace mixed_order_game
