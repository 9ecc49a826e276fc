// L D L' of the N matrices I + gamma k3 (L + diag(a_.j)), which share one pattern; part of level.cpp.
//
// Number k of the factors of eight blocks is a row of eight values, so that vectors run along the blocks. Few blocks at
// a time stay in the nearest caches from the first elimination to the last.

void factor_blocks(BlockPattern pattern, double* lower, double* diagonal) {
  for (int lane = 0; lane < tile_length; lane += vector_length) {
    double* L = lower + lane;
    double* D = diagonal + lane;
    const int* target = pattern.target;
    for (int k = 0; k < pattern.listed; ++k) {
      const Vector inverse = 1.0 / load(D + k * tile_length);
      store(inverse, D + k * tile_length);
      const int first = pattern.start[k];
      const int last = pattern.start[k + 1];
      for (int a = first; a < last; ++a) {
        // l_a = v_a / d; the pairs (a, b) with b before a update v_ab -= l_b v_a
        const Vector value = load(L + a * tile_length);
        for (int b = first; b < a; ++b) {
          double* to = L + *target++ * tile_length;
          store(load(to) - load(L + b * tile_length) * value, to);
        }
        const Vector scaled = value * inverse;
        double* own = D + pattern.row[a] * tile_length;
        store(load(own) - scaled * value, own);
        store(scaled, L + a * tile_length);
      }
    }
    factor_full(full_players(pattern), full_entries(pattern, L), D + pattern.listed * tile_length);
  }
}

/// `count` coordinates of as many blocks as Width holds; L and inverse begin at the first of them, x at its player 0.
template <typename Width, int count>
inline void solve_columns(const BlockPattern& pattern, Index length, const double* L, const double* inverse,
                          double* x) {
  const int n = pattern.blocks;
  Width sum[count];
  for (int k = 0; k < pattern.listed; ++k) {
    const double* from = x + pattern.order[k] * length;
    for (int h = 0; h < count; ++h) sum[h] = load_as<Width>(from + h * n);
    for (int a = pattern.start[k]; a < pattern.start[k + 1]; ++a) {
      const Width l = load_as<Width>(L + a * tile_length);
      double* to = x + pattern.player[a] * length;
      for (int h = 0; h < count; ++h) store(load_as<Width>(to + h * n) - l * sum[h], to + h * n);
    }
  }
  solve_full<Width, count>(pattern, length, L, inverse, x);
  for (int k = pattern.listed - 1; k >= 0; --k) {
    double* to = x + pattern.order[k] * length;
    const Width pivot = load_as<Width>(inverse + k * tile_length);
    for (int h = 0; h < count; ++h) sum[h] = load_as<Width>(to + h * n) * pivot;
    for (int a = pattern.start[k]; a < pattern.start[k + 1]; ++a) {
      const Width l = load_as<Width>(L + a * tile_length);
      const double* from = x + pattern.player[a] * length;
      for (int h = 0; h < count; ++h) sum[h] -= l * load_as<Width>(from + h * n);
    }
    for (int h = 0; h < count; ++h) store(sum[h], to + h * n);
  }
}

void solve_blocks(BlockPattern pattern, int width, const double* lower, const double* inverse_diagonal, double* rhs) {
  const Index n = pattern.blocks;
  const Index players = pattern.players;
  const Index full = full_players(pattern);
  const Index entries = pattern.start[pattern.listed] + full * (full - 1) / 2;
  for_columns(n, [=](auto lanes, Index j) {
    using Width = decltype(lanes);
    const Index tile = j / tile_length;
    const double* L = lower + tile * entries * tile_length + j % tile_length;
    const double* inverse = inverse_diagonal + tile * players * tile_length + j % tile_length;
    int h = 0;
    for (; h + 2 <= width; h += 2) solve_columns<Width, 2>(pattern, width * n, L, inverse, rhs + h * n + j);
    if (h < width) solve_columns<Width, 1>(pattern, width * n, L, inverse, rhs + h * n + j);
  });
}

void add_shared_signal(int rows, int players, int dimension, const double* gain, const double* shared, double* y) {
  with_width(players, [=](auto width) {
    using Width = decltype(width);
    for (int i = 0; i < rows; ++i) {
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
