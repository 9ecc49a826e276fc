// Sums over rows in one fixed order, whatever the width of the instructions; part of level.cpp.
//
// Numbers are added in groups of eight, one to each lane, by turns to one of two sets of lanes; of n >= 8 numbers the
// last n mod 8 go to the last lanes. The sets are then added, and the lanes pairwise.

constexpr int lane_count = 8;
constexpr int lane_vectors = lane_count / vector_length;

struct Lanes {
  Vector part[lane_vectors] = {};
};

inline double sum_of_two(const Two& lanes) { return lanes[0] + lanes[1]; }
#if MIXED_ORDER_GAME_VECTOR_BYTES >= 32
inline double sum_of_four(const Four& lanes) {
  return sum_of_two(__builtin_shufflevector(lanes, lanes, 0, 1) + __builtin_shufflevector(lanes, lanes, 2, 3));
}
#endif

/// ((l0 + l4) + (l2 + l6)) + ((l1 + l5) + (l3 + l7))
inline double sum_of_lanes(const Lanes& lanes) {
#if MIXED_ORDER_GAME_VECTOR_BYTES >= 64
  const Vector& l = lanes.part[0];
  return sum_of_four(__builtin_shufflevector(l, l, 0, 1, 2, 3) + __builtin_shufflevector(l, l, 4, 5, 6, 7));
#elif MIXED_ORDER_GAME_VECTOR_BYTES >= 32
  return sum_of_four(lanes.part[0] + lanes.part[1]);
#else
  return sum_of_two((lanes.part[0] + lanes.part[2]) + (lanes.part[1] + lanes.part[3]));
#endif
}

/// Eight of these from number r on: nothing of 8 - r numbers, then all of r.
alignas(64) constexpr long long nothing_then_all[2 * lane_count] = {0,  0,  0,  0,  0,  0,  0,  0,
                                                                    -1, -1, -1, -1, -1, -1, -1, -1};

/// Adds term(width, k) for k = 0 .. n - 1.
template <typename Term>
inline double sum_of(Index n, Term term) {
  Lanes even;
  Lanes odd;
  if (n < lane_count) {
    double lanes[lane_count] = {};
    for (Index k = 0; k < n; ++k) lanes[k] = term(0.0, k);
    __builtin_memcpy(&even, lanes, sizeof lanes);
    return sum_of_lanes(even);
  }
  const auto add_eight = [&](Index k, Lanes* sums) {
    for (int v = 0; v < lane_vectors; ++v) sums->part[v] += term(Vector{}, k + v * vector_length);
  };
  Index k = 0;
  for (; k + 2 * lane_count <= n; k += 2 * lane_count) {
    add_eight(k, &even);
    add_eight(k + lane_count, &odd);
  }
  if (k + lane_count <= n) {
    add_eight(k, &even);
    k += lane_count;
  }
  if (k < n) {
    // the last eight numbers, without those that have been counted
    for (int v = 0; v < lane_vectors; ++v) {
      const Vector value = term(Vector{}, n - lane_count + v * vector_length);
      VectorBits kept;
      __builtin_memcpy(&kept, nothing_then_all + (n - k) + v * vector_length, sizeof kept);
      odd.part[v] += vector_of(bits_of(value) & kept);
    }
  }
  for (int v = 0; v < lane_vectors; ++v) even.part[v] += odd.part[v];
  return sum_of_lanes(even);
}

double dot(int n, const double* a, const double* b) {
  return sum_of(n, [=](auto width, Index k) {
    using Width = decltype(width);
    return load_as<Width>(a + k) * load_as<Width>(b + k);
  });
}

inline void moments(int n, const double* a, double* sum, double* sum_of_squares) {
  *sum = sum_of(n, [=](auto width, Index k) { return load_as<decltype(width)>(a + k); });
  *sum_of_squares = dot(n, a, a);
}

inline double distance_squared(int n, const double* a, const double* b) {
  return sum_of(n, [=](auto width, Index k) {
    using Width = decltype(width);
    const Width difference = load_as<Width>(a + k) - load_as<Width>(b + k);
    return difference * difference;
  });
}

double weighted_square_sum(std::int64_t n, const double* x, const double* w) {
  return sum_of(n, [=](auto width, Index k) {
    using Width = decltype(width);
    const Width product = load_as<Width>(x + k) * load_as<Width>(w + k);
    return product * product;
  });
}
