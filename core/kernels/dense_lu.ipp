// LU factorization with partial pivoting of a small column-major matrix; part of level.cpp.

bool lu_factor(int n, double* __restrict matrix, int* __restrict pivot) {
  for (int k = 0; k < n; ++k) {
    double* __restrict column_k = matrix + k * n;
    int largest = k;
    for (int i = k + 1; i < n; ++i) {
      if (fabs(column_k[i]) > fabs(column_k[largest])) largest = i;
    }
    pivot[k] = largest;
    if (largest != k) {
      for (int j = 0; j < n; ++j) {
        const double kept = matrix[j * n + k];
        matrix[j * n + k] = matrix[j * n + largest];
        matrix[j * n + largest] = kept;
      }
    }
    const double inverse = 1.0 / column_k[k];
    if (!(fabs(inverse) <= 1e300)) return false;
    column_k[k] = inverse;
    for (int i = k + 1; i < n; ++i) column_k[i] *= inverse;
    for (int j = k + 1; j < n; ++j) {
      double* __restrict column_j = matrix + j * n;
      const double factor = column_j[k];
      if (factor == 0.0) continue;
      for (int i = k + 1; i < n; ++i) column_j[i] -= factor * column_k[i];
    }
  }
  return true;
}

void lu_solve(int n, const double* __restrict matrix, const int* __restrict pivot, double* __restrict rhs) {
  for (int k = 0; k < n; ++k) {
    const double kept = rhs[k];
    rhs[k] = rhs[pivot[k]];
    rhs[pivot[k]] = kept;
  }
  for (int k = 0; k < n; ++k) {
    const double* __restrict column = matrix + k * n;
    const double value = rhs[k];
    for (int i = k + 1; i < n; ++i) rhs[i] -= value * column[i];
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* __restrict column = matrix + k * n;
    const double value = rhs[k] * column[k];
    rhs[k] = value;
    for (int i = 0; i < k; ++i) rhs[i] -= value * column[i];
  }
}
