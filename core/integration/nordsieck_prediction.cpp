#include "integration/nordsieck_prediction.hpp"

#include "kernels/kernels.hpp"

namespace mixed_order_game {

void NordsieckPrediction::scale(int count, const Real* factors, Real* const* columns) {
  finish();
  if (count > most_order) {
    for (int j = 0; j < count; ++j) kernels().scale(size_, factors[j], columns[j], columns[j]);
    return;
  }
  scaled_ = count;
  for (int j = 0; j < count; ++j) {
    scaled_column_[at(j)] = columns[j];
    factor_[at(j + 1)] = factors[j];
  }
}

void NordsieckPrediction::add(Real* to, const Real* from, bool subtract) {
  if (additions_ == most_additions || (subtract != subtract_ && additions_ != 0) || (subtract && scaled_ != 0))
    finish();
  subtract_ = subtract;
  addition_[at(additions_++)] = {to, from};
}

bool NordsieckPrediction::is_prediction(int order, std::array<Real*, most_order + 1>* columns) const {
  if (additions_ != order * (order + 1) / 2 || (scaled_ != 0 && scaled_ != order)) return false;
  // the first pass names all columns but z_q, which is scaled or else only read
  for (int j = order; j >= 1; --j) (*columns)[at(j - 1)] = addition_[at(order - j)].to;
  (*columns)[at(order)] = scaled_ != 0 ? scaled_column_[at(order - 1)] : const_cast<Real*>(addition_[0].from);
  for (int j = 1; j <= scaled_; ++j) {
    if (scaled_column_[at(j - 1)] != (*columns)[at(j)]) return false;
  }
  auto addition = addition_.begin();
  for (int k = 1; k <= order; ++k) {
    for (int j = order; j >= k; --j, ++addition) {
      if (addition->to != (*columns)[at(j - 1)] || addition->from != (*columns)[at(j)]) return false;
    }
  }
  return true;
}

void NordsieckPrediction::carry_out() {
  std::array<Real*, most_order + 1> columns{};
  for (int order = 1; order <= most_order; ++order) {
    if (!is_prediction(order, &columns)) continue;
    if (subtract_) {
      kernels().predict_back(size_, order, columns.data());
    } else {
      kernels().predict(size_, order, columns.data(), scaled_ != 0 ? factor_.data() : nullptr);
    }
    return forget();
  }
  for (int j = 0; j < scaled_; ++j) {
    kernels().scale(size_, factor_[at(j + 1)], scaled_column_[at(j)], scaled_column_[at(j)]);
  }
  for (int k = 0; k < additions_; ++k) {
    const auto& [to, from] = addition_[at(k)];
    kernels().linear_sum(size_, 1.0, to, subtract_ ? -1.0 : 1.0, from, to);
  }
  forget();
}

}  // namespace mixed_order_game
