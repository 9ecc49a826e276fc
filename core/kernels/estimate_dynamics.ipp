// y_ij' = -k3 (sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j)); part of level.cpp.

void estimate_rates(int players, int dimension, NeighbourRows graph, double k3, const double* y, const double* xbar,
                    double* rate) {
  const Index n = static_cast<Index>(players) * dimension;
  for (int i = 0; i < players; ++i) {
    const double* own = y + i * n;
    double* out = rate + i * n;
    const int first = graph.start[i];
    const int last = graph.start[i + 1];
    for_columns(n, [=](auto width, Index p) {
      using Width = decltype(width);
      const Width mine = load_as<Width>(own + p);
      Width sum = {};
      for (int e = first; e < last; ++e) {
        sum += graph.weight[e] * (mine - load_as<Width>(y + graph.neighbour[e] * n + p));
      }
      store(-k3 * sum, out + p);
    });
    for (int e = first; e < last; ++e) {
      const double gain = -k3 * graph.weight[e];
      for (Index p = graph.neighbour[e]; p < n; p += players) out[p] += gain * (own[p] - xbar[p]);
    }
  }
}
