#include "equilibrium/interval_matrix.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>

namespace mixed_order_game {
namespace {

using Matrix = Eigen::MatrixXd;

struct Drawn {
  std::vector<Interval> entries;
  std::vector<Matrix> members;  // the middle, the one without its radii on the diagonal, corners and others
};

Drawn draw(int n, Real radius, std::mt19937_64& random) {
  std::uniform_real_distribution<Real> share(-1.0, 1.0);
  Drawn drawn;
  Matrix middle(n, n);
  Matrix radii(n, n);
  for (int p = 0; p < n; ++p) {
    for (int k = 0; k < n; ++k) {
      middle(p, k) = share(random) + (p == k ? 3.0 + 2.0 * p : 0.0);
      radii(p, k) = share(random) < 0.3 ? 0.0 : radius * std::abs(share(random));
      drawn.entries.push_back({middle(p, k) - radii(p, k), middle(p, k) + radii(p, k)});
    }
  }
  drawn.members = {middle, middle - Matrix(radii.diagonal().asDiagonal())};
  for (int count = 0; count < 100; ++count) {
    Matrix member = middle;
    for (int p = 0; p < n; ++p) {
      for (int k = 0; k < n; ++k) {
        const Real where = share(random);
        member(p, k) += radii(p, k) * (count % 2 == 0 ? std::copysign(1.0, where) : where);
      }
    }
    drawn.members.push_back(member);
  }
  return drawn;
}

Real least_of(const Matrix& member) {
  return Eigen::SelfAdjointEigenSolver<Matrix>(0.5 * (member + member.transpose())).eigenvalues()(0);
}

TEST(IntervalMatrix, BoundsHoldForAllMembers) {
  std::mt19937_64 random(4);  // NOLINT(bugprone-random-generator-seed)
  for (int round = 0; round < 60; ++round) {
    const int n = 1 + round % 6;
    const Drawn drawn = draw(n, round % 3 == 0 ? 0.0 : 0.7, random);
    const Real least = least_eigenvalue(drawn.entries, n);
    const Real norm = norm_bound(drawn.entries, n);
    for (const Matrix& member : drawn.members) {
      EXPECT_LE(least, least_of(member));
      EXPECT_GE(norm, member.operatorNorm());
    }
    if (round % 3 == 0) {
      EXPECT_NEAR(least, least_of(drawn.members[0]), 1e-10);
    }
  }
}

TEST(IntervalMatrix, WhatVariesOnTheDiagonalAloneLosesNothing) {
  // far from the least eigenvector, and at it
  const std::vector<Interval> far{{2.0, 2.0}, {0.1, 0.1}, {0.1, 0.1}, {20.0, 60.0}};
  Matrix lowest(2, 2);
  lowest << 2.0, 0.1, 0.1, 20.0;
  EXPECT_NEAR(least_eigenvalue(far, 2), least_of(lowest), 1e-10);
  EXPECT_NEAR(least_eigenvalue({{1.0, 3.0}, {0.0, 0.0}, {0.0, 0.0}, {5.0, 5.0}}, 2), 1.0, 1e-10);
}

TEST(IntervalMatrix, WhatVariesBesideTheDiagonalCostsLittleFarFromTheLeastEigenvector) {
  // the norm of the radii is 1; the worst member has 2 - 1 / 98
  const std::vector<Interval> entries{{2.0, 2.0}, {-1.0, 1.0}, {-1.0, 1.0}, {100.0, 100.0}};
  EXPECT_GT(least_eigenvalue(entries, 2), 1.9);
  EXPECT_LT(least_eigenvalue(entries, 2), 2.0 - 1.0 / 98.1);
}

TEST(IntervalMatrix, NothingIsToldOfUnboundedEntries) {
  const Real infinite = std::numeric_limits<Real>::infinity();
  EXPECT_EQ(least_eigenvalue({{1.0, infinite}}, 1), -infinite);
  EXPECT_EQ(norm_bound({{1.0, infinite}}, 1), infinite);
}

}  // namespace
}  // namespace mixed_order_game
