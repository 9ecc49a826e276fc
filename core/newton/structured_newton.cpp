// Solves (I - gamma J) delta = b by eliminating, in this order:
//
//  1. the weights, column by column: w' = beta e (S - r w) enters the rest only through w'S, so that
//         d(w'S) = h + A de                  with scalars h, A for each column;
//  2. the estimates: dy_i = B^-1 b + T_i dxbar by EstimateBlocks;
//  3. velocities and references, which follow from the actions.
//
// What remains is a sparse reduced system of at most 2 H D unknowns: dxbar of the hosted players, and dx of the
// first-order ones (a hosted player whose plant is outside has dz alone, or nothing). The derivatives of the
// activations with respect to the estimates are left out (dS = 0): they would make it full. Measured at N = 2 to 200
// and widths from 0.3 to 7, CVODE needs the same number of iterations without them, and each costs less.
#include <algorithm>
#include <optional>

#include "kernels/kernels.hpp"
#include "newton/estimate_blocks.hpp"
#include "newton/newton_solver.hpp"
#include "newton/reduced_system.hpp"

namespace mixed_order_game {

namespace {

bool are_same(const SparseRows& a, const SparseRows& b) { return a.start == b.start && a.column == b.column; }

class StructuredNewton final : public NewtonSolver {
 public:
  void refresh(const LoopJacobian& jacobian) override;
  bool factor(const LoopJacobian& jacobian, Real gamma) override;
  void solve(Real* b) override;

 private:
  void find_pattern();
  void factor_weights();
  void factor_reduced();
  void apply_hessian(const std::vector<int>& rows, const Real* dy);

  [[nodiscard]] const ClosedLoop& loop() const { return jacobian_->loop(); }

  const LoopJacobian* jacobian_ = nullptr;
  Real gamma_ = 0.0;
  EstimateBlocks blocks_;
  std::optional<ReducedSystem> reduced_;

  // what the pattern follows from, which a change of most parameters leaves as it is
  Shape shape_;
  SparseRows hessian_, dynamics_, by_velocity_;

  // sizes
  int n_ = 0;                         // H D, own entries
  int joint_ = 0;                     // N D
  std::vector<int> host_;             // per entry: number of its player among the hosted ones
  std::vector<std::uint8_t> second_;  // per entry: order 2
  std::vector<std::uint8_t> plant_;   // per entry: the loop has its plant
  std::vector<int> velocity_driven_;  // entries of order 1
  std::vector<int> accelerated_;      // entries of order 2
  std::vector<int> all_;
  std::vector<int> entry_;  // per entry: where it lies in a joint action
  // per entry, -1 where there is none: of order 2, dx is dxbar
  std::vector<int> shared_unknown_;  // number of dxbar in the reduced system
  std::vector<int> action_unknown_;  // number of dx
  std::vector<int> shared_place_;    // place of dxbar in the reduced system
  std::vector<int> action_place_;    // place of dx
  std::vector<int> x_;               // place of x in the state
  std::vector<int> reference_;       // place of z or v
  // the same per entry of a joint action
  std::vector<int> joint_shared_unknown_, joint_action_unknown_, joint_x_;
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
  AlignedVector driving_rhs_;  // h where u follows w'S, else 0
  AlignedVector reduced_rhs_;
  AlignedVector shared_;    // dxbar, joint
  AlignedVector gradient_;  // Hessian rows times dy
  AlignedVector error_change_, from_error_, onto_weight_;
  AlignedVector velocity_;  // b_x, then dv; joint
};

void StructuredNewton::refresh(const LoopJacobian& jacobian) {
  jacobian_ = &jacobian;
  const Parameters& parameters = loop().parameters();
  blocks_.analyse(parameters.graph, loop().gains().k3, parameters.shape.dimension);
  if (reduced_ && shape_ == parameters.shape && are_same(hessian_, parameters.cost->hessian_pattern()) &&
      are_same(dynamics_, parameters.dynamics->jacobian_pattern()) &&
      are_same(by_velocity_, parameters.dynamics->velocity_pattern())) {
    return;
  }
  shape_ = parameters.shape;
  hessian_ = parameters.cost->hessian_pattern();
  dynamics_ = parameters.dynamics->jacobian_pattern();
  by_velocity_ = parameters.dynamics->velocity_pattern();
  find_pattern();
}

void StructuredNewton::find_pattern() {
  const Shape& shape = loop().shape();
  const StateLayout& layout = loop().layout();
  n_ = shape.own_entries();
  joint_ = shape.actions();
  for (std::vector<int>* numbers : {&host_, &shared_unknown_, &action_unknown_, &x_, &reference_, &velocity_driven_,
                                    &accelerated_, &all_, &entry_}) {
    numbers->clear();
  }
  second_.clear();
  plant_.clear();
  int unknowns = 0;
  for (int p = 0; p < n_; ++p) {
    const int i = shape.player_of_own(p);
    const bool second = shape.is_second_order(i);
    const bool plant = shape.has_plant(i);
    host_.push_back(p % shape.hosts());
    second_.push_back(second ? 1 : 0);
    plant_.push_back(plant ? 1 : 0);
    x_.push_back(layout.x_of(p));
    reference_.push_back(layout.reference_of(p));
    shared_unknown_.push_back(second && !plant ? -1 : unknowns++);
    entry_.push_back(shape.entry_of_own(p));
    all_.push_back(p);
    (second ? accelerated_ : velocity_driven_).push_back(p);
  }
  for (int p = 0; p < n_; ++p) {
    const bool own_unknown = second_[at(p)] == 0 && plant_[at(p)] != 0;
    action_unknown_.push_back(own_unknown ? unknowns++ : second_[at(p)] != 0 ? shared_unknown_[at(p)] : -1);
  }
  for (std::vector<int>* numbers : {&joint_shared_unknown_, &joint_action_unknown_, &joint_x_}) {
    numbers->assign(at(joint_), -1);
  }
  for (int p = 0; p < n_; ++p) {
    const std::size_t entry = at(entry_[at(p)]);
    joint_shared_unknown_[entry] = shared_unknown_[at(p)];
    joint_action_unknown_[entry] = action_unknown_[at(p)];
    joint_x_[entry] = x_[at(p)];
  }
  const std::size_t n = at(n_);
  for (AlignedVector* vector : {&stiffness_, &inverse_driven_, &inverse_a2_, &inverse_a1_, &squares_, &network_gain_,
                                &activation_per_error_, &weight_per_error_, &weight_per_network_, &network_rhs_,
                                &driving_rhs_, &gradient_, &error_change_, &from_error_, &onto_weight_}) {
    vector->assign(n, 0.0);
  }
  for (AlignedVector* vector : {&shared_, &velocity_}) vector->assign(at(joint_), 0.0);
  reduced_rhs_.assign(at(unknowns), 0.0);

  // the reduced system's sparse pattern
  std::vector<std::vector<int>> rows(at(unknowns));
  const SparseRows& hessian = hessian_;
  const SparseRows& dynamics = dynamics_;
  const SparseRows& by_velocity = by_velocity_;
  hessian_gain_.clear();
  for (int p = 0; p < n_; ++p) {
    for (int k = hessian.start[at(p)]; k < hessian.start[at(p + 1)]; ++k) {
      hessian_gain_.push_back(host_[at(p)] * shape.players + shape.player_of(hessian.column[at(k)]));
    }
  }
  const auto add_known = [](std::vector<int>& row, int unknown) {
    if (unknown >= 0) row.push_back(unknown);
  };
  for (int p = 0; p < n_; ++p) {
    const int shared = shared_unknown_[at(p)];
    if (shared < 0) continue;
    rows[at(shared)].push_back(shared);
    for (int k = hessian.start[at(p)]; k < hessian.start[at(p + 1)]; ++k) {
      add_known(rows[at(shared)], joint_shared_unknown_[at(hessian.column[at(k)])]);
    }
    if (plant_[at(p)] == 0) continue;
    std::vector<int>& driven = rows[at(action_unknown_[at(p)])];
    driven.push_back(shared);
    driven.push_back(action_unknown_[at(p)]);
    for (int k = dynamics.start[at(p)]; k < dynamics.start[at(p + 1)]; ++k) {
      add_known(driven, joint_action_unknown_[at(dynamics.column[at(k)])]);
    }
    for (int k = by_velocity.start[at(p)]; k < by_velocity.start[at(p + 1)]; ++k) {
      add_known(driven, joint_shared_unknown_[at(by_velocity.column[at(k)])]);
    }
  }
  reduced_.emplace(rows);
  const auto place_of = [&](int unknown) { return unknown < 0 ? -1 : reduced_->place(unknown); };
  shared_place_.clear();
  action_place_.clear();
  for (int p = 0; p < n_; ++p) {
    shared_place_.push_back(place_of(shared_unknown_[at(p)]));
    action_place_.push_back(place_of(action_unknown_[at(p)]));
  }
}

// Column p, with r = w'S / W_max on the sphere and 0 inside, theta = 1 / W_max or 0:
//     a1 = 1 + gamma beta e r,  a2 = 1 + 2 gamma beta e r,
//     d(w'S) = S'dw = (S'b + gamma beta (|S|^2 - w'S r) de) / a2 = S'b / a2 + A de,
//     A = gamma beta (|S|^2 - w'S r) / a2.
// Where u is at its bound, the stiffness is 0 and w'S does not drive.
void StructuredNewton::factor_weights() {
  const Parameters& parameters = loop().parameters();
  const GainRows& gains = loop().gains();
  const LoopJacobian& jacobian = *jacobian_;
  for (int p = 0; p < n_; ++p) stiffness_[at(p)] = gains.k[at(p)] + jacobian.slope[at(p)];
  const auto hold_bounded = [&] {
    for (std::size_t p = 0; p < loop().gains().u_max.size(); ++p) stiffness_[p] *= jacobian.follows[p];
  };
  if (!parameters.strategy.robust) return hold_bounded();

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
  hold_bounded();
}

// Rows of the reduced system, B = stiffness, H the cost's Hessian rows, G the dynamics' Jacobian, T the gains of xbar:
//   order 1:  dz + gamma k2 (H T) dz               = b_z - gamma k2 H r
//             (1 + gamma B) dx - gamma B dz - gamma G dx = b_x - gamma h
//   order 2:  dx - gamma dv = b_x and (1 + gamma B) dv + gamma (B k2 H dy - G dx) = b_v - gamma h give
//             (1 + gamma B) dx + gamma^2 (B k2 H dy - G dx) = (1 + gamma B) b_x + gamma (b_v - gamma h)
void StructuredNewton::factor_reduced() {
  const Parameters& parameters = loop().parameters();
  const AlignedVector& k2 = loop().gains().k2;
  const SparseRows& hessian = parameters.cost->hessian_pattern();
  const SparseRows& dynamics = parameters.dynamics->jacobian_pattern();
  const AlignedVector& gain = blocks_.shared_signal_gain();
  reduced_->clear();
  const auto add = [&](int row, int column, Real value) {
    if (column >= 0) reduced_->add(row, column, value);
  };
  for (int p = 0; p < n_; ++p) {
    const bool second = second_[at(p)] != 0;
    const int shared = shared_unknown_[at(p)];
    if (shared < 0) continue;
    const Real B = stiffness_[at(p)];
    inverse_driven_[at(p)] = 1.0 / (1.0 + gamma_ * B);
    const int driven = action_unknown_[at(p)];
    const Real weight = second ? gamma_ * gamma_ : gamma_;
    const Real gradient_weight = second ? weight * B * k2[at(p)] : gamma_ * k2[at(p)];
    for (int k = hessian.start[at(p)]; k < hessian.start[at(p + 1)]; ++k) {
      const Real T = gain[at(hessian_gain_[at(k)])];
      add(shared, joint_shared_unknown_[at(hessian.column[at(k)])], gradient_weight * jacobian_->hessian[at(k)] * T);
    }
    if (second) {
      reduced_->add(shared, shared, 1.0 + gamma_ * B);
    } else {
      reduced_->add(shared, shared, 1.0);
      if (driven < 0) continue;
      reduced_->add(driven, driven, 1.0 + gamma_ * B);
      reduced_->add(driven, shared, -gamma_ * B);
    }
    for (int k = dynamics.start[at(p)]; k < dynamics.start[at(p + 1)]; ++k) {
      add(driven, joint_action_unknown_[at(dynamics.column[at(k)])], -weight * jacobian_->dynamics[at(k)]);
    }
    // dv = (dx - b_x) / gamma
    const SparseRows& by_velocity = parameters.dynamics->velocity_pattern();
    for (int k = by_velocity.start[at(p)]; k < by_velocity.start[at(p + 1)]; ++k) {
      add(driven, joint_shared_unknown_[at(by_velocity.column[at(k)])],
          -(second ? gamma_ : 1.0) * jacobian_->dynamics_by_velocity[at(k)]);
    }
  }
}

bool StructuredNewton::factor(const LoopJacobian& jacobian, Real gamma) {
  jacobian_ = &jacobian;
  gamma_ = gamma;
  factor_weights();
  blocks_.factor(gamma);
  factor_reduced();
  return reduced_->factor();
}

/// Rows of the cost's Hessian times dy: changes of the gradients.
void StructuredNewton::apply_hessian(const std::vector<int>& rows, const Real* dy) {
  const SparseRows& hessian = loop().parameters().cost->hessian_pattern();
  for (const int p : rows) {
    const Real* own = dy + host_[at(p)] * joint_;
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
  Real* dy = b + layout.estimates();
  Real* dW = b + layout.weights();
  Real* h = network_rhs_.data();

  // estimates and weights without the unknowns of the reduced system
  blocks_.solve(dy);
  apply_hessian(all_, dy);
  if (robust) {
    kernel.column_products(n_, shape.neurons, jacobian_->activation.data(), dW, h);
    for (int p = 0; p < n_; ++p) h[p] *= inverse_a2_[at(p)];
  } else {
    std::fill_n(h, n_, 0.0);
  }
  const Real* driving = h;
  if (!loop().gains().u_max.empty()) {
    for (int p = 0; p < n_; ++p) driving_rhs_[at(p)] = jacobian_->follows[at(p)] * h[p];
    driving = driving_rhs_.data();
  }

  // the reduced system
  const auto along_velocities = [&](int p, const Real* dv) {
    const SparseRows& by_velocity = parameters.dynamics->velocity_pattern();
    Real dg = 0.0;
    for (int k = by_velocity.start[at(p)]; k < by_velocity.start[at(p + 1)]; ++k) {
      dg += jacobian_->dynamics_by_velocity[at(k)] * dv[by_velocity.column[at(k)]];
    }
    return dg;
  };
  const bool has_velocities = parameters.dynamics->velocity_pattern().entries() != 0;
  if (has_velocities) {
    for (int k = 0; k < joint_; ++k) velocity_[at(k)] = joint_x_[at(k)] < 0 ? 0.0 : b[joint_x_[at(k)]];
  }
  for (const int p : velocity_driven_) {
    reduced_rhs_[at(shared_place_[at(p)])] = b[reference_[at(p)]] - gamma_ * k2[at(p)] * gradient_[at(p)];
    if (plant_[at(p)] == 0) continue;
    reduced_rhs_[at(action_place_[at(p)])] = b[x_[at(p)]] - gamma_ * driving[p];
    if (has_velocities) reduced_rhs_[at(action_place_[at(p)])] -= along_velocities(p, velocity_.data());
  }
  for (const int p : accelerated_) {
    if (plant_[at(p)] == 0) continue;
    const Real B = stiffness_[at(p)];
    const Real known = driving[p] + B * k2[at(p)] * gradient_[at(p)];
    reduced_rhs_[at(shared_place_[at(p)])] =
        (1.0 + gamma_ * B) * b[x_[at(p)]] + gamma_ * (b[reference_[at(p)]] - gamma_ * known);
    if (has_velocities) reduced_rhs_[at(shared_place_[at(p)])] -= gamma_ * along_velocities(p, velocity_.data());
  }
  reduced_->solve(reduced_rhs_.data());

  // back to estimates, actions, references and velocities
  for (const int p : velocity_driven_) {
    const Real dz = reduced_rhs_[at(shared_place_[at(p)])];
    shared_[at(entry_[at(p)])] = b[reference_[at(p)]] = dz;
    error_change_[at(p)] = -dz;
    if (plant_[at(p)] == 0) continue;
    const Real dx = reduced_rhs_[at(action_place_[at(p)])];
    b[x_[at(p)]] = dx;
    error_change_[at(p)] = dx - dz;
  }
  for (const int p : accelerated_) {
    if (plant_[at(p)] != 0) shared_[at(entry_[at(p)])] = b[x_[at(p)]] = reduced_rhs_[at(shared_place_[at(p)])];
  }
  if (has_velocities) {
    for (int k = 0; k < joint_; ++k) {
      if (joint_x_[at(k)] >= 0) velocity_[at(k)] = (b[joint_x_[at(k)]] - velocity_[at(k)]) / gamma_;
    }
  }
  kernel.add_shared_signal(shape.hosts(), shape.players, shape.dimension, blocks_.shared_signal_gain().data(),
                           shared_.data(), dy);
  apply_hessian(accelerated_, dy);
  for (const int p : accelerated_) {
    if (plant_[at(p)] == 0) {
      error_change_[at(p)] = k2[at(p)] * gradient_[at(p)];
      continue;
    }
    Real dg = 0.0;
    for (int k = dynamics.start[at(p)]; k < dynamics.start[at(p + 1)]; ++k) {
      const int place = joint_x_[at(dynamics.column[at(k)])];
      if (place >= 0) dg += jacobian_->dynamics[at(k)] * b[place];
    }
    if (has_velocities) dg += along_velocities(p, velocity_.data());
    const Real push = driving[p] + stiffness_[at(p)] * k2[at(p)] * gradient_[at(p)] - dg;
    Real& dv = b[reference_[at(p)]];
    dv = (dv - gamma_ * push) * inverse_driven_[at(p)];
    error_change_[at(p)] = dv + k2[at(p)] * gradient_[at(p)];
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
