// Enclosures of the unknown dynamics and of their derivatives over boxes of joint actions and velocities.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "expression/enclosure.hpp"
#include "families/expression_cost.hpp"
#include "game/parameters.hpp"

namespace mixed_order_game {

class DynamicsBounds {
 public:
  /// The expressions are those of the parameters' dynamics, by own entry.
  DynamicsBounds(const Parameters& parameters, const std::vector<ExpressionCost::Text>& expressions);

  /// While all are at rest: encloses g_il over a box of joint actions at values[l], d g_il / d x_k at rows[l n + k].
  Enclosure::Found along_actions(int i, const std::vector<Interval>& box, std::vector<Interval>& rows,
                                 std::vector<Interval>& values) const;

  /// Encloses d g_il / d v_k at rows[l n + k]. The box has 2 n sides, those of the actions, then those of the
  /// velocities.
  Enclosure::Found along_velocities(int i, const std::vector<Interval>& box, std::vector<Interval>& rows) const;

  /// The sides of these boxes that the rows depend on.
  [[nodiscard]] std::vector<int> sides_along_actions(int i) const;
  [[nodiscard]] std::vector<int> sides_along_velocities(int i) const;

 private:
  /// Some derivatives of g_i, after its values.
  struct Derivatives {
    std::optional<Enclosure> enclosure;
    std::vector<std::pair<int, int>> place;  // l and column
    std::vector<Leaf> leaves;                // of the derivatives alone
  };
  struct OfPlayer {
    ExpressionGraph graph;
    Derivatives actions;
    Derivatives velocities;
  };
  Enclosure::Found enclose(const Derivatives& derivatives, const std::vector<Interval>& box,
                           std::vector<Interval>& rows, std::vector<Interval>& values) const;

  const Parameters& parameters_;
  std::vector<std::unique_ptr<OfPlayer>> players_;  // null without an expression
};

}  // namespace mixed_order_game
