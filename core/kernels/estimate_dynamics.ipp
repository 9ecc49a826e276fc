// y_ij' = -k3 (sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j)); part of level.cpp.

void estimate_rates(int players, int dimension, NeighbourRows graph, double k3, const double* __restrict y,
                    const double* __restrict xbar, double* __restrict rate) {
  const int n = players * dimension;
  for (int i = 0; i < players; ++i) {
    const double* __restrict own = y + i * n;
    double* __restrict out = rate + i * n;
    const int first = graph.start[i];
    const int last = graph.start[i + 1];
    for (int p = 0; p < n; ++p) out[p] = 0.0;
    int e = first;
    for (; e + 1 < last; e += 2) {
      const double a = -k3 * graph.weight[e];
      const double b = -k3 * graph.weight[e + 1];
      const double* __restrict other = y + graph.neighbour[e] * n;
      const double* __restrict another = y + graph.neighbour[e + 1] * n;
      for (int p = 0; p < n; ++p) out[p] = (out[p] + a * (own[p] - other[p])) + b * (own[p] - another[p]);
    }
    if (e < last) {
      const double a = -k3 * graph.weight[e];
      const double* __restrict other = y + graph.neighbour[e] * n;
      for (int p = 0; p < n; ++p) out[p] += a * (own[p] - other[p]);
    }
    for (e = first; e < last; ++e) {
      const double a = -k3 * graph.weight[e];
      for (int l = 0; l < dimension; ++l) {
        const int p = l * players + graph.neighbour[e];
        out[p] += a * (own[p] - xbar[p]);
      }
    }
  }
}
