#include "game/parameters.hpp"

#include "errors.hpp"
#include "number_text.hpp"

namespace mixed_order_game {

void require_bounded_weights(const Parameters& parameters) {
  constexpr Real excess = 1e-9;  // of rounding, which is scaled away
  const Shape& shape = parameters.shape;
  const std::vector<Real>& W = parameters.initial.W;
  if (W.empty()) return;
  for (int i = 0; i < shape.players; ++i) {
    const Real W_max = parameters.rbf.W_max[at(i)];
    for (int l = 0; l < shape.dimension; ++l) {
      Real norm2 = 0.0;
      for (int m = 0; m < shape.neurons; ++m) {
        const Real w = W[at(m * shape.actions() + shape.entry(i, l))];
        norm2 += w * w;
      }
      if (norm2 <= W_max * (1.0 + excess)) continue;
      throw GameError("the initial weights W0 of player " + std::to_string(i + 1) + ", coordinate " +
                          std::to_string(l + 1) + ", have the squared norm " + text_of(norm2) +
                          ", expected at most W_max, " + text_of(W_max),
                      "player[" + std::to_string(i + 1) + "].W0");
    }
  }
}

}  // namespace mixed_order_game
