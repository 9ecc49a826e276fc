// The vector operations that CVODE spends its time in; part of level.cpp.

void linear_sum(std::int64_t n, double a, const double* x, double b, const double* y, double* z) {
  // z may be x or y. The cases follow from exactness: a x - a y is computed as a (x - y), which vanishes for x = y.
  const auto set = [=](auto term) {
    set_row(n, z, [=](auto width, Index k) {
      using Width = decltype(width);
      return term(load_as<Width>(x + k), load_as<Width>(y + k));
    });
  };
  if (b == 1.0 && a == 1.0) {
    set([](const auto& xk, const auto& yk) { return xk + yk; });
  } else if (a == 1.0 && b == -1.0) {
    set([](const auto& xk, const auto& yk) { return xk - yk; });
  } else if (a == -1.0 && b == 1.0) {
    set([](const auto& xk, const auto& yk) { return yk - xk; });
  } else if (b == 1.0) {
    set([=](const auto& xk, const auto& yk) { return a * xk + yk; });
  } else if (a == 1.0) {
    set([=](const auto& xk, const auto& yk) { return xk + b * yk; });
  } else if (a == b) {
    set([=](const auto& xk, const auto& yk) { return a * (xk + yk); });
  } else if (a == -b) {
    set([=](const auto& xk, const auto& yk) { return a * (xk - yk); });
  } else {
    set([=](const auto& xk, const auto& yk) { return a * xk + b * yk; });
  }
}

void scale(std::int64_t n, double c, const double* x, double* z) {
  if (c == 1.0) {
    if (x != z) __builtin_memcpy(z, x, static_cast<unsigned long>(n) * sizeof(double));
    return;
  }
  set_row(n, z, [=](auto width, Index k) { return c * load_as<decltype(width)>(x + k); });
}

void fill(std::int64_t n, double c, double* z) {
  set_row(n, z, [=](auto width, Index) { return decltype(width){} + c; });
}

void error_weights(std::int64_t n, double relative, double absolute, const double* y, double* weight) {
  for (std::int64_t k = 0; k < n; ++k) weight[k] = 1.0 / (relative * fabs(y[k]) + absolute);
}

double max_norm(std::int64_t n, const double* x) {
  double largest = 0.0;
  for (std::int64_t k = 0; k < n; ++k) {
    const double size = fabs(x[k]);
    largest = size > largest ? size : largest;  // a NaN is left to the error test
  }
  return largest;
}

void newton_residual(std::int64_t n, double gamma, const double* f, double rl1, const double* zn1,
                     const double* correction, double* delta) {
  set_row(n, delta, [=](auto width, Index k) {
    using Width = decltype(width);
    return gamma * load_as<Width>(f + k) - (rl1 * load_as<Width>(zn1 + k) + load_as<Width>(correction + k));
  });
}

void add_correction(std::int64_t n, double scale_of, const double* delta, const double* predicted, double* correction,
                    double* y) {
  // correction first: its last vector is put last, so y must not read it back
  set_row(n, y, [=](auto width, Index k) {
    using Width = decltype(width);
    return load_as<Width>(predicted + k) + (load_as<Width>(correction + k) + scale_of * load_as<Width>(delta + k));
  });
  set_row(n, correction, [=](auto width, Index k) {
    using Width = decltype(width);
    return load_as<Width>(correction + k) + scale_of * load_as<Width>(delta + k);
  });
}

void add_difference(std::int64_t n, double a, const double* x, const double* y, double* z) {
  set_row(n, z, [=](auto width, Index k) {
    using Width = decltype(width);
    return load_as<Width>(z + k) + a * (load_as<Width>(x + k) - load_as<Width>(y + k));
  });
}

/// Where their number is known, the coefficients stay in registers.
template <int count>
inline void combine_stages_of(Index n, const double* a, const double* c, const double* const* stage,
                              const double* state, double b, const double* rate, double* point, double* rhs) {
  for_columns(n, [=](auto width, Index p) __attribute__((always_inline)) {
    using Width = decltype(width);
    Width y = load_as<Width>(state + p);
    Width sum = b * load_as<Width>(rate + p);
#pragma GCC unroll 5
    for (int j = 0; j < count; ++j) {
      const Width U = load_as<Width>(stage[j] + p);
      y += a[j] * U;
      sum += c[j] * U;
    }
    store(y, point + p);
    store(sum, rhs + p);
  });
}

void combine_stages(std::int64_t n, int count, const double* a, const double* c, const double* const* stage,
                    const double* state, double b, const double* rate, double* point, double* rhs) {
  switch (count) {
    case 1:
      return combine_stages_of<1>(n, a, c, stage, state, b, rate, point, rhs);
    case 2:
      return combine_stages_of<2>(n, a, c, stage, state, b, rate, point, rhs);
    case 3:
      return combine_stages_of<3>(n, a, c, stage, state, b, rate, point, rhs);
    case 4:
      return combine_stages_of<4>(n, a, c, stage, state, b, rate, point, rhs);
    default:
      return combine_stages_of<5>(n, a, c, stage, state, b, rate, point, rhs);
  }
}
