// The operations of expressions on rows of lanes; part of level.cpp.
//
// exp, tanh and sin are those of elementary.ipp, with the same bits on every level; the others are those of the C
// library, number by number.

/// Lanes come in eights, and no row is its own operand: that leaves nothing to look out for.
template <typename Function>
inline void for_each_lane(int lanes, const double* a, const double* b, double* out, Function function) {
  constexpr int block = 8;
  for (int first = 0; first < lanes; first += block) {
    double value[block];
    for (int k = 0; k < block; ++k) value[k] = function(a[first + k], b[first + k]);
    for (int k = 0; k < block; ++k) out[first + k] = value[k];
  }
}

template <bool is_alone>
inline void run_lanes(int count, const TapeInstruction* code, int some_lanes, int used, double* rows) {
  const int lanes = is_alone ? 1 : some_lanes;
  for (const TapeInstruction* step = code; step != code + count; ++step) {
    const double* a = rows + static_cast<Index>(step->a) * lanes;
    const double* b = rows + static_cast<Index>(step->b) * lanes;
    double* out = rows + static_cast<Index>(step->row) * lanes;
    const auto each = [&](auto function) {
      if constexpr (is_alone) {
        for (;; ++step) {  // and of all that follow with the same operation
          rows[step->row] = function(rows[step->a], rows[step->b]);
          if (step + 1 == code + count || step[1].operation != step->operation) return;
        }
      }
      for_each_lane(lanes, a, b, out, function);
    };
    const auto each_used = [=](auto function) {
      if constexpr (is_alone) {
        *out = function(*a, *b);
        return;
      }
      for (int k = 0; k < used; ++k) out[k] = function(a[k], b[k]);
      for (int k = used; k < lanes; ++k) out[k] = out[0];
    };
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
        each_used([](double x, double y) { return pow(x, y); });
        break;
      case Operation::power_log:
        each_used([](double x, double y) { return x == 0.0 ? 0.0 : pow(x, y) * log(x); });
        break;
      case Operation::exp:
        exponential(lanes, a, out);
        for (int k = 0; k < lanes; ++k) {
          if (!(a[k] <= 709.0)) out[k] = exp(a[k]);  // to infinity
        }
        break;
      case Operation::expm1:
        each_used([](double x, double) { return expm1(x); });
        break;
      case Operation::log:
        each_used([](double x, double) { return log(x); });
        break;
      case Operation::log1p:
        each_used([](double x, double) { return log1p(x); });
        break;
      case Operation::sin:
        for_each_vector(lanes, out, sin_of, a);
        for (int k = 0; k < lanes; ++k) {
          if (!(fabs(a[k]) < 1e5)) out[k] = sin(a[k]);  // beyond its reduction
        }
        break;
      case Operation::cos:
        each_used([](double x, double) { return cos(x); });
        break;
      case Operation::tan:
        each_used([](double x, double) { return tan(x); });
        break;
      case Operation::asin:
        each_used([](double x, double) { return asin(x); });
        break;
      case Operation::acos:
        each_used([](double x, double) { return acos(x); });
        break;
      case Operation::atan:
        each_used([](double x, double) { return atan(x); });
        break;
      case Operation::atan2:
        each_used([](double x, double y) { return atan2(x, y); });
        break;
      case Operation::sinh:
        each_used([](double x, double) { return sinh(x); });
        break;
      case Operation::cosh:
        each_used([](double x, double) { return cosh(x); });
        break;
      case Operation::tanh:
        for_each_vector(lanes, out, tanh_of, a);
        break;
      case Operation::erf:
        each_used([](double x, double) { return erf(x); });
        break;
      case Operation::hypot:
        each_used([](double x, double y) { return hypot(x, y); });
        break;
      case Operation::abs:
        each([](double x, double) { return fabs(x); });
        break;
      case Operation::min:
        each([](double x, double y) { return y < x ? y : x; });
        break;
      case Operation::max:
        each([](double x, double y) { return y > x ? y : x; });
        break;
      case Operation::floor:
        each([](double x, double) { return floor(x); });
        break;
      case Operation::sign_of:
        each([](double x, double) { return x >= 0.0 ? 1.0 : -1.0; });
        break;
      case Operation::positive:
        each([](double x, double) { return x > 0.0 ? 1.0 : 0.0; });
        break;
      case Operation::not_negative:
        each([](double x, double) { return x >= 0.0 ? 1.0 : 0.0; });
        break;
      case Operation::sign:
        each([](double x, double) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; });
        break;
      case Operation::choose:
        each([](double x, double y) { return x != 0.0 ? y : 0.0; });
        break;
      case Operation::multiply_unless_zero:
        each([](double x, double y) { return x != 0.0 ? x * y : 0.0; });
        break;
      case Operation::usable:
        each([](double x, double) { return x - x == 0.0 ? 1.0 : 0.0; });
        break;
      case Operation::alternating:
        each([](double x, double) { return x == 2.0 * floor(0.5 * x) ? 1.0 : -1.0; });
        break;
      case Operation::noise:
        each_used(noise);
        break;
    }
  }
}

void run_tape(int count, const TapeInstruction* code, int lanes, int used, double* rows) {
  if (lanes == 1) {
    run_lanes<true>(count, code, lanes, used, rows);
  } else {
    run_lanes<false>(count, code, lanes, used, rows);
  }
}

void sum_actions(int count, int lanes, const double* const* points, const int* index, double* sum) {
  constexpr int at_once = 8;  // sums that do not wait for each other
  for (int first = 0; first < lanes; first += at_once) {
    const double* const* from = points + first;
    double total[at_once];
    for (int k = 0; k < at_once; ++k) total[k] = from[k][index[first + k]];
    for (int term = 1; term < count; ++term) {
      const int* of = index + static_cast<Index>(term) * lanes + first;
      for (int k = 0; k < at_once; ++k) total[k] += from[k][of[k]];
    }
    for (int k = 0; k < at_once; ++k) sum[first + k] = total[k];
  }
}
