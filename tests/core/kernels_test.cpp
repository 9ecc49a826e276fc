#include "kernels/kernels.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <memory>

#include "newton/block_elimination.hpp"
#include "random_game.hpp"

namespace mixed_order_game {
namespace {

using testing::RandomNumbers;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// Exactly n numbers on the heap, so that the address sanitizer sees every access beyond them.
class Array {
 public:
  explicit Array(int n, double value = 0.0)
      : size_(n), numbers_(std::make_unique<double[]>(static_cast<std::size_t>(n))) {
    for (int k = 0; k < n; ++k) (*this)[k] = value;
  }
  Array(int n, RandomNumbers& random, double low = -2.0, double high = 2.0) : Array(n) {
    for (int k = 0; k < n; ++k) (*this)[k] = random.between(low, high);
  }
  Array(const Array& other) : Array(other.size_) {
    for (int k = 0; k < size_; ++k) (*this)[k] = other[k];
  }
  Array(Array&&) = default;

  double& operator[](int k) { return numbers_[static_cast<std::size_t>(k)]; }
  double operator[](int k) const { return numbers_[static_cast<std::size_t>(k)]; }
  operator double*() { return numbers_.get(); }              // NOLINT
  operator const double*() const { return numbers_.get(); }  // NOLINT
  [[nodiscard]] int size() const { return size_; }

  friend bool operator==(const Array& a, const Array& b) {
    if (a.size_ != b.size_) return false;
    for (int k = 0; k < a.size_; ++k) {
      if (std::bit_cast<std::uint64_t>(a[k]) != std::bit_cast<std::uint64_t>(b[k])) return false;
    }
    return true;
  }
  friend std::ostream& operator<<(std::ostream& out, const Array& array) {
    for (int k = 0; k < array.size_; ++k) out << array[k] << ' ';
    return out;
  }

 private:
  int size_;
  std::unique_ptr<double[]> numbers_;
};

const std::vector<int> sizes{1, 2, 3, 5, 7, 8, 9, 13, 16, 17, 31, 50};

/// Runs a kernel of every level and expects the same bits from each; returns them.
template <typename Run>
Array on_every_level(Run run) {
  Array baseline = run(kernels_of_level(0));
  for (int level = 1; level < kernel_level_count(); ++level) {
    const Array other = run(kernels_of_level(level));
    EXPECT_EQ(other, baseline) << kernels_of_level(level).level;
  }
  return baseline;
}

double distance_in_ulp(double computed, long double exact) {
  const double rounded = static_cast<double>(exact);
  if (std::isinf(rounded) || rounded == 0.0) return computed == rounded ? 0.0 : infinity;
  const long double unit = std::nextafter(std::abs(rounded), infinity) - std::abs(rounded);
  return static_cast<double>(std::abs(computed - exact) / unit);
}

TEST(Kernels, BestLevelIsTheLastThatRuns) {
  EXPECT_STREQ(kernels_of_level(0).level, "baseline");
  EXPECT_EQ(&kernels(), &kernels_of_level(kernel_level_count() - 1));
}

// --- elementary functions ---

Array exponentials(const Array& a) {
  return on_every_level([&](const Kernels& kernel) {
    Array out(a.size());
    kernel.exponential(a.size(), a, out);
    return out;
  });
}

Array tanhs(const Array& a) {
  return on_every_level([&](const Kernels& kernel) {
    Array out(a.size());
    const Array one(a.size(), 1.0);
    kernel.scaled_tanh(a.size(), one, one, a, out);
    return out;
  });
}

Array sines(const Array& a) {
  return on_every_level([&](const Kernels& kernel) {
    Array out(a.size());
    const Array zero(a.size());
    const Array one(a.size(), 1.0);
    kernel.sinusoid(a.size(), 0.0, one, zero, a, zero, out);
    return out;
  });
}

/// Numbers of every magnitude up to 2^highest, of both signs.
Array wide(int n, int lowest, int highest, RandomNumbers& random) {
  Array a(n);
  for (int k = 0; k < n; ++k) {
    a[k] = std::ldexp(random.between(1.0, 2.0), static_cast<int>(random.between(lowest, highest)));
    if (random.chance(0.5)) a[k] = -a[k];
  }
  return a;
}

TEST(Exponential, IsAccurate) {
  RandomNumbers random(1);
  for (const auto& a :
       {Array(20003, random, -708.0, 709.0), Array(20003, random, -1.0, 1.0), wide(20003, -1074, 9, random)}) {
    const Array computed = exponentials(a);
    for (int k = 0; k < a.size(); ++k) {
      if (a[k] < -708.0 || a[k] > 709.0) continue;
      ASSERT_LE(distance_in_ulp(computed[k], std::exp(static_cast<long double>(a[k]))), 2.0) << "at " << a[k];
    }
  }
}

TEST(Exponential, OfSpecialNumbers) {
  Array a(11);
  const double special[] = {0.0, -0.0, 1.0, -708.0, -708.1, -1e4, -1e300, -infinity, 709.0, not_a_number, 5e-324};
  std::copy(std::begin(special), std::end(special), static_cast<double*>(a));
  const Array computed = exponentials(a);
  EXPECT_EQ(computed[0], 1.0);
  EXPECT_EQ(computed[1], 1.0);
  EXPECT_DOUBLE_EQ(computed[2], std::exp(1.0));
  EXPECT_DOUBLE_EQ(computed[3], std::exp(-708.0));
  for (int k = 4; k < 8; ++k) EXPECT_EQ(computed[k], 0.0) << a[k];  // what is nearly zero is zero
  EXPECT_DOUBLE_EQ(computed[8], std::exp(709.0));
  EXPECT_TRUE(std::isnan(computed[9]));
  EXPECT_EQ(computed[10], 1.0);
}

TEST(ScaledTanh, IsAccurate) {
  RandomNumbers random(2);
  for (const auto& a :
       {Array(20003, random, -30.0, 30.0), Array(20003, random, -1.0, 1.0), wide(20003, -1060, 12, random)}) {
    const Array computed = tanhs(a);
    for (int k = 0; k < a.size(); ++k) {
      ASSERT_LE(distance_in_ulp(computed[k], std::tanh(static_cast<long double>(a[k]))), 3.0) << "at " << a[k];
    }
  }
}

TEST(ScaledTanh, OfSpecialNumbers) {
  Array a(9);
  const double special[] = {0.0, -0.0, 22.0, -22.0, infinity, -infinity, 1e300, not_a_number, -1e-300};
  std::copy(std::begin(special), std::end(special), static_cast<double*>(a));
  const Array computed = tanhs(a);
  EXPECT_EQ(computed[0], 0.0);
  EXPECT_TRUE(computed[1] == 0.0 && std::signbit(computed[1]));
  for (int k = 2; k < 7; ++k) EXPECT_EQ(computed[k], std::signbit(a[k]) ? -1.0 : 1.0) << a[k];
  EXPECT_TRUE(std::isnan(computed[7]));
  EXPECT_EQ(computed[8], -1e-300);
}

TEST(ScaledTanh, ScalesItsArgumentAndItsValue) {
  RandomNumbers random(3);
  for (const int n : sizes) {
    const Array a(n, random), amplitude(n, random), sharpness(n, random);
    const Array computed = on_every_level([&](const Kernels& kernel) {
      Array out(a);  // in place
      kernel.scaled_tanh(n, amplitude, sharpness, out, out);
      return out;
    });
    for (int k = 0; k < n; ++k) EXPECT_NEAR(computed[k], amplitude[k] * std::tanh(sharpness[k] * a[k]), 1e-14);
  }
}

TEST(Sinusoid, IsAccurate) {
  RandomNumbers random(4);
  for (const auto& a :
       {Array(20003, random, -1e5, 1e5), Array(20003, random, -7.0, 7.0), wide(20003, -1060, 16, random)}) {
    const Array computed = sines(a);
    for (int k = 0; k < a.size(); ++k) {
      ASSERT_LE(distance_in_ulp(computed[k], std::sin(static_cast<long double>(a[k]))), 2.0) << "at " << a[k];
    }
  }
}

TEST(Sinusoid, IsAccurateNearItsZeros) {
  constexpr long double half_pi = 1.570796326794896619231321691639751442L;
  Array a(63600);  // the numbers nearest to the multiples of pi / 2 below 1e5
  for (int k = 0; k < a.size(); ++k) a[k] = static_cast<double>((k + 1) * half_pi);
  const Array computed = sines(a);
  for (int k = 0; k < a.size(); ++k) {
    ASSERT_LE(distance_in_ulp(computed[k], std::sin(static_cast<long double>(a[k]))), 2.0) << "at " << a[k];
  }
}

TEST(Sinusoid, OfSpecialNumbers) {
  Array a(6);
  const double special[] = {0.0, 1e5, -1e22, infinity, not_a_number, 0.5};
  std::copy(std::begin(special), std::end(special), static_cast<double*>(a));
  const Array computed = sines(a);
  EXPECT_EQ(computed[0], 0.0);
  EXPECT_DOUBLE_EQ(computed[1], std::sin(1e5));
  EXPECT_DOUBLE_EQ(computed[2], std::sin(-1e22));
  EXPECT_TRUE(std::isnan(computed[3]));
  EXPECT_TRUE(std::isnan(computed[4]));
  EXPECT_DOUBLE_EQ(computed[5], std::sin(0.5));
  Array alone(1, not_a_number);
  EXPECT_TRUE(std::isnan(sines(alone)[0]));
}

TEST(Sinusoid, IsTheDisturbanceFormula) {
  RandomNumbers random(5);
  for (const int n : sizes) {
    const Array amplitude(n, random), frequency(n, random), phase(n, random), bias(n, random);
    const Array computed = on_every_level([&](const Kernels& kernel) {
      Array d(n);
      kernel.sinusoid(n, 3.7, amplitude, frequency, phase, bias, d);
      return d;
    });
    for (int k = 0; k < n; ++k) {
      EXPECT_NEAR(computed[k], bias[k] + amplitude[k] * std::sin(frequency[k] * 3.7 + phase[k]), 2e-15);
    }
  }
}

// --- sums ---

TEST(Sums, AreThoseOfTheirFormulas) {
  RandomNumbers random(6);
  for (const int n : sizes) {
    const Array a(n, random);
    const Array b(n, random);
    const Array computed = on_every_level([&](const Kernels& kernel) {
      Array sums(3);
      sums[0] = kernel.dot(n, a, b);
      sums[1] = kernel.weighted_square_sum(n, a, b);
      sums[2] = kernel.max_norm(n, a);
      return sums;
    });
    long double expected[3] = {};
    for (int k = 0; k < n; ++k) {
      expected[0] += static_cast<long double>(a[k]) * b[k];
      expected[1] += std::pow(static_cast<long double>(a[k]) * b[k], 2);
      expected[2] = std::max<long double>(expected[2], std::abs(a[k]));
    }
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(computed[k], static_cast<double>(expected[k]), 1e-15 * n * 4.0) << k;
  }
}

TEST(Sums, PassOnWhatIsNotANumber) {
  for (const int n : sizes) {
    const Array ones(n, 1.0);
    for (int where = 0; where < n; where += 3) {
      Array a(n, 1.0);
      a[where] = not_a_number;
      const Array computed = on_every_level([&](const Kernels& kernel) {
        Array sums(2);
        sums[0] = kernel.dot(n, a, ones);
        sums[1] = kernel.weighted_square_sum(n, ones, a);
        for (int k = 0; k < 2; ++k) sums[k] = std::isnan(sums[k]) ? 1.0 : 0.0;
        return sums;
      });
      for (int k = 0; k < 2; ++k) EXPECT_EQ(computed[k], 1.0) << k;
    }
  }
}

// --- closed loop ---

struct Size {
  int players, dimension, neurons;
};
const std::vector<Size> loop_sizes{{2, 1, 1}, {3, 2, 5}, {5, 2, 11}, {4, 3, 7}, {7, 1, 3}, {9, 4, 13}};

TEST(Activations, AreGaussians) {
  RandomNumbers random(7);
  std::vector<Size> with_one_row = loop_sizes;
  with_one_row.push_back({1, 2, 11});
  for (const Size& size : with_one_row) {
    // no structured binding: Clang lets lambdas have none
    const int players = size.players, dimension = size.dimension, neurons = size.neurons;
    const int n = players * dimension;
    const Array y(players * n, random);
    const Array numbers(neurons * players, random);
    const Array vectors(neurons * n * players, random), sharpness(players, random, 0.05, 0.3);
    for (const int owners : {0, 1, players}) {  // 0: centres that are numbers
      const Array computed = on_every_level([&](const Kernels& kernel) {
        Array exponent(players * (neurons + 2) + 8);
        Array activation(neurons * n);
        if (owners == 0) {
          kernel.activations_diagonal(players, n, dimension, neurons, numbers, sharpness, y, exponent, activation);
        } else {
          kernel.activations_general(players, n, dimension, neurons, owners, vectors, sharpness, y, exponent,
                                     activation);
        }
        return activation;
      });
      for (int m = 0; m < neurons; ++m) {
        for (int i = 0; i < players; ++i) {
          double squares = 0.0;
          const int row = owners == 1 ? m : m * owners + i;
          for (int k = 0; k < n; ++k) {
            squares += std::pow(y[i * n + k] - (owners == 0 ? numbers[m * players + i] : vectors[row * n + k]), 2);
          }
          const double expected = std::exp(-squares * sharpness[i]);
          for (int l = 0; l < dimension; ++l) {
            EXPECT_NEAR(computed[m * n + l * players + i], expected, 1e-13 * expected);
          }
        }
      }
    }
  }
}

TEST(Activations, FarFromEveryCenterAreZero) {
  for (const double far : {1e3, 1e100, 1e150, 1e160}) {
    const Array y(8, far);  // two players, two dimensions
    const Array centers(2, 1.0), sharpness(2, 1.0);
    const Array center_vectors(4, 1.0);
    for (const bool diagonal : {true, false}) {
      const Array computed = on_every_level([&](const Kernels& kernel) {
        Array exponent(2 * 3 + 8);
        Array activation(4, 9.0);
        if (diagonal) {
          kernel.activations_diagonal(2, 4, 2, 1, centers, sharpness, y, exponent, activation);
        } else {
          kernel.activations_general(2, 4, 2, 1, 1, center_vectors, sharpness, y, exponent, activation);
        }
        return activation;
      });
      EXPECT_EQ(computed, Array(4, 0.0)) << far;
    }
  }
}

/// A ring with chords, of random weights, as compressed rows.
struct Ring {
  std::vector<int> start{0};
  std::vector<int> neighbour;
  std::vector<double> weight;
  std::vector<double> dense;  // [i N + j]

  Ring(int players, RandomNumbers& random) : dense(static_cast<std::size_t>(players * players)) {
    const auto at_entry = [&](int i, int j) -> double& { return dense[static_cast<std::size_t>(i * players + j)]; };
    for (int i = 0; i < players; ++i) {
      for (const int step : {1, 3}) {
        const int j = (i + step) % players;
        if (j != i) at_entry(i, j) = at_entry(j, i) = random.between(0.5, 2.0);
      }
    }
    for (int i = 0; i < players; ++i) {
      for (int j = 0; j < players; ++j) {
        if (at_entry(i, j) == 0.0) continue;
        neighbour.push_back(j);
        weight.push_back(at_entry(i, j));
      }
      start.push_back(static_cast<int>(neighbour.size()));
    }
  }
  [[nodiscard]] NeighbourRows rows() const { return {start.data(), neighbour.data(), weight.data()}; }
};

TEST(EstimateRates, AreTheConsensusLaw) {
  RandomNumbers random(8);
  for (const Size& size : loop_sizes) {
    const int players = size.players, dimension = size.dimension;
    const int n = players * dimension;
    const Ring ring(players, random);
    const Array y(players * n, random);
    const Array xbar(n, random), k3(players, random);
    const Array computed = on_every_level([&](const Kernels& kernel) {
      Array rate(players * n, 9.0);
      kernel.estimate_rates(players, players, dimension, ring.rows(), ring.rows(), k3, y, xbar, rate);
      return rate;
    });
    for (int i = 0; i < players; ++i) {
      for (int p = 0; p < n; ++p) {
        double expected = 0.0;
        for (int k = 0; k < players; ++k) {
          expected += ring.dense[static_cast<std::size_t>(i * players + k)] * (y[i * n + p] - y[k * n + p]);
        }
        expected += ring.dense[static_cast<std::size_t>(i * players + p % players)] * (y[i * n + p] - xbar[p]);
        EXPECT_NEAR(computed[i * n + p], -k3[i] * expected, 1e-12);
      }
    }
  }
}

TEST(Columns, FollowTheirFormulas) {
  RandomNumbers random(9);
  for (const int n : sizes) {
    constexpr int rows = 6;
    const Array S(rows * n, random), w(rows * n, random);
    const Array e(n, random), r(n, random), scale(n, random), beta(n, random), onto_weight(n, random);

    const Array products = on_every_level([&](const Kernels& kernel) {
      Array sum(n, 9.0);
      kernel.column_products(n, rows, w, S, sum);
      return sum;
    });
    const Array largest = on_every_level([&](const Kernels& kernel) {
      Array found(n, 9.0);
      kernel.largest_products(n, rows, w, S, found);
      return found;
    });
    const Array rates = on_every_level([&](const Kernels& kernel) {
      Array rate(rows * n);
      kernel.weight_rates(n, rows, beta, e, r, S, w, rate);
      return rate;
    });
    const Array corrected = on_every_level([&](const Kernels& kernel) {
      Array rhs(S);
      kernel.weight_corrections(n, rows, scale, e, onto_weight, S, w, rhs);
      return rhs;
    });
    for (int p = 0; p < n; ++p) {
      double product = 0.0, greatest = 0.0;
      for (int m = 0; m < rows; ++m) {
        const int k = m * n + p;
        product += w[k] * S[k];
        greatest = std::max(greatest, w[k] * S[k]);
        EXPECT_NEAR(rates[k], beta[p] * e[p] * (S[k] - r[p] * w[k]), 1e-12);
        EXPECT_NEAR(corrected[k], scale[p] * S[k] + e[p] * S[k] + onto_weight[p] * w[k], 1e-14);
      }
      EXPECT_NEAR(products[p], product, 1e-14);
      EXPECT_EQ(largest[p], greatest);
    }
  }
}

TEST(SharedSignal, IsAddedToTheEstimateOfItsPlayer) {
  RandomNumbers random(10);
  for (const Size& size : loop_sizes) {
    const int players = size.players, dimension = size.dimension;
    const int n = players * dimension;
    const Array gain(players * players, random), shared(n, random), y(players * n, random);
    const Array computed = on_every_level([&](const Kernels& kernel) {
      Array out(y);
      kernel.add_shared_signal(players, players, dimension, gain, shared, out);
      return out;
    });
    for (int i = 0; i < players; ++i) {
      for (int p = 0; p < n; ++p) {
        EXPECT_NEAR(computed[i * n + p], y[i * n + p] + gain[i * players + p % players] * shared[p], 1e-14);
      }
    }
  }
}

// --- Newton solver ---

/// Blocks with a full pattern, eliminated in reversed order of players; the first columns are listed all the same.
struct FullPattern {
  BlockElimination elimination;
  std::vector<int> player, target;

  FullPattern(int n, int listed) {
    elimination.listed = listed;
    elimination.start.push_back(0);
    for (int k = 0; k < n; ++k) elimination.order.push_back(n - 1 - k);
    for (int k = 0; k < listed; ++k) {
      for (int i = k + 1; i < n; ++i) {
        elimination.row.push_back(i);
        player.push_back(n - 1 - i);
      }
      elimination.start.push_back(static_cast<int>(elimination.row.size()));
    }
    target = elimination.targets();
  }
  /// Of row i and column k < i.
  [[nodiscard]] int entry(int i, int k) const {
    if (k >= elimination.listed) return elimination.full_entry(i, k);
    return elimination.start[static_cast<std::size_t>(k)] + i - k - 1;
  }
  [[nodiscard]] int entries() const { return elimination.entries(); }
  [[nodiscard]] BlockPattern pattern() const {
    return {elimination.players(),  elimination.players(),    elimination.listed, elimination.start.data(),
            elimination.row.data(), elimination.order.data(), player.data(),      target.data()};
  }
};

void check_blocks(int n, int listed, int width, bool directed, RandomNumbers& random) {
  const FullPattern full(n, listed);
  const int tiles = (n + tile_length - 1) / tile_length;
  const auto place = [](int number, int of, int j) {
    return (j / tile_length * of + number) * tile_length + j % tile_length;
  };
  // in elimination order, diagonally dominant
  const Array lower(tiles * full.entries() * tile_length, random, -1.0, 1.0);
  const Array other(tiles * full.entries() * tile_length, random, -1.0, 1.0);
  const Array& upper = directed ? other : lower;
  const Array diagonal(tiles * n * tile_length, random, 2.0 * n, 3.0 * n);
  const Array rhs(n * width * n, random);
  const Array solution = on_every_level([&](const Kernels& kernel) {
    Array l(lower), u(upper), d(diagonal), x(rhs);
    for (int tile = 0; tile < tiles; ++tile) {
      const int entries = tile * full.entries() * tile_length;
      if (directed) {
        kernel.factor_directed_blocks(full.pattern(), l + entries, u + entries, d + tile * n * tile_length);
      } else {
        kernel.factor_blocks(full.pattern(), l + entries, d + tile * n * tile_length);
      }
    }
    if (directed) {
      kernel.solve_directed_blocks(full.pattern(), width, l, u, d, x);
    } else {
      kernel.solve_blocks(full.pattern(), width, l, d, x);
    }
    return x;
  });
  const auto of_player = [&](const Array& rows, int k, int h, int j) {  // unknown eliminated k-th
    return rows[full.elimination.order[static_cast<std::size_t>(k)] * width * n + h * n + j];
  };
  for (int j = 0; j < n; ++j) {
    for (int h = 0; h < width; ++h) {
      for (int i = 0; i < n; ++i) {
        double sum = diagonal[place(i, n, j)] * of_player(solution, i, h, j);
        for (int k = 0; k < n; ++k) {
          if (k == i) continue;
          const int entry = full.entry(std::max(i, k), std::min(i, k));
          sum += (k < i ? lower : upper)[place(entry, full.entries(), j)] * of_player(solution, k, h, j);
        }
        EXPECT_NEAR(sum, of_player(rhs, i, h, j), 1e-13) << n << ", " << width << ", " << directed;
      }
    }
  }
}

TEST(Blocks, AreFactoredAndSolvedSideBySide) {
  RandomNumbers random(11);
  for (const auto& [n, listed] :
       {std::pair{2, 2}, {3, 3}, {5, 1}, {8, 0}, {9, 9}, {13, 5}, {13, 1}, {20, 20}, {28, 4}}) {
    for (const int width : {1, 2, 3, -3}) {  // below zero: of a directed graph
      if (width < 0 && listed < n) continue;
      check_blocks(n, listed, std::abs(width), width < 0, random);
    }
  }
}

TEST(Blocks, AreSolvedByTheirModes) {
  RandomNumbers random(16);
  for (const Size& size : loop_sizes) {
    const int N = size.players, dimension = size.dimension;
    if (N > most_players_by_eigenvectors) continue;
    const int n = N * dimension;
    const Array vector(N * N * n, random), eigenvalue(N * n, random, 0.0, 9.0), shared(N * n, random),
        rhs(N * n, random);
    const BlockEigenvectors modes{N, N, n, vector, eigenvalue, shared};
    constexpr double gamma_k3 = 0.7;
    Array inverse(N * n);
    for (int k = 0; k < N * n; ++k) inverse[k] = 1.0 / (1.0 + gamma_k3 * eigenvalue[k]);
    const Array factors = on_every_level([&](const Kernels& kernel) {
      Array all(N * n + N * N, 9.0);
      kernel.factor_by_eigenvectors(modes, gamma_k3, all, all + N * n);
      return all;
    });
    const Array solution = on_every_level([&](const Kernels& kernel) {
      Array x(rhs);
      kernel.solve_by_eigenvectors(modes, inverse, x);
      return x;
    });
    const auto sum_of_modes = [&](int i, int p, auto coefficient) {
      double sum = 0.0;
      for (int k = 0; k < N; ++k) sum += vector[(k * N + i) * n + p] * inverse[k * n + p] * coefficient(k);
      return sum;
    };
    for (int k = 0; k < N * n; ++k) EXPECT_DOUBLE_EQ(factors[k], inverse[k]);
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) {
        const double gain = gamma_k3 * sum_of_modes(i, j, [&](int k) { return shared[k * n + j]; });
        EXPECT_NEAR(factors[N * n + i * N + j], gain, 1e-14) << N;
      }
      for (int p = 0; p < n; ++p) {
        const auto along = [&](int k) {
          double sum = 0.0;
          for (int h = 0; h < N; ++h) sum += vector[(k * N + h) * n + p] * rhs[h * n + p];
          return sum;
        };
        EXPECT_NEAR(solution[i * n + p], sum_of_modes(i, p, along), 1e-13) << N;
      }
    }
  }
}

// --- vectors ---

TEST(Vectors, LinearSumsMeetTheFormulaForAllCoefficients) {
  RandomNumbers random(13);
  for (const int n : sizes) {
    const Array x(n, random), y(n, random);
    for (const double a : {1.0, -1.0, 2.5, -2.5, 0.0}) {
      for (const double b : {1.0, -1.0, 2.5, -2.5, 0.3}) {
        const Array computed = on_every_level([&](const Kernels& kernel) {
          Array z(n, 9.0);
          kernel.linear_sum(n, a, x, b, y, z);
          return z;
        });
        for (int k = 0; k < n; ++k) EXPECT_NEAR(computed[k], a * x[k] + b * y[k], 2e-15) << a << ' ' << b;
        const Array onto_x = on_every_level([&](const Kernels& kernel) {
          Array z(x);
          kernel.linear_sum(n, a, z, b, y, z);
          return z;
        });
        const Array onto_y = on_every_level([&](const Kernels& kernel) {
          Array z(y);
          kernel.linear_sum(n, a, x, b, z, z);
          return z;
        });
        EXPECT_EQ(onto_x, computed);
        EXPECT_EQ(onto_y, computed);
      }
    }
  }
}

TEST(Vectors, EqualVectorsCancelExactly) {
  RandomNumbers random(14);
  const Array x(37, random);
  for (const double a : {1.0, -1.0, 0.1, 1.0 / 3.0}) {
    const Array computed = on_every_level([&](const Kernels& kernel) {
      Array z(37, 9.0);
      kernel.linear_sum(37, a, x, -a, x, z);
      for (int k = 0; k < 37; ++k) z[k] = std::abs(z[k]);
      return z;
    });
    EXPECT_EQ(computed, Array(37, 0.0));
  }
}

TEST(Vectors, AreScaledFilledAndWeighted) {
  RandomNumbers random(15);
  for (const int n : sizes) {
    const Array x(n, random);
    for (const double c : {1.0, -1.0, 0.3}) {
      const Array scaled = on_every_level([&](const Kernels& kernel) {
        Array z(n, 9.0);
        kernel.scale(n, c, x, z);
        return z;
      });
      const Array in_place = on_every_level([&](const Kernels& kernel) {
        Array z(x);
        kernel.scale(n, c, z, z);
        return z;
      });
      for (int k = 0; k < n; ++k) EXPECT_EQ(scaled[k], c * x[k]);
      EXPECT_EQ(in_place, scaled);
    }
    EXPECT_EQ(on_every_level([&](const Kernels& kernel) {
                Array z(n, 9.0);
                kernel.fill(n, -1.5, z);
                return z;
              }),
              Array(n, -1.5));
    const Array weights = on_every_level([&](const Kernels& kernel) {
      Array weight(n, 9.0);
      kernel.error_weights(n, 1e-3, 1e-6, x, weight);
      return weight;
    });
    for (int k = 0; k < n; ++k) EXPECT_DOUBLE_EQ(weights[k], 1.0 / (1e-3 * std::abs(x[k]) + 1e-6));
  }
}

TEST(Vectors, MakeAStepOfNewtonsIteration) {
  RandomNumbers random(17);
  for (const int n : sizes) {
    const Array f(n, random), zn1(n, random), correction(n, random), predicted(n, random), delta(n, random);
    const Array residual = on_every_level([&](const Kernels& kernel) {
      Array out(n, 9.0);
      kernel.newton_residual(n, 0.3, f, 0.7, zn1, correction, out);
      return out;
    });
    const Array moved = on_every_level([&](const Kernels& kernel) {
      Array both(2 * n, 9.0);
      for (int k = 0; k < n; ++k) both[k] = correction[k];
      kernel.add_correction(n, 0.8, delta, predicted, both, both + n);
      return both;
    });
    for (int k = 0; k < n; ++k) {
      EXPECT_NEAR(residual[k], 0.3 * f[k] - 0.7 * zn1[k] - correction[k], 1e-15);
      EXPECT_NEAR(moved[k], correction[k] + 0.8 * delta[k], 1e-15);
      EXPECT_EQ(moved[n + k], predicted[k] + moved[k]);
    }
  }
}

TEST(Vectors, AddADifference) {
  RandomNumbers random(20);
  for (const int n : sizes) {
    const Array x(n, random), y(n, random), z(n, random);
    const Array sum = on_every_level([&](const Kernels& kernel) {
      Array out(z);
      kernel.add_difference(n, -0.3, x, y, out);
      return out;
    });
    for (int k = 0; k < n; ++k) EXPECT_EQ(sum[k], z[k] + -0.3 * (x[k] - y[k]));
  }
}

TEST(Vectors, CombineTheStagesOfAStep) {
  RandomNumbers random(19);
  for (const int n : sizes) {
    for (int count = 1; count <= 5; ++count) {
      const Array a(5, random), c(5, random), state(n, random), rate(n, random), stages(5 * n, random);
      std::array<const double*, 5> stage{};
      for (int j = 0; j < 5; ++j) stage[static_cast<std::size_t>(j)] = stages + j * n;
      const Array both = on_every_level([&](const Kernels& kernel) {
        Array out(2 * n, 9.0);
        kernel.combine_stages(n, count, a, c, stage.data(), state, 0.4, rate, out, out + n);
        return out;
      });
      for (int k = 0; k < n; ++k) {
        double point = state[k];
        double rhs = 0.4 * rate[k];
        for (int j = 0; j < count; ++j) {
          point += a[j] * stages[j * n + k];
          rhs += c[j] * stages[j * n + k];
        }
        EXPECT_NEAR(both[k], point, 1e-14);
        EXPECT_NEAR(both[n + k], rhs, 1e-14);
      }
    }
  }
}

TEST(Vectors, ArePredictedByPascalsTriangle) {
  RandomNumbers random(18);
  for (const int n : sizes) {
    for (int order = 1; order <= 5; ++order) {
      const Array start((order + 1) * n, random), factor(order + 1, random);
      for (const bool scaled : {false, true}) {
        const Array predicted = on_every_level([&](const Kernels& kernel) {
          Array z(start);
          std::vector<double*> column;
          for (int j = 0; j <= order; ++j) column.push_back(z + j * n);
          kernel.predict(n, order, column.data(), scaled ? static_cast<const double*>(factor) : nullptr);
          return z;
        });
        for (int k = 0; k < n; ++k) {
          for (int j = 0; j <= order; ++j) {  // z_j + (j + 1 over j) z_{j + 1} + ...
            double expected = 0.0, binomial = 1.0;
            for (int i = j; i <= order; ++i) {
              expected += binomial * start[i * n + k] * (scaled && i > 0 ? factor[i] : 1.0);
              binomial = binomial * (i + 1) / (i + 1 - j);
            }
            EXPECT_NEAR(predicted[j * n + k], expected, 1e-13);
          }
        }
        const Array back = on_every_level([&](const Kernels& kernel) {
          Array z(predicted);
          std::vector<double*> column;
          for (int j = 0; j <= order; ++j) column.push_back(z + j * n);
          kernel.predict_back(n, order, column.data());
          return z;
        });
        for (int k = 0; k < n; ++k) {
          for (int j = 0; j <= order; ++j) {
            EXPECT_NEAR(back[j * n + k], start[j * n + k] * (scaled && j > 0 ? factor[j] : 1.0), 1e-13);
          }
        }
      }
    }
  }
}

TEST(Kernels, SumsOfActionsAreTakenTermByTerm) {
  RandomNumbers random(31);
  for (const int lanes : {8, 32}) {
    for (const int count : {1, 2, 17}) {
      const Array actions(40 * lanes, random);
      std::vector<const double*> points;
      for (int lane = 0; lane < lanes; ++lane) points.push_back(static_cast<const double*>(actions) + 40 * lane);
      std::vector<int> index;
      for (int k = 0; k < count * lanes; ++k) index.push_back(static_cast<int>(random.below(40)));
      const Array sums = on_every_level([&](const Kernels& kernel) {
        Array sum(lanes);
        kernel.sum_actions(count, lanes, points.data(), index.data(), sum);
        return sum;
      });
      for (int lane = 0; lane < lanes; ++lane) {
        double expected = 0.0;
        for (int term = 0; term < count; ++term) expected += points[at(lane)][index[at(term * lanes + lane)]];
        EXPECT_EQ(sums[lane], expected);
      }
    }
  }
}

}  // namespace
}  // namespace mixed_order_game
