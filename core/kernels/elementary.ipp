// exp, tanh and sin of many numbers, accurate to about one unit in the last place; part of level.cpp.

inline VectorBits bits_of(const Vector& vector) { return reinterpret_cast<VectorBits>(vector); }
inline Vector vector_of(const VectorBits& bits) { return reinterpret_cast<Vector>(bits); }

/// The first n numbers of a vector, the rest 0; n may be less than its length.
inline Vector load_few(int n, const double* from) {
  double few[vector_length];
  for (int k = 0; k < vector_length; ++k) few[k] = k < n ? from[k] : 0.0;
  return load(few);
}

/// out = function(vectors of a, ...) for n numbers; out may be one of them.
template <typename Function, typename... Numbers>
inline void for_each_vector(int n, double* out, Function function, const Numbers*... a) {
  if (n >= vector_length) {
    const int end = n - vector_length;
    const Vector last = function(load(a + end)...);  // overlaps the one before: taken first, put last
    for (int k = 0; k < end; k += vector_length) store(function(load(a + k)...), out + k);
    store(last, out + end);
    return;
  }
  double few[vector_length];
  store(function(load_few(n, a)...), few);
  for (int k = 0; k < vector_length; ++k) {
    if (k < n) out[k] = few[k];
  }
}

// a = k ln 2 + r with |r| <= ln 2 / 2; returns exp(r) - 1 and 2^k.
inline void reduce_exponential(const Vector& a, Vector* expm1_of_rest, Vector* power) {
  constexpr double log2_e = 0x1.71547652b82fep+0;
  constexpr double ln2_high = 0x1.62e42fee00000p-1;  // 33 bits, so that k * ln2_high is exact
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  constexpr double round_and_bias = 0x1.8p52 + 1023.0;  // adding it rounds and leaves k + 1023 in the low bits
  const Vector shifted = a * log2_e + round_and_bias;
  const Vector k = shifted - round_and_bias;
  const Vector r = (a - k * ln2_high) - k * ln2_low;
  // Taylor polynomial of degree 13: its remainder on |r| <= 0.3466 is below 5e-18. Summed in pairs, pairs of pairs and
  // so on, because a chain of operations that wait for each other takes longest.
  const Vector r2 = r * r;
  const Vector r4 = r2 * r2;
  const Vector p2 = r * (1.0 / 6.0) + 0.5;
  const Vector p4 = r * (1.0 / 120.0) + 1.0 / 24.0;
  const Vector p6 = r * (1.0 / 5040.0) + 1.0 / 720.0;
  const Vector p8 = r * (1.0 / 362880.0) + 1.0 / 40320.0;
  const Vector p10 = r * (1.0 / 39916800.0) + 1.0 / 3628800.0;
  const Vector p12 = r * (1.0 / 6227020800.0) + 1.0 / 479001600.0;
  const Vector p = ((p4 * r2 + p2) + (p8 * r2 + p6) * r4) + (p12 * r2 + p10) * (r4 * r4);
  *expm1_of_rest = r + r2 * p;
  *power = vector_of(bits_of(shifted) << 52);
}

inline Vector exponential_of(const Vector& a) {
  constexpr double lowest = -708.0;  // exp(a) is still a normal number
  constexpr double highest = 709.0;
  const Vector low = Vector{} + lowest;
  const Vector high = Vector{} + highest;
  Vector clamped = a < low ? low : a;
  clamped = clamped > high ? high : clamped;
  Vector rest;
  Vector power;
  reduce_exponential(clamped, &rest, &power);
  const Vector value = power + power * rest;
  const Vector zero = {};
  return a < low ? zero : value;
}

void exponential(int n, const double* a, double* out) { for_each_vector(n, out, exponential_of, a); }

inline Vector tanh_of(const Vector& a) {
  const VectorBits sign_bit = VectorBits{} + static_cast<long long>(0x8000000000000000ULL);
  const VectorBits sign = bits_of(a) & sign_bit;
  Vector twice = 2.0 * vector_of(bits_of(a) & ~sign_bit);
  const Vector limit = Vector{} + 44.0;  // tanh(22) rounds to 1
  twice = twice > limit ? limit : twice;
  Vector rest;
  Vector power;
  reduce_exponential(twice, &rest, &power);
  const Vector expm1 = power * rest + (power - 1.0);
  const Vector magnitude = expm1 / (expm1 + 2.0);
  return vector_of(bits_of(magnitude) | sign);
}

void scaled_tanh(int n, const double* amplitude, const double* sharpness, const double* a, double* out) {
  const auto term = [](const Vector& height, const Vector& slope, const Vector& e) {
    return height * tanh_of(slope * e);
  };
  for_each_vector(n, out, term, amplitude, sharpness, a);
}

// Cody-Waite reduction by pi / 2 and the minimax polynomials of FreeBSD's msun; exact enough for |a| below 1e5.
inline Vector sin_of(const Vector& a) {
  constexpr double two_over_pi = 6.36619772367581382433e-01;
  constexpr double half_pi_1 = 1.57079632673412561417e+00;
  constexpr double half_pi_2 = 6.07710050630396597660e-11;
  constexpr double half_pi_3 = 2.02226624871116645580e-21;
  constexpr double half_pi_4 = 8.47842766036889956997e-32;
  constexpr double round = 0x1.8p52;
  const Vector shifted = a * two_over_pi + round;
  const Vector k = shifted - round;
  const VectorBits quadrant = bits_of(shifted);
  const Vector r = (((a - k * half_pi_1) - k * half_pi_2) - k * half_pi_3) - k * half_pi_4;
  const Vector z = r * r;
  const Vector w = z * z;
  const Vector s2 = z * -1.98412698298579493134e-04 + 8.33333333332248946124e-03;
  const Vector s4 = z * -2.50507602534068634195e-08 + 2.75573137070700676789e-06;
  const Vector sine = r + (z * r) * (z * (w * (w * 1.58969099521155010221e-10 + s4) + s2) - 1.66666666666666324348e-01);
  const Vector c1 = z * -1.38888888888741095749e-03 + 4.16666666666666019037e-02;
  const Vector c3 = z * -2.75573143513906633035e-07 + 2.48015872894767294178e-05;
  const Vector c5 = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09;
  const Vector cosine = 1.0 - (0.5 * z - w * (w * (w * c5 + c3) + c1));
  const VectorBits odd = (quadrant & 1) != 0;
  const Vector value = odd ? cosine : sine;
  const VectorBits negative = (quadrant & 2) << 62;
  return vector_of(bits_of(value) ^ negative);
}

void sinusoid(int n, double t, const double* amplitude, const double* frequency, const double* phase,
              const double* bias, double* d) {
  constexpr double reducible = 1e5;
  double largest = 0.0;
  for (int k = 0; k < n; ++k) {
    const double angle = fabs(frequency[k] * t + phase[k]);
    largest = angle > largest ? angle : largest;
  }
  if (largest < reducible) {
    const auto term = [t](const Vector& height, const Vector& rate, const Vector& start, const Vector& middle) {
      return middle + height * sin_of(rate * t + start);
    };
    for_each_vector(n, d, term, amplitude, frequency, phase, bias);
  } else {
    for (int k = 0; k < n; ++k) d[k] = bias[k] + amplitude[k] * sin(frequency[k] * t + phase[k]);
  }
}
