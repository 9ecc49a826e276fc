// CVODE predicts a step by scaling the columns z_1 .. z_q of its Nordsieck array (when the step size has changed) and
// by q (q + 1) / 2 additions z_{j-1} = z_{j-1} + z_j, each a pass over memory. Kept back until another operation or a
// look at the data follows, they are made in one pass, in registers, with the same result to the bit.
#pragma once

#include <array>
#include <cstdint>

#include "types.hpp"

namespace mixed_order_game {

class NordsieckPrediction {
 public:
  static constexpr int most_order = 5;  ///< of BDF

  explicit NordsieckPrediction(std::int64_t size) : size_(size) {}

  /// Keeps back columns[j] = factors[j] columns[j].
  void scale(int count, const Real* factors, Real* const* columns);
  /// Keeps back to = to + from, or to - from.
  void add(Real* to, const Real* from, bool subtract = false);
  /// Does what has been kept back: in one pass when it is a prediction, otherwise one by one.
  void finish() {
    if (scaled_ + additions_ != 0) carry_out();
  }
  void forget() { scaled_ = additions_ = 0; }

 private:
  static constexpr int most_additions = most_order * (most_order + 1) / 2;
  struct Addition {
    Real* to;
    const Real* from;
  };

  void carry_out();
  bool is_prediction(int order, std::array<Real*, most_order + 1>* columns) const;

  std::int64_t size_;
  int scaled_ = 0;
  std::array<Real*, most_order> scaled_column_{};
  std::array<Real, most_order + 1> factor_{};  // of z_j
  int additions_ = 0;
  bool subtract_ = false;  // all of them
  std::array<Addition, most_additions> addition_{};
};

}  // namespace mixed_order_game
