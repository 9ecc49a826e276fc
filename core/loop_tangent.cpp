#include "loop_tangent.hpp"

#include "kernels/kernels.hpp"

namespace mixed_order_game {

LoopTangent::LoopTangent(const ClosedLoop& loop)
    : state(at(loop.layout().size())),
      control(at(loop.shape().actions())),
      rate(state.size()),
      loop_(&loop),
      gradient_(control.size()),
      dynamics_(control.size()),
      disturbance_(control.size()),
      estimates_(control.size() * at(loop.shape().players)) {}

std::size_t LoopTangent::driven(int p) const {
  const Shape& shape = loop_->shape();
  return at(p + (shape.is_second_order(shape.player_of(p)) ? loop_->layout().reference() : loop_->layout().x()));
}

void LoopTangent::follow_state(const LoopJacobian& jacobian) {
  jacobian.multiply(state.data(), rate.data(), control.data());
}

void LoopTangent::follow_parameters(const LoopJacobian& jacobian, const Parameters& direction, Real t,
                                    const Real* initial_state, const Signals& signals) {
  loop_->initial_state(direction.initial, state.data());
  follow_state(jacobian);
  add_parameters(direction, t, initial_state, signals);
}

void LoopTangent::add_input(const Real* d_ext) {
  for (int p = 0; p < loop_->shape().actions(); ++p) rate[driven(p)] += d_ext[p];
}

void LoopTangent::add_time(Real t, Real change) {
  if (!loop_->parameters().strategy.perturbed) return;
  loop_->parameters().disturbance->rates(t, disturbance_.data());
  for (int p = 0; p < loop_->shape().actions(); ++p) rate[driven(p)] += change * disturbance_[at(p)];
}

void LoopTangent::add_parameters(const Parameters& direction, Real t, const Real* initial_state,
                                 const Signals& signals) {
  const Kernels& kernel = kernels();
  const Parameters& parameters = loop_->parameters();
  const Shape& shape = loop_->shape();
  const StateLayout& layout = loop_->layout();
  const Gains& gains = parameters.gains;
  const Gains& dgains = direction.gains;
  const RbfNetwork& rbf = parameters.rbf;
  const int n = shape.actions();
  const Real* y = initial_state + layout.estimates();
  const bool robust = parameters.strategy.robust;

  parameters.cost->own_gradients_along(*direction.cost, y, n, gradient_.data());
  if (parameters.strategy.perturbed) {
    parameters.dynamics->values_along(*direction.dynamics, initial_state + layout.x(), dynamics_.data());
    parameters.disturbance->values_along(*direction.disturbance, t, disturbance_.data());
  }
  for (int p = 0; p < n; ++p) {
    const bool second = shape.is_second_order(shape.player_of(p));
    const Real e = signals.error[at(p)];
    // e = x - z or v + k2 grad
    const Real dstep = dgains.k2 * signals.gradient[at(p)] + gains.k2 * gradient_[at(p)];
    const Real de = second ? dstep : 0.0;
    // u = -k e - phi, phi = delta tanh(a), a = K delta e / epsilon; the weights are zero
    Real dphi = 0.0;
    if (robust) {
      const Real tanh = gains.delta != 0.0 ? signals.robust[at(p)] / gains.delta : 0.0;
      const Real da = robust_term_constant / gains.epsilon *
                      (dgains.delta * e + gains.delta * de - gains.delta * e * (dgains.epsilon / gains.epsilon));
      dphi = dgains.delta * tanh + gains.delta * ((1.0 - tanh) * (1.0 + tanh)) * da;
    }
    const Real k = second ? gains.k4 : gains.k1;
    const Real dk = second ? dgains.k4 : dgains.k1;
    const Real du = -(dk * e + k * de) - dphi;
    control[at(p)] += du;
    rate[driven(p)] += du;
    if (parameters.strategy.perturbed) rate[driven(p)] += dynamics_[at(p)] + disturbance_[at(p)];
    if (!second) rate[at(layout.reference() + p)] -= dstep;  // z' = -k2 grad
    for (int m = 0; robust && m < shape.neurons; ++m) {
      // w' = beta S e
      rate[at(layout.weights_of(m) + p)] += (dgains.beta * e + gains.beta * de) * signals.activation[at(m * n + p)];
    }
  }

  for (int m = 0; robust && m < shape.neurons; ++m) {
    for (int i = 0; i < shape.players; ++i) {
      // S = exp(-|y_i - c|^2 / rho^2): dS = S 2 / rho^2 ((y_i - c) . dc + |y_i - c|^2 drho / rho)
      Real exponent = 0.0;
      for (int k = 0; k < n; ++k) {
        const std::size_t at_center = at(rbf.diagonal ? m : m * n + k);
        const Real distance = y[i * n + k] - rbf.centers[at_center];
        exponent += distance * (direction.rbf.centers[at_center] + distance * (direction.rbf.width / rbf.width));
      }
      exponent *= 2.0 / (rbf.width * rbf.width);
      for (int p = i; p < n; p += shape.players) {
        rate[at(layout.weights_of(m) + p)] +=
            gains.beta * signals.error[at(p)] * signals.activation[at(m * n + p)] * exponent;
      }
    }
  }

  // y' is linear in k3 and in the edges' weights
  const auto add_estimates = [&](const CommunicationGraph& graph, Real k3) {
    kernel.estimate_rates(shape.players, shape.dimension, graph.neighbours(), k3, y, signals.shared.data(),
                          estimates_.data());
    for (std::size_t k = 0; k < estimates_.size(); ++k) rate[at(layout.estimates()) + k] += estimates_[k];
  };
  add_estimates(parameters.graph, dgains.k3);
  add_estimates(direction.graph, gains.k3);
}

}  // namespace mixed_order_game
