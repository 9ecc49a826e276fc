// Every number that a run of the closed loop depends on besides its state, its inputs and time.
#pragma once

#include <array>
#include <vector>

#include "cloned.hpp"
#include "communication_graph.hpp"
#include "expression/named_parameters.hpp"
#include "families/cost.hpp"
#include "families/disturbance.hpp"
#include "families/unknown_dynamics.hpp"
#include "gains.hpp"
#include "types.hpp"

namespace mixed_order_game {

struct Strategy {
  bool robust = true;     ///< network and robust term in the control (Theorem 1); without them, Theorem 2
  bool perturbed = true;  ///< unknown dynamics and disturbance in the plant
};

struct RbfNetwork {
  bool diagonal = true;       ///< centre m is c_m (1, ..., 1)
  std::vector<Real> centers;  ///< q numbers c_m, or q rows of N D entries in the order of a joint action
  Real width = 0.0;           ///< rho
  Real W_max = 0.0;           ///< bound of w'w for each weight column
};

/// Initial state; the weights start at zero.
struct InitialState {
  std::vector<Real> x;          ///< entry(i, l)
  std::vector<Real> reference;  ///< z0 (order 1) or v0 (order 2) at entry(i, l)
  std::vector<Real> y;          ///< i * N D + entry(j, l)
};

struct Parameters {
  Shape shape;
  Gains gains;
  Strategy strategy;
  RbfNetwork rbf;
  CommunicationGraph graph;
  Cloned<Cost> cost;
  Cloned<UnknownDynamics> dynamics;
  Cloned<Disturbance> disturbance;
  InitialState initial;
  NamedParameters named = {};
  std::vector<Real> guess = {};  ///< where the search for the Nash equilibrium begins, entry(i, l)

  /// Whatever declares coefficients, in the order of the variables.
  [[nodiscard]] std::array<GameFamily*, 3> families() { return {&*cost, &*dynamics, &*disturbance}; }
  [[nodiscard]] std::array<const GameFamily*, 3> families() const { return {&*cost, &*dynamics, &*disturbance}; }

  /// The same game with every coefficient and initial value zero, for those of a direction.
  [[nodiscard]] Parameters zero_direction() const {
    Parameters zero = *this;
    for (const auto member : Gains::members()) (zero.gains.*member).assign(at(shape.players), 0.0);
    zero.rbf.width = zero.rbf.W_max = 0.0;
    zero.graph = CommunicationGraph(shape.players);
    for (GameFamily* family : zero.families()) family->coefficients.set_all_to_zero();
    for (std::vector<Real>* values :
         {&zero.rbf.centers, &zero.initial.x, &zero.initial.reference, &zero.initial.y, &zero.named.values}) {
      values->assign(values->size(), 0.0);
    }
    return zero;
  }

  /// Rebuilds what is derived from coefficients; called after any of them changed.
  void refresh() {
    graph.refresh();
    for (GameFamily* family : families()) {
      family->coefficients.named = named.values;
      family->refresh();
    }
  }
};

}  // namespace mixed_order_game
