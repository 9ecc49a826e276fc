// Adaptation of the weights, W' = beta e (S - radial W), and the sums w'S and w'w; part of level.cpp.

void column_products(int n, int rows, const double* a, const double* b, double* sum) {
  const Index size = static_cast<Index>(rows) * n;
  for_columns(n, [=](auto width, Index p) {
    using Width = decltype(width);
    Width total = {};
    for (Index k = p; k < size; k += n) total += load_as<Width>(a + k) * load_as<Width>(b + k);
    store(total, sum + p);
  });
}

void weight_rates(int n, int neurons, double beta, const double* e, const double* radial, const double* activation,
                  const double* weights, double* rate) {
  const Index size = static_cast<Index>(neurons) * n;
  for_columns(n, [=](auto width, Index p) {
    using Width = decltype(width);
    const Width push = beta * load_as<Width>(e + p);
    const Width r = load_as<Width>(radial + p);
    for (Index k = p; k < size; k += n) {
      store(push * (load_as<Width>(activation + k) - r * load_as<Width>(weights + k)), rate + k);
    }
  });
}

// rhs = scale rhs + from_error S + from_activation S_change + onto_weight W, row by row; all coefficients per column.
void weight_corrections(int n, int neurons, const double* scale_of, const double* from_error,
                        const double* from_activation, const double* onto_weight, const double* activation,
                        const double* activation_change, const double* weights, double* rhs) {
  const Index size = static_cast<Index>(neurons) * n;
  for_columns(n, [=](auto width, Index p) {
    using Width = decltype(width);
    const Width kept = load_as<Width>(scale_of + p);
    const Width along_S = load_as<Width>(from_error + p);
    const Width along_w = load_as<Width>(onto_weight + p);
    const auto corrected = [=](Index k) {
      return (kept * load_as<Width>(rhs + k) + along_S * load_as<Width>(activation + k)) +
             along_w * load_as<Width>(weights + k);
    };
    if (activation_change == nullptr) {
      for (Index k = p; k < size; k += n) store(corrected(k), rhs + k);
    } else {
      const Width along_change = load_as<Width>(from_activation + p);
      for (Index k = p; k < size; k += n) {
        store(corrected(k) + along_change * load_as<Width>(activation_change + k), rhs + k);
      }
    }
  });
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
