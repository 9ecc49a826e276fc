// The variables inside the closed loop at one instant, and the projection modes that they depend on.
#pragma once

#include <vector>

#include "aligned_vector.hpp"
#include "types.hpp"

namespace mixed_order_game {

/// What is held between events. First the mode of each weight column: 0 inside (w'w < W_max), 1 on the sphere (w'w =
/// W_max and e w'S >= 0). The mode alone does not decide the dynamics of a column on the sphere: where e w'S < 0 it
/// moves as one inside, so that leaving the sphere changes nothing in the rates. Then the values that the switches of
/// the costs' expressions hold, of the dynamics' and of the disturbances'.
using Modes = std::vector<Real>;

/// Filled by ClosedLoop::evaluate. Vectors are indexed by own entries unless said otherwise.
struct Signals {
  explicit Signals(const Shape& shape)
      : shared(at(shape.actions())),
        gradient(at(shape.own_entries())),
        error(at(shape.own_entries())),
        network(at(shape.own_entries())),
        robust(at(shape.own_entries())),
        dynamics(at(shape.own_entries())),
        disturbance(at(shape.own_entries())),
        control(at(shape.own_entries())),
        radial(at(shape.own_entries())),
        exponent(at(shape.hosts()) * at(shape.neurons + 2) + 8),
        actions(shape.hosts_all() && shape.external.empty() ? 0 : at(shape.actions())),
        references(actions.size()),
        activation(at(shape.own_entries()) * at(shape.neurons)) {}

  AlignedVector shared;       ///< xbar: z (order 1) or x (order 2), at entry(i, l); 0 where it is not known
  AlignedVector gradient;     ///< grad_i f_i(y_i)
  AlignedVector error;        ///< e
  AlignedVector network;      ///< w'S
  AlignedVector robust;       ///< phi
  AlignedVector dynamics;     ///< g(x)
  AlignedVector disturbance;  ///< d(t) and external disturbance
  AlignedVector control;      ///< u
  AlignedVector radial;       ///< w'S / W_max on the sphere while e w'S >= 0, else 0
  AlignedVector exponent;     ///< scratch
  AlignedVector actions;      ///< scratch of ClosedLoop::plants, where the state does not hold all of them
  AlignedVector references;   ///< likewise
  AlignedVector activation;   ///< S_m(y_i) at m * H D + own entry
};

}  // namespace mixed_order_game
