// Adaptation of the weights, W' = beta e (S - radial W), and the sums w'S and w'w; part of level.cpp.

void column_products(int n, int rows, const double* __restrict a, const double* __restrict b, double* __restrict sum) {
  for (int p = 0; p < n; ++p) sum[p] = 0.0;
  for (int m = 0; m < rows; ++m) {
    const double* __restrict am = a + m * n;
    const double* __restrict bm = b + m * n;
    for (int p = 0; p < n; ++p) sum[p] += am[p] * bm[p];
  }
}

void weight_rates(int n, int neurons, double beta, const double* __restrict e, const double* __restrict radial,
                  const double* __restrict activation, const double* __restrict weights, double* __restrict rate) {
  for (int m = 0; m < neurons; ++m) {
    const double* __restrict s = activation + m * n;
    const double* __restrict w = weights + m * n;
    double* __restrict out = rate + m * n;
    for (int p = 0; p < n; ++p) out[p] = (beta * e[p]) * (s[p] - radial[p] * w[p]);
  }
}

// rhs = scale rhs + from_error S + from_activation S_change + onto_weight W, row by row; all coefficients per column.
void weight_corrections(int n, int neurons, const double* __restrict scale_of, const double* __restrict from_error,
                        const double* __restrict from_activation, const double* __restrict onto_weight,
                        const double* activation, const double* activation_change, const double* __restrict weights,
                        double* __restrict rhs) {
  for (int m = 0; m < neurons; ++m) {
    const double* s = activation + m * n;
    const double* change = activation_change + m * n;
    const double* __restrict w = weights + m * n;
    double* __restrict out = rhs + m * n;
    for (int p = 0; p < n; ++p) {
      out[p] = ((scale_of[p] * out[p] + from_error[p] * s[p]) + from_activation[p] * change[p]) + onto_weight[p] * w[p];
    }
  }
}

void network_moments(int n, int neurons, const double* __restrict centers, const double* __restrict activation,
                     const double* __restrict weights, double* __restrict squares, double* __restrict centered_squares,
                     double* __restrict centered_products) {
  for (int p = 0; p < n; ++p) squares[p] = centered_squares[p] = centered_products[p] = 0.0;
  for (int m = 0; m < neurons; ++m) {
    const double c = centers[m];
    const double* __restrict s = activation + m * n;
    const double* __restrict w = weights + m * n;
    for (int p = 0; p < n; ++p) {
      const double square = s[p] * s[p];
      squares[p] += square;
      centered_squares[p] += c * square;
      centered_products[p] += c * (w[p] * s[p]);
    }
  }
}

void activation_changes(int n, int neurons, const double* __restrict centers, double factor,
                        const double* __restrict activation, const double* __restrict along,
                        const double* __restrict across, double* __restrict change) {
  for (int m = 0; m < neurons; ++m) {
    const double c = centers[m];
    const double* __restrict s = activation + m * n;
    double* __restrict out = change + m * n;
    for (int p = 0; p < n; ++p) out[p] = s[p] * (factor * (along[p] - c * across[p]));
  }
}
