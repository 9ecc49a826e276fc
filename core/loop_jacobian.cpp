#include "loop_jacobian.hpp"

#include <algorithm>

#include "kernels/kernels.hpp"

namespace mixed_order_game {

LoopJacobian::LoopJacobian(const ClosedLoop& loop)
    : estimates(at(loop.shape().players) * at(loop.shape().actions())),
      weights(at(loop.shape().neurons) * at(loop.shape().actions())),
      activation(weights.size()),
      error(at(loop.shape().actions())),
      network(error.size()),
      slope(error.size()),
      inverse_bound(error.size()),
      loop_(&loop),
      scratch_(weights.size() + 3 * error.size()) {
  refresh();
}

void LoopJacobian::refresh() {
  const Parameters& parameters = loop_->parameters();
  hessian.resize(at(parameters.cost->hessian_pattern().entries()));
  dynamics.resize(at(parameters.dynamics->jacobian_pattern().entries()));
}

void LoopJacobian::linearize(const Real* state, const Signals& signals, const Modes& modes) {
  const Parameters& parameters = loop_->parameters();
  const StateLayout& layout = loop_->layout();
  const int n = loop_->shape().actions();
  std::copy_n(state + layout.estimates(), estimates.size(), estimates.begin());
  parameters.cost->hessian_rows(estimates.data(), n, hessian.data());
  if (parameters.strategy.perturbed) {
    parameters.dynamics->jacobian(state + layout.x(), dynamics.data());
  } else {
    std::fill(dynamics.begin(), dynamics.end(), 0.0);
  }
  std::copy(signals.error.begin(), signals.error.end(), error.begin());
  std::copy(signals.network.begin(), signals.network.end(), network.begin());
  if (!parameters.strategy.robust) {
    std::fill(slope.begin(), slope.end(), 0.0);
    std::fill(inverse_bound.begin(), inverse_bound.end(), 0.0);
    return;
  }
  std::copy_n(state + layout.weights(), weights.size(), weights.begin());
  std::copy(signals.activation.begin(), signals.activation.end(), activation.begin());
  for (std::size_t p = 0; p < slope.size(); ++p) {
    slope[p] = loop_->robust_term_slope(signals.robust[p]);
    inverse_bound[p] = modes[p] != 0 && error[p] * network[p] >= 0.0 ? 1.0 / parameters.rbf.W_max : 0.0;
  }
}

void LoopJacobian::multiply(const Real* vector, Real* product, Real* control) const {
  const Kernels& kernel = kernels();
  const Parameters& parameters = loop_->parameters();
  const Shape& shape = loop_->shape();
  const StateLayout& layout = loop_->layout();
  const Gains& gains = parameters.gains;
  const int n = shape.actions();
  const Real* dx = vector + layout.x();
  const Real* dreference = vector + layout.reference();
  const Real* dy = vector + layout.estimates();
  const Real* dW = vector + layout.weights();
  Real* dS = scratch_.data();
  Real* dnetwork = dS + weights.size();
  Real* dshared = dnetwork + n;
  Real* wdS = dshared + n;

  std::fill_n(dnetwork, n, 0.0);
  std::fill_n(wdS, n, 0.0);
  if (parameters.strategy.robust) {
    const Real factor = -2.0 / (parameters.rbf.width * parameters.rbf.width);
    for (int m = 0; m < shape.neurons; ++m) {
      for (int i = 0; i < shape.players; ++i) {
        // dS_m = S_m (-2 / rho^2) (y_i - c_m) . dy_i
        const Real* yi = estimates.data() + i * n;
        const Real* dyi = dy + i * n;
        Real along = 0.0;
        for (int k = 0; k < n; ++k) {
          const Real c =
              parameters.rbf.diagonal ? parameters.rbf.centers[at(m)] : parameters.rbf.centers[at(m * n + k)];
          along += (yi[k] - c) * dyi[k];
        }
        for (int p = i; p < n; p += shape.players) dS[m * n + p] = activation[at(m * n + p)] * factor * along;
      }
    }
    kernel.column_products(n, shape.neurons, activation.data(), dW, dnetwork);
    kernel.column_products(n, shape.neurons, weights.data(), dS, wdS);
    for (int p = 0; p < n; ++p) dnetwork[p] += wdS[p];
  }

  const SparseRows& hessian_rows = parameters.cost->hessian_pattern();
  const SparseRows& dynamics_rows = parameters.dynamics->jacobian_pattern();
  for (int p = 0; p < n; ++p) {
    const int i = shape.player_of(p);
    const bool second = shape.is_second_order(i);
    Real dgradient = 0.0;
    for (int k = hessian_rows.start[at(p)]; k < hessian_rows.start[at(p + 1)]; ++k) {
      dgradient += hessian[at(k)] * dy[i * n + hessian_rows.column[at(k)]];
    }
    Real dg = 0.0;
    for (int k = dynamics_rows.start[at(p)]; k < dynamics_rows.start[at(p + 1)]; ++k) {
      dg += dynamics[at(k)] * dx[dynamics_rows.column[at(k)]];
    }
    const Real de = second ? dreference[p] + gains.k2 * dgradient : dx[p] - dreference[p];
    const Real du = -((second ? gains.k4 : gains.k1) + slope[at(p)]) * de - dnetwork[p];
    if (control != nullptr) control[p] = du;
    product[layout.x() + p] = second ? dreference[p] : du + dg;
    product[layout.reference() + p] = second ? du + dg : -gains.k2 * dgradient;
    dshared[p] = second ? dx[p] : dreference[p];
    // w' = beta e (S - r w) with r = w'S / W_max on the sphere and 0 inside
    const Real e = error[at(p)];
    const Real r = network[at(p)] * inverse_bound[at(p)];
    const Real dr = dnetwork[p] * inverse_bound[at(p)];
    for (int m = 0; m < shape.neurons; ++m) {
      const int k = m * n + p;
      product[layout.weights() + k] = parameters.strategy.robust
                                          ? gains.beta * (de * (activation[at(k)] - r * weights[at(k)]) +
                                                          e * (dS[k] - dr * weights[at(k)] - r * dW[k]))
                                          : 0.0;
    }
  }
  kernel.estimate_rates(shape.players, shape.dimension, parameters.graph.neighbours(), gains.k3, dy, dshared,
                        product + layout.estimates());
}

std::vector<MatrixEntry> LoopJacobian::entries(bool coupled) const {
  const Parameters& parameters = loop_->parameters();
  const Shape& shape = loop_->shape();
  const StateLayout& layout = loop_->layout();
  const Gains& gains = parameters.gains;
  const RbfNetwork& rbf = parameters.rbf;
  const int n = shape.actions();
  const SparseRows& hessian_rows = parameters.cost->hessian_pattern();
  const SparseRows& dynamics_rows = parameters.dynamics->jacobian_pattern();
  const bool robust = parameters.strategy.robust;
  const Real factor = -2.0 / (rbf.width * rbf.width);

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
  const auto dS_dy = [&](int m, int p, int k) {  // d S_m(y_i) / d y_i[k]
    const int i = shape.player_of(p);
    const Real c = rbf.diagonal ? rbf.centers[at(m)] : rbf.centers[at(m * n + k)];
    return activation[at(m * n + p)] * factor * (estimates[at(i * n + k)] - c);
  };
  const auto add_error = [&](int p, Real scale) {  // scale * de
    const int i = shape.player_of(p);
    if (shape.is_second_order(i)) {
      add(layout.reference() + p, scale);
      for (int k = hessian_rows.start[at(p)]; k < hessian_rows.start[at(p + 1)]; ++k) {
        add(layout.estimates_of(i) + hessian_rows.column[at(k)], scale * gains.k2 * hessian[at(k)]);
      }
    } else {
      add(layout.x() + p, scale);
      add(layout.reference() + p, -scale);
    }
  };
  const auto add_network = [&](int p, Real scale) {  // scale * d(w'S)
    const int i = shape.player_of(p);
    for (int m = 0; m < shape.neurons; ++m) {
      add(layout.weights_of(m) + p, scale * activation[at(m * n + p)]);
      if (!coupled) continue;
      for (int k = 0; k < n; ++k) {
        add(layout.estimates_of(i) + k, scale * weights[at(m * n + p)] * dS_dy(m, p, k));
      }
    }
  };
  const auto add_driven = [&](int p) {  // d(u + g)
    add_error(p, -((shape.is_second_order(shape.player_of(p)) ? gains.k4 : gains.k1) + slope[at(p)]));
    if (robust) add_network(p, -1.0);
    for (int k = dynamics_rows.start[at(p)]; k < dynamics_rows.start[at(p + 1)]; ++k) {
      add(layout.x() + dynamics_rows.column[at(k)], dynamics[at(k)]);
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
        add(layout.estimates_of(i) + hessian_rows.column[at(k)], -gains.k2 * hessian[at(k)]);
      }
    }
    finish(layout.reference() + p);
  }
  const NeighbourRows graph = parameters.graph.neighbours();
  for (int i = 0; i < shape.players; ++i) {
    for (int k = 0; k < n; ++k) {
      const int j = shape.player_of(k);
      for (int edge = graph.start[i]; edge < graph.start[i + 1]; ++edge) {
        add(layout.estimates_of(i) + k, -gains.k3 * graph.weight[edge]);
        add(layout.estimates_of(graph.neighbour[edge]) + k, gains.k3 * graph.weight[edge]);
      }
      const Real a = parameters.graph.weight(i, j);
      add(layout.estimates_of(i) + k, -gains.k3 * a);
      add((shape.is_second_order(j) ? layout.x() : layout.reference()) + k, gains.k3 * a);
      finish(layout.estimates_of(i) + k);
    }
  }
  for (int m = 0; robust && m < shape.neurons; ++m) {
    for (int p = 0; p < n; ++p) {
      const Real w = weights[at(m * n + p)];
      const Real e = error[at(p)];
      const Real r = network[at(p)] * inverse_bound[at(p)];
      add_error(p, gains.beta * (activation[at(m * n + p)] - r * w));
      for (int k = 0; coupled && k < n; ++k) {
        add(layout.estimates_of(shape.player_of(p)) + k, gains.beta * e * dS_dy(m, p, k));
      }
      if (inverse_bound[at(p)] != 0.0) {
        add_network(p, -gains.beta * e * w * inverse_bound[at(p)]);
        add(layout.weights_of(m) + p, -gains.beta * e * r);
      }
      finish(layout.weights_of(m) + p);
    }
  }
  return entries;
}

}  // namespace mixed_order_game
