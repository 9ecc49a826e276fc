// Random numbers that depend on a seed and a count alone, so that no state has to be kept for them.
#pragma once

#include "types.hpp"

namespace mixed_order_game {

/// Number k of the standard normal sequence with this seed; both are integers, seed from 0 to 2^53, k of magnitude
/// below 2^63.
///
/// The counter-based generator Philox4x64-10 (Salmon et al., SC 2011) with key (seed, 0) and counter (k, 0, 0, 0), k
/// modulo 2^64, gives words of 64 bits. With b the upper 52 bits of the first one, the number is the normal quantile of
/// (b + 1/2) / 2^52 by Wichura's algorithm AS 241 (PPND16), in doubles, without fused operations.
Real noise(Real seed, Real k);

}  // namespace mixed_order_game
