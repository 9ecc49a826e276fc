// The last columns of the estimate blocks' L D L', which are full; part of level.cpp.
//
// L has its entries there in bands of full_step rows: column by column up to the band's own square, then the square
// below its diagonal, row by row. Squares of rows and columns stay in registers while all columns before them are
// taken off, so that an entry is updated column by column, whatever the size of the squares.

inline int full_players(const BlockPattern& pattern) { return pattern.players - pattern.listed; }
template <typename Number>
inline Number* full_entries(const BlockPattern& pattern, Number* L) {
  return L + static_cast<Index>(pattern.start[pattern.listed]) * tile_length;
}

/// The band of rows i .. i + full_step - 1.
template <typename Number>
inline Number* band_of(Index i, Number* entries) {
  return entries + i * (i - 1) / 2 * tile_length;
}
/// Row a and column k of a band, k before its square.
inline Index in_band(Index a, Index k) { return (k * full_step + a) * tile_length; }
/// Row a and column b < a of the square of the band of rows from i on.
inline Index in_square(Index i, Index a, Index b) { return (i * full_step + a * (a - 1) / 2 + b) * tile_length; }

/// The square of the band of rows from i on, and the band's entries l = v / d before it.
inline void finish_band(Index i, double* entries, double* D) {
  double* band = band_of(i, entries);
  Vector own[full_step];
  Vector value[full_step][full_step];
#pragma GCC unroll 4
  for (int a = 0; a < full_step; ++a) {
    own[a] = load(D + (i + a) * tile_length);
#pragma GCC unroll 4
    for (int b = 0; b < a; ++b) value[a][b] = load(band + in_square(i, a, b));
  }
  for (Index k = 0; k < i; ++k) {
    const Vector inverse = load(D + k * tile_length);
    Vector scaled[full_step];
#pragma GCC unroll 4
    for (int a = 0; a < full_step; ++a) {
      const Vector v = load(band + in_band(a, k));
      scaled[a] = v * inverse;
      store(scaled[a], band + in_band(a, k));
      own[a] -= scaled[a] * v;
#pragma GCC unroll 4
      for (int b = 0; b < a; ++b) value[a][b] -= scaled[b] * v;
    }
  }
#pragma GCC unroll 4
  for (int k = 0; k < full_step; ++k) {
    const Vector inverse = 1.0 / own[k];
    store(inverse, D + (i + k) * tile_length);
#pragma GCC unroll 4
    for (int a = k + 1; a < full_step; ++a) {
      const Vector v = value[a][k];
      value[a][k] = v * inverse;
      own[a] -= value[a][k] * v;
#pragma GCC unroll 4
      for (int b = k + 1; b < a; ++b) value[a][b] -= value[b][k] * v;
      store(value[a][k], band + in_square(i, a, k));
    }
  }
}

/// v of `count` rows from row `first` of a band on in columns c .. c + full_step - 1, whose own band is finished.
template <int count>
inline void update_square(Index c, const double* finished, int first, double* band) {
  Vector value[count][full_step];
#pragma GCC unroll 4
  for (int a = 0; a < count; ++a) {
#pragma GCC unroll 4
    for (int b = 0; b < full_step; ++b) value[a][b] = load(band + in_band(first + a, c + b));
  }
  for (Index k = 0; k < c; ++k) {
    Vector v[count];
#pragma GCC unroll 4
    for (int a = 0; a < count; ++a) v[a] = load(band + in_band(first + a, k));
#pragma GCC unroll 4
    for (int b = 0; b < full_step; ++b) {
      const Vector l = load(finished + in_band(b, k));
#pragma GCC unroll 4
      for (int a = 0; a < count; ++a) value[a][b] -= l * v[a];
    }
  }
#pragma GCC unroll 4
  for (int k = 0; k < full_step; ++k) {
#pragma GCC unroll 4
    for (int b = k + 1; b < full_step; ++b) {
      const Vector l = load(finished + in_square(c, b, k));
#pragma GCC unroll 4
      for (int a = 0; a < count; ++a) value[a][b] -= l * value[a][k];
    }
#pragma GCC unroll 4
    for (int a = 0; a < count; ++a) store(value[a][k], band + in_band(first + a, c + k));
  }
}

inline void factor_full(Index n, double* entries, double* D) {
  constexpr int count = vector_length == tile_length ? full_step : full_step / 2;  // rows that the registers hold
  for (Index c = 0; c < n; c += full_step) {
    finish_band(c, entries, D);
    for (Index i = c + full_step; i < n; i += full_step) {
      for (int first = 0; first < full_step; first += count) {
        update_square<count>(c, band_of(c, entries), first, band_of(i, entries));
      }
    }
  }
}

/// x in `count` coordinates of as many blocks as Width holds, beginning at player 0; see solve_columns.
template <typename Width, int count>
inline void solve_full(const BlockPattern& pattern, Index length, const double* L, const double* inverse, double* x) {
  const int N = pattern.blocks;
  const int n = full_players(pattern);
  const int* order = pattern.order + pattern.listed;
  const double* entries = full_entries(pattern, L);
  for (Index i = 0; i < n; i += full_step) {
    const double* band = band_of(i, entries);
    Width sum[full_step][count];
#pragma GCC unroll 4
    for (int a = 0; a < full_step; ++a) {
      for (int h = 0; h < count; ++h) sum[a][h] = load_as<Width>(x + order[i + a] * length + h * N);
    }
    for (Index k = 0; k < i; ++k) {
      const double* from = x + order[k] * length;
#pragma GCC unroll 4
      for (int a = 0; a < full_step; ++a) {
        const Width l = load_as<Width>(band + in_band(a, k));
        for (int h = 0; h < count; ++h) sum[a][h] -= l * load_as<Width>(from + h * N);
      }
    }
#pragma GCC unroll 4
    for (int a = 0; a < full_step; ++a) {
#pragma GCC unroll 4
      for (int b = 0; b < a; ++b) {
        const Width l = load_as<Width>(band + in_square(i, a, b));
        for (int h = 0; h < count; ++h) sum[a][h] -= l * sum[b][h];
      }
      for (int h = 0; h < count; ++h) store(sum[a][h], x + order[i + a] * length + h * N);
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    double* to = x + order[k] * length;
    const Width pivot = load_as<Width>(inverse + (pattern.listed + k) * tile_length);
    Width sum[count];
    for (int h = 0; h < count; ++h) sum[h] = load_as<Width>(to + h * N) * pivot;
    const auto take_off = [&](const double* entry, Index i) {
      const Width l = load_as<Width>(entry);
      for (int h = 0; h < count; ++h) sum[h] -= l * load_as<Width>(x + order[i] * length + h * N);
    };
    const int own = k / full_step * full_step;
    for (int i = k + 1; i < own + full_step; ++i) take_off(band_of(own, entries) + in_square(own, i - own, k - own), i);
    for (int i = own + full_step; i < n; i += full_step) {
      const double* band = band_of(i, entries);
#pragma GCC unroll 4
      for (int a = 0; a < full_step; ++a) take_off(band + in_band(a, k), i + a);
    }
    for (int h = 0; h < count; ++h) store(sum[h], to + h * N);
  }
}
