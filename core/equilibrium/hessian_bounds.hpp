// Enclosures of the second derivatives of the players' costs over boxes of joint actions.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "expression/enclosure.hpp"
#include "families/expression_cost.hpp"
#include "game/parameters.hpp"

namespace mixed_order_game {

class HessianBounds {
 public:
  /// The expressions are those of the parameters' cost, by player.
  HessianBounds(const Parameters& parameters, const std::vector<ExpressionCost::Text>& expressions);

  /// The condition of the player's cost that switches at x or within rounding of it; null if there is none.
  [[nodiscard]] const Switch* kink_at(int i, const std::vector<Real>& x) const;

  /// Encloses d^2 f_i / (d x_il d x_jh) over a box of joint actions at values[l n + entry(j, h)], n = N D.
  Enclosure::Found rows(int i, const std::vector<Interval>& box, std::vector<Interval>& values) const;

  /// The same along player i's own actions alone; what else is in the rows is not told.
  Enclosure::Found own_rows(int i, const std::vector<Interval>& box, std::vector<Interval>& values) const;

  /// Whether f_i is defined everywhere, without conditions, and its second derivatives are the same everywhere.
  [[nodiscard]] bool has_affine_gradient(int i) const;

  /// The actions that rows(), or own_rows(), depend on.
  [[nodiscard]] std::vector<int> actions_of_rows(int i) const;
  [[nodiscard]] std::vector<int> actions_of_own_rows(int i) const;

  /// Whether f_i is proved convex in x_i at all x_i within a distance of x in each coordinate, the other players
  /// staying at x: wherever f_i is defined, which is a convex set. The distance may be infinite.
  [[nodiscard]] bool is_convex(int i, const std::vector<Real>& x, Real distance) const;

 private:
  /// Some second derivatives, after nodes that tell where the cost is defined.
  struct Derivatives {
    std::optional<Enclosure> enclosure;
    std::vector<std::pair<int, int>> place;  // l and column; l is -1 for those that come before
    std::vector<int> actions;                // that the second derivatives depend on
  };
  struct OfPlayer {
    ExpressionGraph graph;
    Derivatives own;  // along the own action
    Derivatives all;
  };
  enum class Columns { own, all };
  Enclosure::Found enclose(int i, Columns columns, const std::vector<Interval>& box,
                           std::vector<Interval>& values) const;
  [[nodiscard]] bool is_positive_semidefinite(int i, const std::vector<Interval>& rows) const;

  const Parameters& parameters_;
  std::vector<std::unique_ptr<OfPlayer>> players_;  // null without an expression
};

}  // namespace mixed_order_game
