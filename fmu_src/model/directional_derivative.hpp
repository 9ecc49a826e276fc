// How the variables change when known ones do, to first order and in the present projection modes.
#pragma once

#include <cstdint>
#include <span>

#include "evaluation.hpp"
#include "loop/loop_tangent.hpp"
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

  /// Along changes of known variables, where the run stands. Tangents are valid until the next call.
  Tangent along(const Changes& changes, Equations equations, const View& view, const Standing& standing);
  /// Along the run itself: per unit of time, with the inputs that act.
  Tangent along_run(const View& view, const Standing& standing, const Inputs& inputs);

 private:
  [[nodiscard]] Parameters parameters_along(const Changes& changes) const;
  [[nodiscard]] Tangent tangent() const;

  const Model* model_;
  const ClosedLoop* loop_;
  LoopTangent tangent_;
  std::vector<Real> x_star_;
};

}  // namespace mixed_order_game
