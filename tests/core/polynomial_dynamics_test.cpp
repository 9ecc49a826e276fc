#include "families/polynomial_dynamics.hpp"

#include <gtest/gtest.h>

namespace mixed_order_game {
namespace {

// three players in two dimensions; x = (1, 2), (3, 5), (-1, 4), coordinates outermost
constexpr int N = 3;
constexpr int D = 2;
const std::vector<Real> x{1.0, 3.0, -1.0, 2.0, 5.0, 4.0};

PolynomialDynamics dynamics() {
  PolynomialDynamics made({.players = N, .dimension = D, .order = {}});
  const auto slot = [](int i, int j, int l) { return (l * N + i) * N + j; };
  made.coefficients.set(PolynomialDynamics::linear, slot(2, 2, 1), 3.0);
  made.coefficients.set(PolynomialDynamics::linear, slot(0, 2, 0), 2.0);
  made.coefficients.set(PolynomialDynamics::square, slot(0, 2, 0), -0.5);
  made.coefficients.set(PolynomialDynamics::square, slot(0, 1, 0), 1.0);
  made.coefficients.set(PolynomialDynamics::linear, slot(1, 0, 1), -1.0);
  made.coefficients.set(PolynomialDynamics::square, slot(1, 0, 1), 0.25);
  made.refresh();
  return made;
}

TEST(PolynomialDynamics, ValuesAreTheFormula) {
  std::vector<Real> g(N * D, 99.0);
  PolynomialDynamics d = dynamics();
  d.values(x.data(), nullptr, g.data());
  // g_11 = x_21^2 + 2 x_31 - 0.5 x_31^2, g_22 = -x_12 + 0.25 x_12^2, g_32 = 3 x_32
  EXPECT_EQ(g, (std::vector<Real>{9.0 - 2.0 - 0.5, 0.0, 0.0, 0.0, -2.0 + 1.0, 12.0}));
  d.coefficients[PolynomialDynamics::gain] = {2.0, -1.0, 0.5};
  d.values(x.data(), nullptr, g.data());
  EXPECT_EQ(g, (std::vector<Real>{13.0, 0.0, 0.0, 0.0, 1.0, 6.0}));
}

TEST(PolynomialDynamics, JacobianIsTheDerivativeOfTheValues) {
  PolynomialDynamics d = dynamics();
  d.coefficients[PolynomialDynamics::gain] = {2.0, -1.0, 0.5};
  const SparseRows& pattern = d.jacobian_pattern();
  ASSERT_EQ(pattern.rows(), N * D);
  EXPECT_EQ(pattern.start, (std::vector<int>{0, 2, 2, 2, 2, 3, 4}));
  EXPECT_EQ(pattern.column, (std::vector<int>{1, 2, 3, 5}));
  std::vector<Real> values(at(pattern.entries()));
  d.jacobian(x.data(), nullptr, values.data());
  std::vector<Real> above(N * D);
  std::vector<Real> below(N * D);
  for (int row = 0; row < N * D; ++row) {
    for (int k = pattern.start[at(row)]; k < pattern.start[at(row + 1)]; ++k) {
      std::vector<Real> moved = x;
      moved[at(pattern.column[at(k)])] += 0.5;
      d.values(moved.data(), nullptr, above.data());
      moved[at(pattern.column[at(k)])] -= 1.0;
      d.values(moved.data(), nullptr, below.data());
      EXPECT_DOUBLE_EQ(values[at(k)], above[at(row)] - below[at(row)]);  // exact for squares
    }
  }
}

TEST(PolynomialDynamics, ACloneKeepsGainsAndTerms) {
  PolynomialDynamics d = dynamics();
  d.coefficients[PolynomialDynamics::gain][0] = 3.0;
  const std::unique_ptr<UnknownDynamics> clone = d.clone();
  d.coefficients[PolynomialDynamics::gain][0] = 7.0;
  std::vector<Real> g(N * D);
  clone->values(x.data(), nullptr, g.data());
  EXPECT_EQ(g[0], 3.0 * 6.5);
}

TEST(PolynomialDynamics, WithoutTermsIsZero) {
  const PolynomialDynamics none({.players = N, .dimension = D, .order = {}});
  std::vector<Real> g(N * D, 99.0);
  none.values(x.data(), nullptr, g.data());
  EXPECT_EQ(g, std::vector<Real>(N * D, 0.0));
  EXPECT_EQ(none.jacobian_pattern().entries(), 0);
  EXPECT_EQ(none.jacobian_pattern().rows(), N * D);
}

}  // namespace
}  // namespace mixed_order_game
