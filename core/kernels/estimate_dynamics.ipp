// y_ij' = -k3_i (sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j)); part of level.cpp.

/// -k3_i sum_k a_ik (y_ij - y_kj) of player i, for as many columns from p on as `count` vectors hold.
template <typename Width, int count>
inline void consensus_rates(NeighbourRows graph, int i, Index n, const double* k3, const double* y, double* rate,
                            Index p) {
  Width mine[count];
  Width sum[count];
  for (int c = 0; c < count; ++c) {
    mine[c] = load_as<Width>(y + i * n + p + c * length_of<Width>);
    sum[c] = Width{};
  }
  for (int e = graph.start[i]; e < graph.start[i + 1]; ++e) {
    const double* other = y + graph.neighbour[e] * n + p;
    for (int c = 0; c < count; ++c)
      sum[c] += graph.weight[e] * (mine[c] - load_as<Width>(other + c * length_of<Width>));
  }
  const double gain = -k3[i];
  for (int c = 0; c < count; ++c) store(gain * sum[c], rate + i * n + p + c * length_of<Width>);
}

void estimate_rates(int rows, int players, int dimension, NeighbourRows graph, NeighbourRows seen, const double* k3,
                    const double* y, const double* xbar, double* rate) {
  constexpr int at_once = 4;  // sums that do not wait for each other
  constexpr Index strip = at_once * vector_length;
  const Index n = static_cast<Index>(players) * dimension;
  // of all players, so that a strip of y stays in the nearest caches
  Index p = 0;
  for (; p + strip <= n; p += strip) {
    for (int i = 0; i < rows; ++i) consensus_rates<Vector, at_once>(graph, i, n, k3, y, rate, p);
  }
  for_columns(n - p, [=](auto width, Index q) {
    for (int i = 0; i < rows; ++i) consensus_rates<decltype(width), 1>(graph, i, n, k3, y, rate, p + q);
  });
  for (int i = 0; i < rows; ++i) {
    const double* own = y + i * n;
    double* out = rate + i * n;
    for (int e = seen.start[i]; e < seen.start[i + 1]; ++e) {
      const double gain = -k3[i] * seen.weight[e];
      for (Index j = seen.neighbour[e]; j < n; j += players) out[j] += gain * (own[j] - xbar[j]);
    }
  }
}
