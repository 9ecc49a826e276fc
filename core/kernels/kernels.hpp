// The inner loops of the closed loop, of its Newton solver and of CVODE's vectors, as one table of functions.
//
// The same source is compiled for several x86-64 levels and the best one that the processor has is chosen when the
// library is loaded. No level contracts a * b + c, and every sum has a fixed order, so all levels give the same bits.
#pragma once

#include <cstdint>

#include "expression/operation.hpp"

namespace mixed_order_game {

/// Neighbours of each row's player with their edge weights a_ik, as compressed rows.
struct NeighbourRows {
  const int* start;
  const int* neighbour;
  const double* weight;
};

/// Pattern of the factors of all estimate blocks; see BlockElimination. The blocks' numbers lie in tiles of eight
/// blocks: entry a (or diagonal entry k) of block j at (j / 8 * entries + a) * 8 + j % 8.
struct BlockPattern {
  int players;        ///< in each block: the hosted ones
  int blocks;         ///< one for each player
  int listed;         ///< columns of L before the full ones, whose number is a multiple of full_step
  const int* start;   ///< column k < listed: entries start[k] .. start[k + 1] - 1; then those of the full columns
  const int* row;     ///< their rows, in elimination order
  const int* order;   ///< order[k] is the player eliminated k-th
  const int* player;  ///< order[row[a]] of each entry a
  const int* target;  ///< for each column the factor entries that its pairs of rows update, see factor_blocks
};
constexpr int tile_length = 8;
constexpr int full_step = 4;

/// All estimate blocks by their eigenvectors; see EstimateBlocks. Entries lie in rows of n = N D.
struct BlockEigenvectors {
  int players;  ///< in each block: the hosted ones
  int blocks;   ///< one for each player
  int n;
  const double* vector;      ///< row k * N + i: entry i of the k-th eigenvector of each block
  const double* eigenvalue;  ///< row k
  const double* shared;      ///< row k: product of the k-th eigenvectors with a_.j
};
/// More would not pay, see EstimateBlocks.
constexpr int most_players_by_eigenvectors = 8;

struct Kernels {
  const char* level;  ///< name of the instruction set

  // elementary functions: out may be the input
  void (*exponential)(int n, const double* a, double* out);
  /// out = amplitude * tanh(sharpness * a)
  void (*scaled_tanh)(int n, const double* amplitude, const double* sharpness, const double* a, double* out);
  /// d = bias + amplitude * sin(frequency * t + phase)
  void (*sinusoid)(int n, double t, const double* amplitude, const double* frequency, const double* phase,
                   const double* bias, double* d);

  // closed loop; n = N D entries in a row of estimates, one row for each of the H hosted players
  /// S_m(y_i) for centres c_m (1, ..., 1) at m * H + h: activation[m * H D + own entry], equal for every coordinate;
  /// sharpness is 1 / rho_i^2. exponent is scratch of H (q + 2) + 8 numbers.
  void (*activations_diagonal)(int rows, int n, int dimension, int neurons, const double* centers,
                               const double* sharpness, const double* y, double* exponent, double* activation);
  /// The same for centres that are vectors, `owners` of each m: centre m of row h is the row m * owners + h of n
  /// numbers, or row m of all players when there is one.
  void (*activations_general)(int rows, int n, int dimension, int neurons, int owners, const double* centers,
                              const double* sharpness, const double* y, double* exponent, double* activation);
  /// y_ij' = -k3_i (sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j)), with the k of the graph among the rows and the j
  /// that are seen among all players.
  void (*estimate_rates)(int rows, int players, int dimension, NeighbourRows graph, NeighbourRows seen,
                         const double* k3, const double* y, const double* xbar, double* rate);
  /// sum[p] = sum over m of a[m * n + p] * b[m * n + p]
  void (*column_products)(int n, int rows, const double* a, const double* b, double* sum);
  /// largest[p] = the largest a[m * n + p] * b[m * n + p] over m, at least 0
  void (*largest_products)(int n, int rows, const double* a, const double* b, double* largest);
  /// W' = beta e (S - radial W), row by row; radial[p] is 0 inside and w'S / W_max on the sphere.
  void (*weight_rates)(int n, int neurons, const double* beta, const double* e, const double* radial,
                       const double* activation, const double* weights, double* rate);
  double (*dot)(int n, const double* a, const double* b);

  /// Runs the code of a tape over rows of lanes, 1 or a multiple of 8; row k begins at rows + k * lanes. Lanes after
  /// those that are used repeat the first.
  void (*run_tape)(int count, const TapeInstruction* code, int lanes, int used, double* rows);
  /// sum[lane] = points[lane][index[lane]] + points[lane][index[lanes + lane]] + ..., count terms in this order, lanes
  /// a multiple of 8.
  void (*sum_actions)(int count, int lanes, const double* const* points, const int* index, double* sum);

  // Newton solver
  /// L D L' of the blocks of one tile, in place; the diagonal is replaced by its inverse.
  void (*factor_blocks)(BlockPattern pattern, double* lower, double* diagonal);
  /// Solves all blocks for right-hand sides of `width` coordinates, in place: rows of width * N entries.
  void (*solve_blocks)(BlockPattern pattern, int width, const double* lower, const double* inverse_diagonal,
                       double* rhs);
  /// The same for directed graphs, by L U: U has the pattern of L' and lies as L does, and no column is full.
  void (*factor_directed_blocks)(BlockPattern pattern, double* lower, double* upper, double* diagonal);
  void (*solve_directed_blocks)(BlockPattern pattern, int width, const double* lower, const double* upper,
                                const double* inverse_diagonal, double* rhs);
  /// inverse (H rows of n) = 1 / (1 + gamma k3 eigenvalue); gain[i * N + j] as in EstimateBlocks.
  void (*factor_by_eigenvectors)(BlockEigenvectors eigenvectors, double gamma_k3, double* inverse, double* gain);
  /// Solves all blocks, in place: H rows of n.
  void (*solve_by_eigenvectors)(BlockEigenvectors eigenvectors, const double* inverse, double* rhs);
  /// dy_ij = dy_ij + gain_ij dxbar_j
  void (*add_shared_signal)(int rows, int players, int dimension, const double* gain, const double* shared, double* y);
  /// rhs = scale rhs + from_error S + onto_weight W, row by row; coefficients per column.
  void (*weight_corrections)(int n, int neurons, const double* scale, const double* from_error,
                             const double* onto_weight, const double* activation, const double* weights, double* rhs);

  // vectors
  void (*linear_sum)(std::int64_t n, double a, const double* x, double b, const double* y, double* z);
  void (*scale)(std::int64_t n, double c, const double* x, double* z);
  void (*fill)(std::int64_t n, double c, double* z);
  /// 1 / (relative |y| + absolute)
  void (*error_weights)(std::int64_t n, double relative, double absolute, const double* y, double* weight);
  /// sum of (x w)^2
  double (*weighted_square_sum)(std::int64_t n, const double* x, const double* w);
  double (*max_norm)(std::int64_t n, const double* x);
  /// One step ahead by a Nordsieck array of columns z_0 .. z_order, order <= 5: z_j = factor[j] z_j for j > 0 unless
  /// factor is null, then z_{j-1} = z_{j-1} + z_j for j = order .. k, for k = 1 .. order.
  void (*predict)(std::int64_t n, int order, double* const* column, const double* factor);
  /// Takes a prediction back: z_{j-1} = z_{j-1} - z_j, in the same sequence.
  void (*predict_back)(std::int64_t n, int order, double* const* column);
  /// Negative residual of a BDF step: delta = gamma f - (rl1 zn1 + correction).
  void (*newton_residual)(std::int64_t n, double gamma, const double* f, double rl1, const double* zn1,
                          const double* correction, double* delta);
  /// correction = correction + scale delta, y = predicted + correction.
  void (*add_correction)(std::int64_t n, double scale, const double* delta, const double* predicted, double* correction,
                         double* y);
  /// z = z + a (x - y)
  void (*add_difference)(std::int64_t n, double a, const double* x, const double* y, double* z);
  /// The point state + sum_j a_j stage_j and the right-hand side b rate + sum_j c_j stage_j, for j below count, which
  /// is from 1 to 5.
  void (*combine_stages)(std::int64_t n, int count, const double* a, const double* c, const double* const* stage,
                         const double* state, double b, const double* rate, double* point, double* rhs);
};

/// The best table for this processor; constant for the life of the process.
const Kernels& kernels();

/// Every table that this processor can run, the baseline first: for tests and benchmarks.
int kernel_level_count();
const Kernels& kernels_of_level(int level);

}  // namespace mixed_order_game
