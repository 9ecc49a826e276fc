// L U of the N matrices I + gamma K3 (L + diag(a_.j)) of a directed graph, which share one pattern; part of level.cpp.
//
// They are diagonally dominant by rows, and so is what elimination leaves of them: no pivoting is needed.

void factor_directed_blocks(BlockPattern pattern, double* lower, double* upper, double* diagonal) {
  for (int lane = 0; lane < tile_length; lane += vector_length) {
    double* L = lower + lane;
    double* U = upper + lane;
    double* D = diagonal + lane;
    const int* target = pattern.target;
    const auto take_off = [](double* from, const Vector& value) { store(load(from) - value, from); };
    for (int k = 0; k < pattern.players; ++k) {
      const Vector inverse = 1.0 / load(D + k * tile_length);
      store(inverse, D + k * tile_length);
      for (int a = pattern.start[k]; a < pattern.start[k + 1]; ++a) {
        const Vector l = load(L + a * tile_length) * inverse;
        const Vector u = load(U + a * tile_length);
        store(l, L + a * tile_length);
        for (int b = pattern.start[k]; b < a; ++b) {
          const Index to = static_cast<Index>(*target++) * tile_length;
          take_off(L + to, l * load(U + b * tile_length));
          take_off(U + to, load(L + b * tile_length) * u);
        }
        take_off(D + pattern.row[a] * tile_length, l * u);
      }
    }
  }
}

/// `count` coordinates of as many blocks as Width holds; L, U and inverse begin at the first of them, x at its player
/// 0.
template <typename Width, int count>
inline void solve_directed_columns(const BlockPattern& pattern, Index length, const double* L, const double* U,
                                   const double* inverse, double* x) {
  const int n = pattern.blocks;
  Width sum[count];
  for (int k = 0; k < pattern.players; ++k) {
    const double* from = x + pattern.order[k] * length;
    for (int h = 0; h < count; ++h) sum[h] = load_as<Width>(from + h * n);
    for (int a = pattern.start[k]; a < pattern.start[k + 1]; ++a) {
      const Width l = load_as<Width>(L + a * tile_length);
      double* to = x + pattern.player[a] * length;
      for (int h = 0; h < count; ++h) store(load_as<Width>(to + h * n) - l * sum[h], to + h * n);
    }
  }
  for (int k = pattern.players - 1; k >= 0; --k) {
    double* to = x + pattern.order[k] * length;
    for (int h = 0; h < count; ++h) sum[h] = load_as<Width>(to + h * n);
    for (int a = pattern.start[k]; a < pattern.start[k + 1]; ++a) {
      const Width u = load_as<Width>(U + a * tile_length);
      const double* from = x + pattern.player[a] * length;
      for (int h = 0; h < count; ++h) sum[h] -= u * load_as<Width>(from + h * n);
    }
    const Width pivot = load_as<Width>(inverse + k * tile_length);
    for (int h = 0; h < count; ++h) store(sum[h] * pivot, to + h * n);
  }
}

void solve_directed_blocks(BlockPattern pattern, int width, const double* lower, const double* upper,
                           const double* inverse_diagonal, double* rhs) {
  const Index n = pattern.blocks;
  const Index players = pattern.players;
  const Index entries = pattern.start[players];
  for_columns(n, [=](auto lanes, Index j) {
    using Width = decltype(lanes);
    const Index tile = j / tile_length;
    const Index first = tile * entries * tile_length + j % tile_length;
    const double* inverse = inverse_diagonal + tile * players * tile_length + j % tile_length;
    int h = 0;
    for (; h + 2 <= width; h += 2) {
      solve_directed_columns<Width, 2>(pattern, width * n, lower + first, upper + first, inverse, rhs + h * n + j);
    }
    if (h < width) {
      solve_directed_columns<Width, 1>(pattern, width * n, lower + first, upper + first, inverse, rhs + h * n + j);
    }
  });
}
