// Vectors of numbers, and loops along rows of them; part of level.cpp.
//
// Rows are short, N D numbers or N, so that what whole vectors leave over would cost more than the rest. Either a row's
// last vector overlaps the one before, or ever shorter vectors take what is left.

#if defined(__AVX512F__)
#define MIXED_ORDER_GAME_VECTOR_BYTES 64
#elif defined(__AVX__)
#define MIXED_ORDER_GAME_VECTOR_BYTES 32
#else
#define MIXED_ORDER_GAME_VECTOR_BYTES 16
#endif

typedef std::int64_t Index;

/// The level's own width.
typedef double Vector __attribute__((vector_size(MIXED_ORDER_GAME_VECTOR_BYTES)));
typedef long long VectorBits __attribute__((vector_size(MIXED_ORDER_GAME_VECTOR_BYTES)));

typedef double Two __attribute__((vector_size(16)));
#if MIXED_ORDER_GAME_VECTOR_BYTES >= 32
typedef double Four __attribute__((vector_size(32)));
#endif

template <typename Width>
constexpr int length_of = static_cast<int>(sizeof(Width) / sizeof(double));
constexpr int vector_length = length_of<Vector>;

template <typename Width>
inline Width load_as(const double* from) {
  Width numbers;
  __builtin_memcpy(&numbers, from, sizeof numbers);
  return numbers;
}
inline Vector load(const double* from) { return load_as<Vector>(from); }

template <typename Width>
inline void store(const Width& numbers, double* to) {
  __builtin_memcpy(to, &numbers, sizeof numbers);
}

/// Calls action with a value of the widest type that is not longer than n > 0 numbers.
template <typename Action>
inline void with_width(Index n, Action action) {
  if (n >= vector_length) {
    action(Vector{});
#if MIXED_ORDER_GAME_VECTOR_BYTES >= 64
  } else if (n >= 4) {
    action(Four{});
#endif
#if MIXED_ORDER_GAME_VECTOR_BYTES >= 32
  } else if (n >= 2) {
    action(Two{});
#endif
  } else if (n == 1) {
    action(0.0);
  }
}

/// row[k] = term(k), taken for as many k at once as Width holds, n of them at least. The last vector is taken first
/// and put last, so that term may read the row itself, at k.
template <typename Width, typename Term>
inline void set_row_by(Width /*width*/, Index n, double* row, Term term) {
  constexpr Index length = length_of<Width>;
  const Width last = term(Width{}, n - length);
  for (Index k = 0; k + length < n; k += length) store(term(Width{}, k), row + k);
  store(last, row + n - length);
}

/// row[k] = term(width, k) for k = 0 .. n - 1.
template <typename Term>
inline void set_row(Index n, double* row, Term term) {
  with_width(n, [=](auto width) { set_row_by(width, n, row, term); });
}

/// Calls action(width, p) so that the widths that begin at these p make up the columns 0 .. n - 1: whole vectors, then
/// ever shorter ones. For actions that go down several rows and keep what belongs to their columns in registers.
template <typename Action>
inline void for_columns(Index n, Action action) {
  Index p = 0;
  for (; p + vector_length <= n; p += vector_length) action(Vector{}, p);
#if MIXED_ORDER_GAME_VECTOR_BYTES >= 64
  if (p + 4 <= n) {
    action(Four{}, p);
    p += 4;
  }
#endif
#if MIXED_ORDER_GAME_VECTOR_BYTES >= 32
  if (p + 2 <= n) {
    action(Two{}, p);
    p += 2;
  }
#endif
  if (p < n) action(0.0, p);
}
