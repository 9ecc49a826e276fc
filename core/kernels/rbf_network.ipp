// Activations S_m(y_i) = exp(-sum over j,l of (y_ijl - c_m)^2 / rho^2); part of level.cpp.

// Exponents lie at m * players + i; each activation is repeated for every coordinate.
inline void exponentiate_and_repeat(int players, int dimension, int neurons, double* __restrict exponent,
                                    double* __restrict activation) {
  // the scratch is long enough for whole vectors
  const int whole = (players * neurons + vector_length - 1) / vector_length * vector_length;
  exponential(whole, exponent, exponent);
  for (int m = 0; m < neurons; ++m) {
    const double* from = exponent + m * players;
    double* to = activation + m * players * dimension;
    for (int l = 0; l < dimension; ++l) {
      for (int i = 0; i < players; ++i) to[l * players + i] = from[i];
    }
  }
}

void activations_diagonal(int players, int dimension, int neurons, const double* __restrict centers, double width,
                          const double* y, double* exponent, double* __restrict activation) {
  const int n = players * dimension;
  const double scale = 1.0 / (width * width);
  double* __restrict sum = exponent + players * neurons + vector_length;
  double* __restrict squares = sum + players;
  for (int i = 0; i < players; ++i) moments(n, y + i * n, sum + i, squares + i);
  for (int m = 0; m < neurons; ++m) {
    // sum (y - c)^2 = sum y^2 - 2 c sum y + n c^2
    const double c = centers[m];
    double* __restrict out = exponent + m * players;
    for (int i = 0; i < players; ++i) out[i] = -((squares[i] - 2.0 * c * sum[i]) + n * c * c) * scale;
  }
  exponentiate_and_repeat(players, dimension, neurons, exponent, activation);
}

void activations_general(int players, int dimension, int neurons, const double* centers, double width, const double* y,
                         double* __restrict exponent, double* __restrict activation) {
  const int n = players * dimension;
  const double scale = 1.0 / (width * width);
  for (int i = 0; i < players; ++i) {
    for (int m = 0; m < neurons; ++m) {
      exponent[m * players + i] = -distance_squared(n, y + i * n, centers + m * n) * scale;
    }
  }
  exponentiate_and_repeat(players, dimension, neurons, exponent, activation);
}
