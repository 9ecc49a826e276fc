// Sums over rows in one fixed order, whatever the width of the instructions; part of level.cpp.
//
// Number k is added to lane k mod 8; the lanes are then added pairwise.

constexpr int lane_count = 8;
constexpr int lane_vectors = lane_count / vector_length;

struct Lanes {
  Vector part[lane_vectors] = {};
};

/// Adds term(k, vector of them) for k = 0 .. n - 1; term(k) must do for one number what term does for a vector.
template <typename VectorTerm, typename Term>
inline double sum_of(int n, VectorTerm vector_term, Term term) {
  Lanes sums;
  int k = 0;
  for (; k + lane_count <= n; k += lane_count) {
    for (int v = 0; v < lane_vectors; ++v) sums.part[v] += vector_term(k + v * vector_length);
  }
  double lanes[lane_count];
  __builtin_memcpy(lanes, &sums, sizeof lanes);
  for (int r = 0; k + r < n; ++r) lanes[r] += term(k + r);
  return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

double dot(int n, const double* a, const double* b) {
  return sum_of(n, [=](int k) { return load(a + k) * load(b + k); }, [=](int k) { return a[k] * b[k]; });
}

void moments(int n, const double* a, double* sum, double* sum_of_squares) {
  *sum = sum_of(n, [=](int k) { return load(a + k); }, [=](int k) { return a[k]; });
  *sum_of_squares = dot(n, a, a);
}

inline double distance_squared(int n, const double* a, const double* b) {
  return sum_of(
      n,
      [=](int k) {
        const Vector difference = load(a + k) - load(b + k);
        return difference * difference;
      },
      [=](int k) {
        const double difference = a[k] - b[k];
        return difference * difference;
      });
}

double weighted_square_sum(std::int64_t n, const double* x, const double* w) {
  return sum_of(
      static_cast<int>(n),
      [=](int k) {
        const Vector product = load(x + k) * load(w + k);
        return product * product;
      },
      [=](int k) {
        const double product = x[k] * w[k];
        return product * product;
      });
}
