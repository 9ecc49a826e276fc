// CVODE's prediction from its Nordsieck columns, and the way back; part of level.cpp.

template <int order, bool scaled, bool back>
void predict_of_order(Index n, double* const* column, const double* factor) {
  for_columns(n, [=](auto width, Index p) __attribute__((always_inline)) {
    using Width = decltype(width);
    Width z[order + 1];
    for (int j = 0; j <= order; ++j) z[j] = load_as<Width>(column[j] + p);
    if constexpr (scaled) {
      for (int j = 1; j <= order; ++j) z[j] *= factor[j];
      store(z[order], column[order] + p);
    }
    for (int k = 1; k <= order; ++k) {
      for (int j = order; j >= k; --j) z[j - 1] = back ? z[j - 1] - z[j] : z[j - 1] + z[j];
    }
    for (int j = 0; j < order; ++j) store(z[j], column[j] + p);
  });
}

template <int order>
inline void predict_by(Index n, double* const* column, const double* factor, bool back) {
  if (back) {
    predict_of_order<order, false, true>(n, column, nullptr);
  } else if (factor == nullptr) {
    predict_of_order<order, false, false>(n, column, nullptr);
  } else {
    predict_of_order<order, true, false>(n, column, factor);
  }
}

inline void by_order(std::int64_t n, int order, double* const* column, const double* factor, bool back) {
  switch (order) {
    case 1:
      return predict_by<1>(n, column, factor, back);
    case 2:
      return predict_by<2>(n, column, factor, back);
    case 3:
      return predict_by<3>(n, column, factor, back);
    case 4:
      return predict_by<4>(n, column, factor, back);
    case 5:
      return predict_by<5>(n, column, factor, back);
    default:
      return;
  }
}

void predict(std::int64_t n, int order, double* const* column, const double* factor) {
  by_order(n, order, column, factor, false);
}

void predict_back(std::int64_t n, int order, double* const* column) { by_order(n, order, column, nullptr, true); }
