// Activations S_m(y_i) = exp(-sum over j,l of (y_ijl - c_m)^2 / rho^2); part of level.cpp.

// Exponents lie at m * rows + i; each activation is repeated for every coordinate.
inline void exponentiate_and_repeat(int rows, int dimension, int neurons, double* exponent, double* activation) {
  // the scratch is long enough for whole vectors
  const int whole = (rows * neurons + vector_length - 1) / vector_length * vector_length;
  exponential(whole, exponent, exponent);
  if (rows == 1) {
    for (int m = 0; m < neurons; ++m) {
      for (int l = 0; l < dimension; ++l) activation[m * dimension + l] = exponent[m];
    }
    return;
  }
  with_width(rows, [=](auto width) {
    using Width = decltype(width);
    for (int m = 0; m < neurons; ++m) {
      const double* from = exponent + m * rows;
      for (int l = 0; l < dimension; ++l) {
        set_row_by(width, rows, activation + (m * dimension + l) * rows,
                   [=](auto, Index i) { return load_as<Width>(from + i); });
      }
    }
  });
}

void activations_diagonal(int rows, int n, int dimension, int neurons, const double* centers, const double* sharpness,
                          const double* y, double* exponent, double* activation) {
  const double count = n;
  double* sum = exponent + rows * neurons + vector_length;
  double* squares = sum + rows;
  for (int i = 0; i < rows; ++i) moments(n, y + i * n, sum + i, squares + i);
  // -sum (y - c)^2 / rho^2 = (2 c sum y - sum y^2 - n c^2) / rho^2
  const auto exponent_of = [=](const auto& c, const auto& sum_y, const auto& sum_y2, const auto& inverse_rho2) {
    return (((2.0 * c) * sum_y - sum_y2) - (count * c) * c) * inverse_rho2;
  };
  if (rows == 1) {  // along the neurons
    set_row(neurons, exponent, [=](auto width, Index m) {
      return exponent_of(load_as<decltype(width)>(centers + m), *sum, *squares, *sharpness);
    });
  } else {
    with_width(rows, [=](auto lanes) {
      using Width = decltype(lanes);
      for (int m = 0; m < neurons; ++m) {
        const double* center = centers + m * rows;
        set_row_by(lanes, rows, exponent + m * rows, [=](auto, Index i) {
          return exponent_of(load_as<Width>(center + i), load_as<Width>(sum + i), load_as<Width>(squares + i),
                             load_as<Width>(sharpness + i));
        });
      }
    });
  }
  exponentiate_and_repeat(rows, dimension, neurons, exponent, activation);
}

void activations_general(int rows, int n, int dimension, int neurons, int owners, const double* centers,
                         const double* sharpness, const double* y, double* exponent, double* activation) {
  for (int i = 0; i < rows; ++i) {
    for (int m = 0; m < neurons; ++m) {
      const double* center = centers + static_cast<Index>(m * owners + (owners == 1 ? 0 : i)) * n;
      exponent[m * rows + i] = -distance_squared(n, y + i * n, center) * sharpness[i];
    }
  }
  exponentiate_and_repeat(rows, dimension, neurons, exponent, activation);
}
