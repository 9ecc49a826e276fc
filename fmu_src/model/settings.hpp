// Everything that an importer sets (parameters, tolerances, inputs) and everything that it can read besides.
#pragma once

#include "game/game.hpp"
#include "integration/integrator.hpp"
#include "loop/closed_loop.hpp"
#include "loop/inputs.hpp"

namespace mixed_order_game {

struct Settings {
  explicit Settings(const Game& game) : parameters(game.parameters), inputs(InputLayout(game.parameters).size()) {}

  Parameters parameters;
  bool allow_disconnected = false;
  Real tolerance_relative = 0.0;  ///< 0: not set
  Real tolerance_absolute = 0.0;  ///< 0: not set
  Real settling_band = 0.0;       ///< 0: a part of the initial error
  Real judge_from = 0.0;          ///< absolute, s
  Inputs inputs;                  ///< as ClosedLoop::inputs says
};

/// What differs between two sets of settings; parameters include inputs.
enum class Change { none, input, parameters };

/// What has to be computed before a variable can be read.
enum class Stage {
  settings,     ///< nothing
  inputs,       ///< the inputs, as they were set
  state,        ///< time and state
  signals,      ///< signals and rates of the closed loop
  statistics,   ///< the work done
  equilibrium,  ///< state and x_star
  judgement,    ///< of the run up to here
};

/// The sources of all variables; only those of the stages asked for are valid.
struct View {
  const Settings* settings = nullptr;
  const ClosedLoop* loop = nullptr;
  Real time = 0.0;
  const Real* inputs = nullptr;         ///< as they were set
  const Real* acting_inputs = nullptr;  ///< those that act now
  const Real* state = nullptr;
  Plants plants{};
  const Real* rate = nullptr;
  const Signals* signals = nullptr;
  const Real* x_star = nullptr;  ///< null unless it is known
  const Judgement* judgement = nullptr;
  Statistics statistics;
};

/// How the sources of a View change along a direction, to first order.
struct Tangent {
  const Real* state = nullptr;
  const Real* rate = nullptr;
  const Real* inputs = nullptr;
  const Real* control = nullptr;
  const Real* actions = nullptr;
  const Real* shared = nullptr;
  const Real* x_star = nullptr;
};

}  // namespace mixed_order_game
