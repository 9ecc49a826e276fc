// The operations of expressions on rows of lanes; part of level.cpp.
//
// exp, tanh and sin are those of elementary.ipp, with the same bits on every level; the others are those of the C
// library, number by number.

template <typename Function>
inline void for_each_lane(int lanes, const double* a, const double* b, double* out, Function function) {
  for (int k = 0; k < lanes; ++k) out[k] = function(a[k], b[k]);
}

void run_tape(int count, const TapeInstruction* code, int lanes, double* rows) {
  for (const TapeInstruction* step = code; step != code + count; ++step) {
    const double* a = rows + static_cast<Index>(step->a) * lanes;
    const double* b = rows + static_cast<Index>(step->b) * lanes;
    double* out = rows + static_cast<Index>(step->row) * lanes;
    const auto each = [=](auto function) { for_each_lane(lanes, a, b, out, function); };
    switch (step->operation) {
      case Operation::number:
      case Operation::leaf:
        break;
      case Operation::add:
        each([](double x, double y) { return x + y; });
        break;
      case Operation::subtract:
        each([](double x, double y) { return x - y; });
        break;
      case Operation::multiply:
        each([](double x, double y) { return x * y; });
        break;
      case Operation::divide:
        each([](double x, double y) { return x / y; });
        break;
      case Operation::negative:
        each([](double x, double) { return -x; });
        break;
      case Operation::sqrt:
        each([](double x, double) { return sqrt(x); });
        break;
      case Operation::power:
        each([](double x, double y) { return pow(x, y); });
        break;
      case Operation::power_log:
        each([](double x, double y) { return x == 0.0 ? 0.0 : pow(x, y) * log(x); });
        break;
      case Operation::exp:
        exponential(lanes, a, out);
        for (int k = 0; k < lanes; ++k) {
          if (!(a[k] <= 709.0)) out[k] = exp(a[k]);  // to infinity
        }
        break;
      case Operation::expm1:
        each([](double x, double) { return expm1(x); });
        break;
      case Operation::log:
        each([](double x, double) { return log(x); });
        break;
      case Operation::log1p:
        each([](double x, double) { return log1p(x); });
        break;
      case Operation::sin:
        for_each_vector(lanes, a, out, sin_of);
        for (int k = 0; k < lanes; ++k) {
          if (!(fabs(a[k]) < 1e5)) out[k] = sin(a[k]);  // beyond its reduction
        }
        break;
      case Operation::cos:
        each([](double x, double) { return cos(x); });
        break;
      case Operation::tan:
        each([](double x, double) { return tan(x); });
        break;
      case Operation::asin:
        each([](double x, double) { return asin(x); });
        break;
      case Operation::acos:
        each([](double x, double) { return acos(x); });
        break;
      case Operation::atan:
        each([](double x, double) { return atan(x); });
        break;
      case Operation::atan2:
        each([](double x, double y) { return atan2(x, y); });
        break;
      case Operation::sinh:
        each([](double x, double) { return sinh(x); });
        break;
      case Operation::cosh:
        each([](double x, double) { return cosh(x); });
        break;
      case Operation::tanh:
        for_each_vector(lanes, a, out, tanh_of);
        break;
      case Operation::erf:
        each([](double x, double) { return erf(x); });
        break;
      case Operation::hypot:
        each([](double x, double y) { return hypot(x, y); });
        break;
    }
  }
}
