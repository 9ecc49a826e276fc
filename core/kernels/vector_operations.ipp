// The vector operations that CVODE spends its time in; part of level.cpp.

#if defined(__clang__)
#define MIXED_ORDER_GAME_IN_PLACE _Pragma("clang loop vectorize(assume_safety)")
#else
#define MIXED_ORDER_GAME_IN_PLACE _Pragma("GCC ivdep")
#endif

/// z_k = term(k), which may read entry k of z itself but no other: clang would take numbers one by one then.
template <typename Term>
inline void set_each(std::int64_t n, double* z, Term term) {
  MIXED_ORDER_GAME_IN_PLACE
  for (std::int64_t k = 0; k < n; ++k) z[k] = term(k);
}

void linear_sum(std::int64_t n, double a, const double* x, double b, const double* y, double* z) {
  // z may be x or y. The cases follow from exactness: a x - a y is computed as a (x - y), which vanishes for x = y.
  if (b == 1.0 && a == 1.0) {
    set_each(n, z, [=](std::int64_t k) { return x[k] + y[k]; });
  } else if (a == 1.0 && b == -1.0) {
    set_each(n, z, [=](std::int64_t k) { return x[k] - y[k]; });
  } else if (a == -1.0 && b == 1.0) {
    set_each(n, z, [=](std::int64_t k) { return y[k] - x[k]; });
  } else if (b == 1.0) {
    set_each(n, z, [=](std::int64_t k) { return a * x[k] + y[k]; });
  } else if (a == 1.0) {
    set_each(n, z, [=](std::int64_t k) { return x[k] + b * y[k]; });
  } else if (a == b) {
    set_each(n, z, [=](std::int64_t k) { return a * (x[k] + y[k]); });
  } else if (a == -b) {
    set_each(n, z, [=](std::int64_t k) { return a * (x[k] - y[k]); });
  } else {
    set_each(n, z, [=](std::int64_t k) { return a * x[k] + b * y[k]; });
  }
}

void scale(std::int64_t n, double c, const double* x, double* z) {
  if (c == 1.0) {
    if (x != z) __builtin_memcpy(z, x, static_cast<unsigned long>(n) * sizeof(double));
    return;
  }
  set_each(n, z, [=](std::int64_t k) { return c * x[k]; });
}

void fill(std::int64_t n, double c, double* z) {
  for (std::int64_t k = 0; k < n; ++k) z[k] = c;
}

void error_weights(std::int64_t n, double relative, double absolute, const double* __restrict y,
                   double* __restrict weight) {
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

void newton_residual(std::int64_t n, double gamma, const double* __restrict f, double rl1, const double* __restrict zn1,
                     const double* __restrict correction, double* __restrict delta) {
  for (std::int64_t k = 0; k < n; ++k) delta[k] = gamma * f[k] - (rl1 * zn1[k] + correction[k]);
}

double add_correction(std::int64_t n, double scale_of, const double* delta, const double* w, double* correction) {
  return sum_of(
      static_cast<int>(n),
      [=](int k) {
        const Vector change = scale_of * load(delta + k);
        store(load(correction + k) + change, correction + k);
        const Vector product = change * load(w + k);
        return product * product;
      },
      [=](int k) {
        const double change = scale_of * delta[k];
        correction[k] += change;
        const double product = change * w[k];
        return product * product;
      });
}
