#include "expression/noise.hpp"

#include <array>
#include <cmath>
#include <cstdint>

namespace mixed_order_game {

namespace {

using Word = std::uint64_t;

/// The upper 64 bits of a b.
Word upper_product(Word a, Word b) {
  constexpr Word low = 0xFFFFFFFF;
  const Word a0 = a & low;
  const Word a1 = a >> 32U;
  const Word b0 = b & low;
  const Word b1 = b >> 32U;
  const Word middle = a1 * b0 + (a0 * b0 >> 32U);
  return a1 * b1 + (middle >> 32U) + ((a0 * b1 + (middle & low)) >> 32U);
}

Word philox_first_word(Word seed, Word k) {
  constexpr Word multiplier_0 = 0xD2E7470EE14C6C93;
  constexpr Word multiplier_1 = 0xCA5A826395121157;
  constexpr Word weyl_0 = 0x9E3779B97F4A7C15;
  constexpr Word weyl_1 = 0xBB67AE8584CAA73B;
  constexpr int rounds = 10;
  std::array<Word, 4> c{k, 0, 0, 0};
  Word key_0 = seed;
  Word key_1 = 0;
  for (int round = 0; round < rounds; ++round) {
    c = {upper_product(multiplier_1, c[2]) ^ c[1] ^ key_0, multiplier_1 * c[2],
         upper_product(multiplier_0, c[0]) ^ c[3] ^ key_1, multiplier_0 * c[0]};
    key_0 += weyl_0;
    key_1 += weyl_1;
  }
  return c[0];
}

/// Coefficients from the constant on.
Real polynomial(const std::array<Real, 8>& coefficients, Real x) {
  Real value = coefficients[7];
  for (int k = 6; k >= 0; --k) value = value * x + coefficients[static_cast<std::size_t>(k)];
  return value;
}

/// AS 241, PPND16.
Real normal_quantile(Real p) {
  static constexpr std::array a{3.3871328727963666080e0,  1.3314166789178437745e+2, 1.9715909503065514427e+3,
                                1.3731693765509461125e+4, 4.5921953931549871457e+4, 6.7265770927008700853e+4,
                                3.3430575583588128105e+4, 2.5090809287301226727e+3};
  static constexpr std::array b{1.0,
                                4.2313330701600911252e+1,
                                6.8718700749205790830e+2,
                                5.3941960214247511077e+3,
                                2.1213794301586595867e+4,
                                3.9307895800092710610e+4,
                                2.8729085735721942674e+4,
                                5.2264952788528545610e+3};
  static constexpr std::array c{1.42343711074968357734e0,  4.63033784615654529590e0, 5.76949722146069140550e0,
                                3.64784832476320460504e0,  1.27045825245236838258e0, 2.41780725177450611770e-1,
                                2.27238449892691845833e-2, 7.74545014278341407640e-4};
  static constexpr std::array d{1.0,
                                2.05319162663775882187e0,
                                1.67638483018380384940e0,
                                6.89767334985100004550e-1,
                                1.48103976427480074590e-1,
                                1.51986665636164571966e-2,
                                5.47593808499534494600e-4,
                                1.05075007164441684324e-9};
  static constexpr std::array e{6.65790464350110377720e0,  5.46378491116411436990e0,  1.78482653991729133580e0,
                                2.96560571828504891230e-1, 2.65321895265761230930e-2, 1.24266094738807843860e-3,
                                2.71155556874348757815e-5, 2.01033439929228813265e-7};
  static constexpr std::array f{1.0,
                                5.99832206555887937690e-1,
                                1.36929880922735805310e-1,
                                1.48753612908506148525e-2,
                                7.86869131145613259100e-4,
                                1.84631831751005468180e-5,
                                1.42151175831644588870e-7,
                                2.04426310338993978564e-15};
  const Real q = p - 0.5;
  if (std::fabs(q) <= 0.425) {
    const Real r = 0.180625 - q * q;
    return q * polynomial(a, r) / polynomial(b, r);
  }
  const Real r = std::sqrt(-std::log(q < 0.0 ? p : 1.0 - p));
  const Real magnitude =
      r <= 5.0 ? polynomial(c, r - 1.6) / polynomial(d, r - 1.6) : polynomial(e, r - 5.0) / polynomial(f, r - 5.0);
  return q < 0.0 ? -magnitude : magnitude;
}

/// An integer modulo 2^64.
Word word_of(Real integer) {
  constexpr Real two_to_63 = 9223372036854775808.0;
  if (!(std::fabs(integer) < two_to_63)) return 0;
  return static_cast<Word>(static_cast<std::int64_t>(integer));
}

}  // namespace

Real noise(Real seed, Real k) {
  const Word bits = philox_first_word(word_of(seed), word_of(k)) >> 12U;
  return normal_quantile((static_cast<Real>(bits) + 0.5) * 0x1p-52);  // exact
}

}  // namespace mixed_order_game
