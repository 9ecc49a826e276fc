"""The seeking error that the robust term allows: comparison lemma on e' = -k e - phi(e) + push."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import lambertw

FloatArray = NDArray[np.float64]

TANH_CONSTANT = float(lambertw(np.exp(-1.0)).real)
"""K of the robust term, K = exp(-(K + 1)): K exp(K) = 1 / e."""


def layer_slope(delta: FloatArray, epsilon: FloatArray) -> FloatArray:
    """K delta^2 / epsilon, in 1/s: slope of phi at e = 0, what the boundary layer adds to the gain k."""
    return np.asarray(TANH_CONSTANT * delta**2 / epsilon)


def bound_of_seeking_error(
    push: FloatArray, gain: FloatArray, delta: FloatArray | float, epsilon: FloatArray | float
) -> FloatArray:
    """E >= 0 with gain E + delta tanh(K delta E / epsilon) = push, by bisection.

    push >= 0: bound of what acts on e, in the unit of x over s; gain: k1 or k4, in 1/s, delta and epsilon of
    shapes that broadcast to that of push. |e| <= E in the long run, whatever the push does below its bound.
    """
    low, high = np.zeros_like(push), push / gain
    for _ in range(100):
        middle = 0.5 * (low + high)
        enough = gain * middle + delta * np.tanh(TANH_CONSTANT * delta * middle / epsilon) >= push
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return high
