// Adaptation of the weights, W' = beta e (S - radial W), the sums w'S and w'w, and largest products; part of level.cpp.

void column_products(int n, int rows, const double* a, const double* b, double* sum) {
  const Index size = static_cast<Index>(rows) * n;
  for_columns(n, [=](auto width, Index p) {
    using Width = decltype(width);
    Width total = {};
    for (Index k = p; k < size; k += n) total += load_as<Width>(a + k) * load_as<Width>(b + k);
    store(total, sum + p);
  });
}

void largest_products(int n, int rows, const double* a, const double* b, double* largest) {
  const Index size = static_cast<Index>(rows) * n;
  for_columns(n, [=](auto width, Index p) {
    using Width = decltype(width);
    Width found = {};
    for (Index k = p; k < size; k += n) {
      const Width product = load_as<Width>(a + k) * load_as<Width>(b + k);
      found = product > found ? product : found;
    }
    store(found, largest + p);
  });
}

void weight_rates(int n, int neurons, const double* beta, const double* e, const double* radial,
                  const double* activation, const double* weights, double* rate) {
  const Index size = static_cast<Index>(neurons) * n;
  for_columns(n, [=](auto width, Index p) {
    using Width = decltype(width);
    const Width push = load_as<Width>(beta + p) * load_as<Width>(e + p);
    const Width r = load_as<Width>(radial + p);
    for (Index k = p; k < size; k += n) {
      store(push * (load_as<Width>(activation + k) - r * load_as<Width>(weights + k)), rate + k);
    }
  });
}

// rhs = scale rhs + from_error S + onto_weight W, row by row; all coefficients per column.
void weight_corrections(int n, int neurons, const double* scale_of, const double* from_error, const double* onto_weight,
                        const double* activation, const double* weights, double* rhs) {
  const Index size = static_cast<Index>(neurons) * n;
  for_columns(n, [=](auto width, Index p) {
    using Width = decltype(width);
    const Width kept = load_as<Width>(scale_of + p);
    const Width along_S = load_as<Width>(from_error + p);
    const Width along_w = load_as<Width>(onto_weight + p);
    for (Index k = p; k < size; k += n) {
      store((kept * load_as<Width>(rhs + k) + along_S * load_as<Width>(activation + k)) +
                along_w * load_as<Width>(weights + k),
            rhs + k);
    }
  });
}
