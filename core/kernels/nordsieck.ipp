// CVODE's prediction from its Nordsieck columns; part of level.cpp.

template <int order, bool scaled>
void predict(long n, double* const* column, const double* factor) {
  for_columns(n, [=](auto width, long p) __attribute__((always_inline)) {
    using Width = decltype(width);
    Width z[order + 1];
    for (int j = 0; j <= order; ++j) z[j] = load_as<Width>(column[j] + p);
    if constexpr (scaled) {
      for (int j = 1; j <= order; ++j) z[j] *= factor[j];
      store(z[order], column[order] + p);
    }
    for (int k = 1; k <= order; ++k) {
      for (int j = order; j >= k; --j) z[j - 1] += z[j];
    }
    for (int j = 0; j < order; ++j) store(z[j], column[j] + p);
  });
}

template <int order>
inline void predict_by_order(long n, double* const* column, const double* factor) {
  if (factor != nullptr) {
    predict<order, true>(n, column, factor);
  } else {
    predict<order, false>(n, column, nullptr);
  }
}

void predict(std::int64_t n, int order, double* const* column, const double* factor) {
  switch (order) {
    case 1:
      return predict_by_order<1>(n, column, factor);
    case 2:
      return predict_by_order<2>(n, column, factor);
    case 3:
      return predict_by_order<3>(n, column, factor);
    case 4:
      return predict_by_order<4>(n, column, factor);
    case 5:
      return predict_by_order<5>(n, column, factor);
    default:
      return;
  }
}
