// How the variables change when known ones do, to first order and in the present projection modes.
#pragma once

#include <cstdint>
#include <span>

#include "loop_tangent.hpp"
#include "unknowns.hpp"

namespace mixed_order_game {

class DirectionalDerivative {
 public:
  /// Changes of known variables; those of one that is named twice add up.
  struct Changes {
    std::span<const std::uint32_t> references;
    const Real* values;
  };

  /// Both must outlive it.
  DirectionalDerivative(const Model& model, const ClosedLoop& loop);

  /// Along changes of known variables, at the point where the loop was evaluated and linearized. Tangents are valid
  /// until the next call.
  Tangent along(const Changes& changes, Equations equations, const View& view, const LoopJacobian& jacobian);
  /// Along the run itself: per unit of time, with all inputs at rest.
  Tangent along_run(const View& view, const LoopJacobian& jacobian);

 private:
  void follow_states(const Changes& changes, const LoopJacobian& jacobian);
  void follow_parameters(const Changes& changes, const View& view, const LoopJacobian& jacobian);
  [[nodiscard]] Tangent tangent() const;

  const Model* model_;
  const ClosedLoop* loop_;
  LoopTangent tangent_;
  std::vector<Real> d_ext_;
  std::vector<Real> x_star_;
};

}  // namespace mixed_order_game
