// L D L' of the N matrices I + gamma k3 (L + diag(a_.j)), which share one pattern, all at once; part of level.cpp.
//
// Number k of the factor is a row of N values, one for each block j, so every loop below runs along the blocks.

void factor_blocks(BlockPattern pattern, double* __restrict lower, double* __restrict diagonal) {
  const int n = pattern.players;
  const int* target = pattern.target;
  for (int k = 0; k < n; ++k) {
    const double* pivot = diagonal + static_cast<Index>(k) * n;
    const int first = pattern.start[k];
    const int last = pattern.start[k + 1];
    for (int a = first; a < last; ++a) {
      double* row_a = lower + static_cast<Index>(a) * n;
      double* own = diagonal + static_cast<Index>(pattern.row[a]) * n;
      // l_a = v_a / d; the pairs (a, b) with b before a update v_ab -= l_a v_b, where v_b = l_b d
      for (int b = first; b < a; ++b) {
        const double* row_b = lower + static_cast<Index>(b) * n;
        double* to = lower + static_cast<Index>(*target++) * n;
        for (int j = 0; j < n; ++j) to[j] -= row_b[j] * row_a[j];
      }
      for (int j = 0; j < n; ++j) {
        const double value = row_a[j];
        row_a[j] = value / pivot[j];
        own[j] -= row_a[j] * value;
      }
    }
  }
}

void solve_blocks(BlockPattern pattern, int width, const double* __restrict lower,
                  const double* __restrict inverse_diagonal, double* __restrict rhs) {
  const int n = pattern.players;
  const int length = width * n;
  for (int k = 0; k < n; ++k) {
    const double* __restrict from = rhs + static_cast<Index>(pattern.order[k]) * length;
    for (int a = pattern.start[k]; a < pattern.start[k + 1]; ++a) {
      const double* __restrict l = lower + static_cast<Index>(a) * n;
      double* __restrict to = rhs + static_cast<Index>(pattern.order[pattern.row[a]]) * length;
      for (int h = 0; h < length; h += n) {
        for (int j = 0; j < n; ++j) to[h + j] -= l[j] * from[h + j];
      }
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    double* __restrict to = rhs + static_cast<Index>(pattern.order[k]) * length;
    const double* __restrict inverse = inverse_diagonal + static_cast<Index>(k) * n;
    for (int h = 0; h < length; h += n) {
      for (int j = 0; j < n; ++j) to[h + j] *= inverse[j];
    }
    for (int a = pattern.start[k]; a < pattern.start[k + 1]; ++a) {
      const double* __restrict l = lower + static_cast<Index>(a) * n;
      const double* __restrict from = rhs + static_cast<Index>(pattern.order[pattern.row[a]]) * length;
      for (int h = 0; h < length; h += n) {
        for (int j = 0; j < n; ++j) to[h + j] -= l[j] * from[h + j];
      }
    }
  }
}

void add_shared_signal(int players, int dimension, const double* gain, const double* shared, double* y) {
  with_width(players, [=](auto width) {
    using Width = decltype(width);
    for (int i = 0; i < players; ++i) {
      const double* row = gain + static_cast<Index>(i) * players;
      for (int l = 0; l < dimension; ++l) {
        const double* from = shared + l * players;
        double* to = y + (static_cast<Index>(i) * dimension + l) * players;
        set_row_by(width, players, to, [=](auto, Index j) {
          return load_as<Width>(to + j) + load_as<Width>(row + j) * load_as<Width>(from + j);
        });
      }
    }
  });
}
