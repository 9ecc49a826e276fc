// Every number that a run of the closed loop depends on besides its state, its inputs and time.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "cloned.hpp"
#include "expression/named_parameters.hpp"
#include "families/cost.hpp"
#include "families/disturbance.hpp"
#include "families/unknown_dynamics.hpp"
#include "game/communication_graph.hpp"
#include "game/gains.hpp"
#include "types.hpp"

namespace mixed_order_game {

struct Strategy {
  bool robust = true;     ///< network and robust term in the control (Theorem 1); without them, Theorem 2
  bool perturbed = true;  ///< unknown dynamics and disturbance in the plant
};

struct RbfNetwork {
  bool per_player = false;  ///< a player states a network of its own; otherwise all players have the same
  bool diagonal = true;     ///< centre m is c_m (1, ..., 1)
  std::vector<Real>
      centers;              ///< numbers c_m at m N + i, or rows of N D entries in the order of a joint action, see row
  std::vector<Real> width;  ///< rho, by player
  std::vector<Real> W_max;  ///< bound of w'w for each weight column, by player

  /// Number of the row that is centre m of player i.
  [[nodiscard]] std::size_t row(int m, int i) const { return per_player ? at(m) * width.size() + at(i) : at(m); }
  /// The centers of the hosted players alone, in the same order.
  [[nodiscard]] std::vector<Real> centers_of_hosts(const Shape& shape) const {
    if (!diagonal && !per_player) return centers;
    std::vector<Real> own;
    const std::size_t length = diagonal ? 1 : at(shape.actions());
    for (int m = 0; m < shape.neurons; ++m) {
      for (int h = 0; h < shape.hosts(); ++h) {
        const auto from =
            centers.begin() + static_cast<std::ptrdiff_t>((at(m * shape.players) + at(shape.host(h))) * length);
        own.insert(own.end(), from, from + static_cast<std::ptrdiff_t>(length));
      }
    }
    return own;
  }
};

/// Initial state.
struct InitialState {
  std::vector<Real> x;          ///< entry(i, l)
  std::vector<Real> reference;  ///< z0 (order 1) or v0 (order 2) at entry(i, l)
  std::vector<Real> y;          ///< h * N D + entry(j, l) of hosted player i = host(h)
  std::vector<Real> W = {};     ///< m * N D + entry(i, l); empty: zero
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
  std::vector<Real> u_max = {};  ///< bound of |u|, entry(i, l); infinite where there is none, empty: nowhere

  /// Whatever declares coefficients, in the order of the variables.
  [[nodiscard]] std::array<GameFamily*, 3> families() { return {&*cost, &*dynamics, &*disturbance}; }
  [[nodiscard]] std::array<const GameFamily*, 3> families() const { return {&*cost, &*dynamics, &*disturbance}; }

  /// The same game with every coefficient and initial value zero, for those of a direction.
  [[nodiscard]] Parameters zero_direction() const {
    Parameters zero = *this;
    for (const auto member : Gains::members()) (zero.gains.*member).assign(at(shape.players), 0.0);
    zero.graph = CommunicationGraph(shape, graph.directed());
    for (GameFamily* family : zero.families()) family->coefficients.set_all_to_zero();
    for (std::vector<Real>* values :
         {&zero.rbf.centers, &zero.rbf.width, &zero.rbf.W_max, &zero.initial.x, &zero.initial.reference,
          &zero.initial.y, &zero.initial.W, &zero.named.values, &zero.u_max}) {
      values->assign(values->size(), 0.0);
    }
    return zero;
  }

  /// Where the values that the switches of family number f hold begin among the modes.
  [[nodiscard]] int first_switch(int f) const {
    int first = shape.own_entries();
    for (int k = 0; k < f; ++k) first += families()[at(k)]->switching().count();
    return first;
  }

  /// Own entries whose controls are bounded, ascending.
  [[nodiscard]] std::vector<int> bounded() const {
    std::vector<int> entries;
    for (int p = 0; p < (u_max.empty() ? 0 : shape.own_entries()); ++p) {
      if (std::isfinite(u_max[at(shape.entry_of_own(p))])) entries.push_back(p);
    }
    return entries;
  }

  /// Throws GameError when named parameters have values with which a switch of an expression makes no sense.
  void judge_switching() const {
    for (const GameFamily* family : families()) family->switching().judge(named.values.data());
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

/// Throws GameError when an initial weight column is longer than its bound allows.
void require_bounded_weights(const Parameters& parameters);

}  // namespace mixed_order_game
