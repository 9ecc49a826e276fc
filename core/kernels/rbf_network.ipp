// Activations S_m(y_i) = exp(-sum over j,l of (y_ijl - c_m)^2 / rho^2) and sums over rows; part of level.cpp.

void moments(int n, const double* a, double* sum, double* sum_of_squares) {
  Lanes sums = {};
  Lanes squares = {};
  int k = 0;
  for (; k + lane_count <= n; k += lane_count) {
    const Lanes lanes = load(a + k);
    sums += lanes;
    squares += lanes * lanes;
  }
  if (k < n) {
    const Lanes lanes = load_part(n - k, a + k);
    sums += lanes;
    squares += lanes * lanes;
  }
  *sum = total(sums);
  *sum_of_squares = total(squares);
}

double dot(int n, const double* a, const double* b) {
  Lanes sums = {};
  int k = 0;
  for (; k + lane_count <= n; k += lane_count) sums += load(a + k) * load(b + k);
  if (k < n) sums += load_part(n - k, a + k) * load_part(n - k, b + k);
  return total(sums);
}

// Exponents lie at m * players + i; each activation is repeated for every coordinate.
inline void exponentiate_and_repeat(int players, int dimension, int neurons, double* exponent, double* activation) {
  exponential(players * neurons, exponent, exponent);
  for (int m = 0; m < neurons; ++m) {
    const double* from = exponent + m * players;
    double* to = activation + m * players * dimension;
    for (int l = 0; l < dimension; ++l) {
      for (int i = 0; i < players; ++i) to[l * players + i] = from[i];
    }
  }
}

void activations_diagonal(int players, int dimension, int neurons, const double* centers, double width,
                          const double* y, double* exponent, double* activation) {
  const int n = players * dimension;
  const double scale = 1.0 / (width * width);
  for (int i = 0; i < players; ++i) {
    double sum;
    double squares;
    moments(n, y + i * n, &sum, &squares);
    for (int m = 0; m < neurons; ++m) {
      // sum (y - c)^2 = sum y^2 - 2 c sum y + n c^2
      const double c = centers[m];
      exponent[m * players + i] = -((squares - 2.0 * c * sum) + n * c * c) * scale;
    }
  }
  exponentiate_and_repeat(players, dimension, neurons, exponent, activation);
}

void activations_general(int players, int dimension, int neurons, const double* centers, double width,
                         const double* y, double* exponent, double* activation) {
  const int n = players * dimension;
  const double scale = 1.0 / (width * width);
  for (int i = 0; i < players; ++i) {
    const double* estimate = y + i * n;
    for (int m = 0; m < neurons; ++m) {
      const double* center = centers + m * n;
      Lanes squares = {};
      int k = 0;
      for (; k + lane_count <= n; k += lane_count) {
        const Lanes difference = load(estimate + k) - load(center + k);
        squares += difference * difference;
      }
      if (k < n) {
        const Lanes difference = load_part(n - k, estimate + k) - load_part(n - k, center + k);
        squares += difference * difference;
      }
      exponent[m * players + i] = -total(squares) * scale;
    }
  }
  exponentiate_and_repeat(players, dimension, neurons, exponent, activation);
}
