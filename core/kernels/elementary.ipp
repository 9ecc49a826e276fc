// exp, tanh and sin on eight lanes at a time, accurate to about one unit in the last place; part of level.cpp.

typedef double Lanes __attribute__((vector_size(64)));
typedef long long LaneBits __attribute__((vector_size(64)));

constexpr int lane_count = 8;

inline Lanes load(const double* from) {
  Lanes lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return lanes;
}

inline Lanes load_part(int count, const double* from) {
  Lanes lanes = {};
  __builtin_memcpy(&lanes, from, static_cast<unsigned long>(count) * sizeof(double));
  return lanes;
}

inline void store(const Lanes& lanes, double* to) { __builtin_memcpy(to, &lanes, sizeof lanes); }

inline void store_part(int count, const Lanes& lanes, double* to) {
  __builtin_memcpy(to, &lanes, static_cast<unsigned long>(count) * sizeof(double));
}

inline LaneBits bits_of(const Lanes& lanes) { return reinterpret_cast<LaneBits>(lanes); }
inline Lanes lanes_of(const LaneBits& bits) { return reinterpret_cast<Lanes>(bits); }

/// The eight lanes added in a fixed order.
inline double total(const Lanes& a) {
  return ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]));
}

/// Applies function(lanes) -> lanes to n numbers.
template <typename Function>
inline void for_each_lane(int n, const double* a, double* out, Function function) {
  int k = 0;
  for (; k + lane_count <= n; k += lane_count) store(function(load(a + k)), out + k);
  if (k < n) store_part(n - k, function(load_part(n - k, a + k)), out + k);
}

// a = k ln 2 + r with |r| <= ln 2 / 2; returns exp(r) - 1 and 2^k.
inline void reduce_exponential(const Lanes& a, Lanes* expm1_of_rest, Lanes* power) {
  constexpr double log2_e = 0x1.71547652b82fep+0;
  constexpr double ln2_high = 0x1.62e42fee00000p-1;  // 33 bits, so that k * ln2_high is exact
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  constexpr double round_and_bias = 0x1.8p52 + 1023.0;  // adding it rounds and leaves k + 1023 in the low bits
  const Lanes shifted = a * log2_e + round_and_bias;
  const Lanes k = shifted - round_and_bias;
  const Lanes r = (a - k * ln2_high) - k * ln2_low;
  // Taylor polynomial of degree 13: its remainder on |r| <= 0.3466 is below 5e-18
  Lanes p = r * (1.0 / 6227020800.0) + 1.0 / 479001600.0;
  p = p * r + 1.0 / 39916800.0;
  p = p * r + 1.0 / 3628800.0;
  p = p * r + 1.0 / 362880.0;
  p = p * r + 1.0 / 40320.0;
  p = p * r + 1.0 / 5040.0;
  p = p * r + 1.0 / 720.0;
  p = p * r + 1.0 / 120.0;
  p = p * r + 1.0 / 24.0;
  p = p * r + 1.0 / 6.0;
  p = p * r + 0.5;
  *expm1_of_rest = r + (r * r) * p;
  *power = lanes_of(bits_of(shifted) << 52);
}

inline Lanes exponential_of(const Lanes& a) {
  constexpr double lowest = -708.0;  // exp(a) is still a normal number
  constexpr double highest = 709.0;
  const Lanes low = a - a + lowest;
  const Lanes high = a - a + highest;
  Lanes clamped = a < low ? low : a;
  clamped = clamped > high ? high : clamped;
  Lanes rest;
  Lanes power;
  reduce_exponential(clamped, &rest, &power);
  const Lanes value = power + power * rest;
  const Lanes zero = {};
  return a < low ? zero : value;
}

void exponential(int n, const double* a, double* out) { for_each_lane(n, a, out, exponential_of); }

inline Lanes tanh_of(const Lanes& a) {
  const LaneBits sign_bit = LaneBits{} + static_cast<long long>(0x8000000000000000ULL);
  const LaneBits sign = bits_of(a) & sign_bit;
  Lanes twice = 2.0 * lanes_of(bits_of(a) & ~sign_bit);
  const Lanes limit = Lanes{} + 44.0;  // tanh(22) rounds to 1
  twice = twice > limit ? limit : twice;
  Lanes rest;
  Lanes power;
  reduce_exponential(twice, &rest, &power);
  const Lanes expm1 = power * rest + (power - 1.0);
  const Lanes magnitude = expm1 / (expm1 + 2.0);
  return lanes_of(bits_of(magnitude) | sign);
}

void scaled_tanh(int n, double amplitude, double sharpness, const double* a, double* out) {
  for_each_lane(n, a, out, [&](const Lanes& e) { return amplitude * tanh_of(sharpness * e); });
}

// Cody-Waite reduction by pi / 2 and the minimax polynomials of FreeBSD's msun; exact enough for |a| below 1e5.
inline Lanes sin_of(const Lanes& a) {
  constexpr double two_over_pi = 6.36619772367581382433e-01;
  constexpr double half_pi_1 = 1.57079632673412561417e+00;
  constexpr double half_pi_2 = 6.07710050630396597660e-11;
  constexpr double half_pi_3 = 2.02226624871116645580e-21;
  constexpr double half_pi_4 = 8.47842766036889956997e-32;
  constexpr double round = 0x1.8p52;
  const Lanes shifted = a * two_over_pi + round;
  const Lanes k = shifted - round;
  const LaneBits quadrant = bits_of(shifted);
  const Lanes r = (((a - k * half_pi_1) - k * half_pi_2) - k * half_pi_3) - k * half_pi_4;
  const Lanes z = r * r;
  Lanes s = z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08;
  s = s * z + 2.75573137070700676789e-06;
  s = s * z - 1.98412698298579493134e-04;
  s = s * z + 8.33333333332248946124e-03;
  s = s * z - 1.66666666666666324348e-01;
  const Lanes sine = r + (z * r) * s;
  Lanes c = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09;
  c = c * z - 2.75573143513906633035e-07;
  c = c * z + 2.48015872894767294178e-05;
  c = c * z - 1.38888888888741095749e-03;
  c = c * z + 4.16666666666666019037e-02;
  const Lanes cosine = 1.0 - (0.5 * z - (z * z) * c);
  const LaneBits odd = (quadrant & 1) != 0;
  const Lanes value = odd ? cosine : sine;
  const LaneBits negative = (quadrant & 2) << 62;
  return lanes_of(bits_of(value) ^ negative);
}

void sinusoid(int n, double t, const double* amplitude, const double* frequency, const double* phase,
              const double* bias, double* d) {
  constexpr double reducible = 1e5;
  for (int k = 0; k < n; ++k) d[k] = frequency[k] * t + phase[k];
  for (int first = 0; first < n; first += lane_count) {
    const int count = n - first < lane_count ? n - first : lane_count;
    double* angles = d + first;
    bool small = true;
    for (int k = 0; k < count; ++k) small = small && angles[k] < reducible && angles[k] > -reducible;
    if (small) {
      store_part(count, sin_of(load_part(count, angles)), angles);
    } else {
      for (int k = 0; k < count; ++k) angles[k] = sin(angles[k]);
    }
  }
  for (int k = 0; k < n; ++k) d[k] = bias[k] + amplitude[k] * d[k];
}
