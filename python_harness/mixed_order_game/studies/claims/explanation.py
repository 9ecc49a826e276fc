"""Why the neighbourhood has the size it has: a bound from what a run shows.

The comparison lemma on the loop's own equations, each term at its largest in the run's last three windows:

    e_i' = -k e_i - phi(e_i) + p_i,    p_i = g_i(x) + d_i(t) - W_i'S_i + drift of what x_i (v_i) follows,
    xbar' = -k2 P(xbar) + k2 (P(xbar) - (grad_i f_i(y_i))_i) + (e_i of order 2),
    x_i = xbar_i + (e_i of order 1).

So |e_il| <= E_il with k E + delta tanh(K delta E / epsilon) = max |p_il|, and |xbar - x*| <= (|disagreement|
+ |E of order 2|) / (k2 m) when P is strongly monotone; where k2 differs between players, each is divided by
its own k2 and the whole grows by the square root of their largest ratio. An identity of the equations: it
explains what was seen and cannot fail.
"""

import numpy as np
from numpy.typing import NDArray

from ...game.definition import has_expressions
from ...game.parameters import GameParameters
from ...theory.spectrum import gradient_map, monotonicity_constant, nash_equilibrium
from .control_bounds import at_bound
from .perturbed_run import PerturbedRun
from .seeking_error import bound_of_seeking_error

FloatArray = NDArray[np.float64]


def explain(run: PerturbedRun, game: GameParameters) -> str:
    """One sentence with the bound and what it is made of."""
    expression = has_expressions(game.expressions, "cost")
    if expression:
        return f"No bound explains the neighbourhood: {expression}, and the bound reads coefficients."
    if at_bound(run.result.u[run.judged], game).any():
        return "No bound explains the neighbourhood: a control is at u_max, where it does not follow e."
    m = monotonicity_constant(game)
    if m <= 0.0:
        return (
            f"No bound explains the neighbourhood: the pseudo-gradient is not strongly monotone, m = {m:.3g}."
        )
    push, seeking, disagreement, bound = neighbourhood_bound(run, game)
    return (
        f"Explanation, by the run's own largest values: a push of {push:.3g} against a delta of "
        f"{_range(game.of_players('delta'))} leaves seeking errors of at most {seeking:.3g}; with a "
        f"disagreement of {disagreement:.3g} between the estimated gradients and those at xbar the actions "
        f"stay within {bound:.3g} of x*."
    )


def neighbourhood_bound(run: PerturbedRun, game: GameParameters) -> tuple[float, float, float, float]:
    """Largest |p_il|, largest E_il, k2 |P(xbar) - (grad_i f_i(y_i))_i|_2, and the bound of |x_il - x*_il|.

    All over the last three windows of the run, for m > 0.
    """
    result, order_1 = run.result, game.first_order[:, np.newaxis]
    gain, k2, delta, epsilon = (
        numbers[:, np.newaxis]
        for numbers in (game.regulation, *map(game.of_players, ("k2", "delta", "epsilon")))
    )
    late = run.judged
    time, x, v = result.time[late], result.x[late], np.nan_to_num(result.v)[late]
    z = np.nan_to_num(result.z)[late]
    e = np.where(order_1, x - z, -(result.u + result.nn + result.phi)[late] / gain)
    followed = np.where(order_1, z, v - e)  # z_i, or -k2 grad_i f_i(y_i) for order 2
    drift = np.gradient(followed, time, axis=0)
    push = np.abs((run.unknown - result.nn)[late] - drift).max(axis=0)
    seeking = bound_of_seeking_error(push, gain, delta, epsilon)

    estimated = np.where(order_1, drift, v - e)  # -k2 grad_i f_i(y_i) for both orders
    offset = np.where(order_1, z, x) - nash_equilibrium(game)
    actual = k2 * np.einsum("ij,tjl->til", gradient_map(game), offset)
    disagreement = float(np.linalg.norm(actual + estimated, axis=(1, 2)).max())
    # by V = sum of |xbar_i - x*_i|^2 / (2 k2_i), which falls while |xbar - x*| m > |K2^-1 (the rest)|
    rest = float(np.linalg.norm((actual + estimated) / k2, axis=(1, 2)).max())
    second = float(np.linalg.norm(np.where(order_1, 0.0, seeking) / k2))
    first = float(np.where(order_1, seeking, 0.0).max())
    spread = float(np.sqrt(k2.max() / k2.min()))
    bound = spread * (rest + second) / monotonicity_constant(game) + first
    return float(push.max()), float(seeking.max()), disagreement, bound


def _range(numbers: FloatArray) -> str:
    """One number, or from the least to the largest."""
    low, high = float(numbers.min()), float(numbers.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
