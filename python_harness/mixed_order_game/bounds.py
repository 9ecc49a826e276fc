"""What the claims are judged against: fixed bounds for the paper's example, derived ones for other games."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import lambertw

from .model import Model
from .parameters import GameParameters
from .spectrum import consensus_rate, gradient_map, monotonicity_constant, nash_equilibrium

TANH_CONSTANT = float(lambertw(np.exp(-1.0)).real)
"""K of the robust term, K = exp(-(K + 1)): K exp(K) = 1 / e."""

SMALLEST_NEIGHBOURHOOD = 1e-5
"""Floor of derived bounds: far above the integrator's error at the tolerance of the check, 1e-8."""


@dataclass(frozen=True)
class Bounds:
    """Bounds of the claims. Lengths in the game's unit, times in s."""

    neighbourhood: float  # largest |x_il - x*_il| after settle_time
    velocity: float  # largest |v_il| after settle_time, 1/s
    consensus: float  # 2-norm of all y_ij - xbar_j after settle_time
    rejection: float  # least ratio of the errors without and with the robust part
    settle_time: float
    convergence_time: float | None  # Theorem 2: |x - x*| < 1e-6 from here on; None: by the linear loop


PAPER_BOUNDS = Bounds(
    neighbourhood=0.00125,
    velocity=0.001,
    consensus=0.00025,
    rejection=100.0,
    settle_time=16.0,
    convergence_time=3.0,
)
"""The paper's example with our gains, each a little above what two independent integrations give.

From 16 s on the largest |x - x*| is 0.00123 and the largest |v| 0.00081: the velocity is what is left of the
estimated gradient (k2 grad f) and of the seeking error e, which the robust term confines to its boundary
layer. Without the robust part the disturbances leave an error of 0.61, 500 times as much.
"""


def bounds(
    model: Model,
    game: GameParameters,
    *,
    neighbourhood: float | None = None,
    settle_time: float | None = None,
) -> Bounds:
    """Bounds for a model; neighbourhood and settle_time in place of the default ones.

    For another game than the paper's example: settle_time is 80 % of the default experiment, and

    e_il, the seeking error that the robust term leaves: k e + delta tanh(K delta e / epsilon) = P_il with
        k = k1 or k4 and P_il = |g_il(x*)| + max_t |d_il(t)|; the network is given no credit;
    neighbourhood = max e_il over order 1 + |e of order 2|_2 / (k2 m): x_i = z_i + e_i, and with agreeing
        estimates xbar' = -k2 P(xbar) + e is pulled to x* at the rate k2 m, m the constant of Assumption 3;
    velocity = max over order 2 of e_il + k2 |h_i|_1 neighbourhood: v_i = e_i - k2 grad_i f_i(y_i), h_i the
        row of the gradient map;
    consensus = sqrt(N) |xbar'|_2 / (slowest consensus rate), xbar' bounded as the velocity is;
    rejection = 1: the robust part must help.
    """
    if model.is_paper_example:
        given = {"neighbourhood": neighbourhood, "settle_time": settle_time}
        return replace(PAPER_BOUNDS, **{name: value for name, value in given.items() if value is not None})
    seeking_error = residual_seeking_error(game)
    second = ~game.first_order
    radius = neighbourhood if neighbourhood is not None else _neighbourhood(game, seeking_error)
    rows = np.abs(gradient_map(game)).sum(axis=1)[:, np.newaxis]
    rate = game.k2 * rows * radius + np.where(second[:, np.newaxis], seeking_error, 0.0)
    consensus = np.sqrt(game.players) * float(np.linalg.norm(rate)) / consensus_rate(game)
    return Bounds(
        neighbourhood=radius,
        velocity=float(rate[second].max(initial=SMALLEST_NEIGHBOURHOOD)),
        consensus=max(consensus, SMALLEST_NEIGHBOURHOOD),
        rejection=1.0,
        settle_time=0.8 * model.stop_time if settle_time is None else settle_time,
        convergence_time=None,
    )


def residual_seeking_error(game: GameParameters) -> NDArray[np.float64]:
    """e (N, D) >= 0 with k e + delta tanh(K delta e / epsilon) = |g(x*)| + max_t |d(t)|, by bisection."""
    push = np.abs(game.unknown_dynamics(nash_equilibrium(game))) + game.disturbance_bound
    gain = np.where(game.first_order, game.k1, game.k4)[:, np.newaxis]
    low, high = np.zeros_like(push), push / gain
    for _ in range(100):
        middle = 0.5 * (low + high)
        robust = game.delta * np.tanh(TANH_CONSTANT * game.delta * middle / game.epsilon)
        enough = gain * middle + robust >= push
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return high


def _neighbourhood(game: GameParameters, seeking_error: NDArray[np.float64]) -> float:
    first = game.first_order
    pulled = float(np.linalg.norm(seeking_error[~first])) / (game.k2 * monotonicity_constant(game))
    return max(float(seeking_error[first].max(initial=0.0)) + pulled, SMALLEST_NEIGHBOURHOOD)
