// LU factorization with partial pivoting of a small row-major matrix; part of level.cpp.

bool lu_factor(int n, double* __restrict matrix, int* __restrict pivot) {
  for (int k = 0; k < n; ++k) {
    int largest = k;
    for (int i = k + 1; i < n; ++i) {
      if (fabs(matrix[i * n + k]) > fabs(matrix[largest * n + k])) largest = i;
    }
    pivot[k] = largest;
    double* __restrict row_k = matrix + k * n;
    if (largest != k) {
      double* __restrict other = matrix + largest * n;
      for (int j = 0; j < n; ++j) {
        const double kept = row_k[j];
        row_k[j] = other[j];
        other[j] = kept;
      }
    }
    const double inverse = 1.0 / row_k[k];
    if (!(fabs(inverse) <= 1e300)) return false;
    for (int i = k + 1; i < n; ++i) {
      double* __restrict row_i = matrix + i * n;
      const double factor = row_i[k] * inverse;
      row_i[k] = factor;
      if (factor == 0.0) continue;
      for (int j = k + 1; j < n; ++j) row_i[j] -= factor * row_k[j];
    }
    row_k[k] = inverse;
  }
  return true;
}

void lu_solve(int n, const double* __restrict matrix, const int* __restrict pivot, double* __restrict rhs) {
  for (int k = 0; k < n; ++k) {
    const double kept = rhs[k];
    rhs[k] = rhs[pivot[k]];
    rhs[pivot[k]] = kept;
  }
  for (int i = 1; i < n; ++i) rhs[i] -= dot(i, matrix + i * n, rhs);
  for (int i = n - 1; i >= 0; --i) {
    rhs[i] = (rhs[i] - dot(n - 1 - i, matrix + i * n + i + 1, rhs + i + 1)) * matrix[i * n + i];
  }
}
