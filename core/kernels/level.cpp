// All kernels for one instruction set: compiled once for each level with MIXED_ORDER_GAME_LEVEL naming its table.
//
// Nothing from the standard library's templates may be used here: an inline function compiled with wide instructions
// could be picked by the linker for callers on every processor.
#include <math.h>

#include "kernels.hpp"

#define MIXED_ORDER_GAME_TEXT_OF(name) #name
#define MIXED_ORDER_GAME_TEXT(name) MIXED_ORDER_GAME_TEXT_OF(name)
#define MIXED_ORDER_GAME_JOIN_OF(a, b) a##b
#define MIXED_ORDER_GAME_JOIN(a, b) MIXED_ORDER_GAME_JOIN_OF(a, b)

namespace mixed_order_game {

extern const Kernels MIXED_ORDER_GAME_JOIN(kernels_, MIXED_ORDER_GAME_LEVEL);

double noise(double seed, double k);  // of expression/noise.hpp

namespace {

// clang-format off: the order matters
#include "vectors.ipp"
#include "elementary.ipp"
#include "sums.ipp"
#include "rbf_network.ipp"
#include "estimate_dynamics.ipp"
#include "adaptation.ipp"
#include "full_columns.ipp"
#include "estimate_blocks.ipp"
#include "directed_blocks.ipp"
#include "estimate_eigenvectors.ipp"
#include "vector_operations.ipp"
#include "nordsieck.ipp"
#include "tape.ipp"
// clang-format on

}  // namespace

const Kernels MIXED_ORDER_GAME_JOIN(kernels_, MIXED_ORDER_GAME_LEVEL) = {
    MIXED_ORDER_GAME_TEXT(MIXED_ORDER_GAME_LEVEL),
    exponential,
    scaled_tanh,
    sinusoid,
    activations_diagonal,
    activations_general,
    estimate_rates,
    column_products,
    largest_products,
    weight_rates,
    dot,
    run_tape,
    sum_actions,
    factor_blocks,
    solve_blocks,
    factor_directed_blocks,
    solve_directed_blocks,
    factor_by_eigenvectors,
    solve_by_eigenvectors,
    add_shared_signal,
    weight_corrections,
    linear_sum,
    scale,
    fill,
    error_weights,
    weighted_square_sum,
    max_norm,
    predict,
    predict_back,
    newton_residual,
    add_correction,
    add_difference,
    combine_stages,
};

}  // namespace mixed_order_game
