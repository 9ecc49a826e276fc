// The N matrices I + gamma k3 (L + diag(a_.j)) by the eigenvectors of L + diag(a_.j), all at once; part of level.cpp.

void factor_by_eigenvectors(BlockEigenvectors eigenvectors, double gamma_k3, double* inverse, double* gain) {
  const int N = eigenvectors.players;
  const Index n = eigenvectors.n;
  set_row(N * n, inverse, [=](auto width, Index k) {
    return 1.0 / (1.0 + gamma_k3 * load_as<decltype(width)>(eigenvectors.eigenvalue + k));
  });
  const int blocks = eigenvectors.blocks;
  with_width(blocks, [=](auto width) {
    using Width = decltype(width);
    for (int i = 0; i < N; ++i) {
      set_row_by(width, blocks, gain + i * blocks, [=](auto, Index j) {
        Width sum = {};
        for (int k = 0; k < N; ++k) {
          const Width share = load_as<Width>(eigenvectors.shared + k * n + j) * load_as<Width>(inverse + k * n + j);
          sum += load_as<Width>(eigenvectors.vector + (k * N + i) * n + j) * share;
        }
        return gamma_k3 * sum;
      });
    }
  });
}

void solve_by_eigenvectors(BlockEigenvectors eigenvectors, const double* inverse, double* rhs) {
  const int N = eigenvectors.players;
  const Index n = eigenvectors.n;
  for_columns(n, [=](auto width, Index p) __attribute__((always_inline)) {
    using Width = decltype(width);
    Width along[most_players_by_eigenvectors];
    const double* vector = eigenvectors.vector + p;
    for (int k = 0; k < N; ++k) {
      Width sum = {};
      for (int i = 0; i < N; ++i, vector += n) sum += load_as<Width>(vector) * load_as<Width>(rhs + i * n + p);
      along[k] = sum * load_as<Width>(inverse + k * n + p);
    }
    for (int i = 0; i < N; ++i) {
      vector = eigenvectors.vector + i * n + p;
      Width sum = {};
      for (int k = 0; k < N; ++k, vector += N * n) sum += load_as<Width>(vector) * along[k];
      store(sum, rhs + i * n + p);
    }
  });
}
