"""A sharper certificate than the paper's: one matrix inequality in four norms instead of four splits.

V = w_a/2 |xbar - x*|^2 + w_s/2 |vbar_s|^2 + w_f/2 |x_f - z_f|^2 + p |y - 1 (x) xbar|^2
    + 1/(2 beta) sum over columns of w_i |W~_il|^2,   w_i = w_f for order 1, w_s for order 2, w_a = 1.

With r = (|xbar - x*|, |vbar_s|, |x_f - z_f|, |y - 1 (x) xbar|) the derivation is the paper's, term by term,
but the cross terms stay: V' <= -r' Theta r + D epsilon (n w_f + (N - n) w_s). Theta (comparison_matrix) has
on its diagonal

    k2 m,   w_s k4,   w_f (k1 - eta_ff),   2 p (k3 lambda_min(M) - k2 max y'E B y)

and off it minus half of

    actions, velocities      1                          (xbar_s' = vbar_s - k2 grad)
    actions, tracking        w_f k2 ||h_f||             (z_f' = -k2 grad)
    actions, estimates       k2 ||2 p E h - B'||
    velocities, tracking     w_s eta_sf
    velocities, estimates    w_s (k2 k3 ||B_s M|| + eta_s) + 2 p sqrt(N)
    tracking, estimates      w_f (k2 l_f + eta_f).

Dynamics g_i(x, v) differ from g_i(x, 0) by at most nu_s |v_s| in the rows of order 2, nu_f |v_s| in those
of order 1, and |v_s| <= |vbar_s| + k2 (||h_s|| |xbar - x*| + l_s |y - 1 (x) xbar|): the diagonal has
w_s (k4 - nu_s) in place of w_s k4, and off it comes minus half of

    actions, velocities      w_s nu_s k2 ||h_s||
    actions, tracking        w_f nu_f k2 ||h_s||
    velocities, tracking     w_f nu_f
    velocities, estimates    w_s nu_s k2 l_s
    tracking, estimates      w_f nu_f k2 l_s.

The loop has the rate K_0 if Theta >= K_0 diag(1/2, w_s/2, w_f/2, p). The paper splits every cross term by a
fixed rule and sets w_s = w_f = 1, which costs what its thresholds show: here any k2 > 0 can do, k1 has only
to exceed eta_ff (nothing, without unknown dynamics), and k4* stays bounded as k3 grows, where the paper's k4*
grows with k3^2.

The weights scale the adaptive terms with their players, so that W~'S e cancels as in the paper.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from .constants import NO_DYNAMICS, DynamicsConstants, LoopConstants
from .game import Gains

FloatArray = NDArray[np.float64]

ACTIONS, VELOCITIES, TRACKING, ESTIMATES = range(4)

MARGIN = 1.25
"""Gains over their own thresholds, but for"""

K1_MARGIN = 2.0
"""k1: k4* falls as k1 rises above its own."""


ROUNDING = 1e-12
"""Relative distance that a level keeps from the largest one, so that rounding carries no ball across it."""

LARGEST = 1e300
"""Stands for infinity in searches, which subtract what they compare."""


@dataclass(frozen=True)
class Weights:
    """Weights of V beside w_a = 1. velocities in s^2, the others dimensionless."""

    velocities: float  # w_s
    tracking: float  # w_f
    estimates: float  # p


@dataclass(frozen=True, eq=False)
class Certificate:
    """Weights and the rate K_0 in 1/s that they prove; K_0 <= 0 proves nothing."""

    constants: LoopConstants
    weights: Weights
    rate: float

    def ultimate_level(self, gains: Gains, optimal_weight_norm: float | None = None) -> float:
        """lim sup of V: D epsilon w / K_0 + D w (sqrt(W_max) + |W*|)^2 / (2 beta), w = n w_f + (N - n) w_s.

        optimal_weight_norm: largest |W*_il|, by default the sqrt(W_max) that Theorem 1 allows. Adding
        K_0 / (2 beta) times w_i ((sqrt(W_max) + |W*|)^2 - |W~_il|^2) >= 0 for every column to V' turns the
        missing V_5 into -K_0 V_5. Infinite if nothing is proved.
        """
        if self.rate <= 0.0:
            return math.inf
        D = self.constants.dimension
        total = D * self.total_weight
        root = math.sqrt(gains.W_max)
        spread = (root + (root if optimal_weight_norm is None else optimal_weight_norm)) ** 2
        return total * gains.epsilon / self.rate + total * spread / (2.0 * gains.beta)

    @property
    def total_weight(self) -> float:
        """n w_f + (N - n) w_s."""
        c = self.constants
        return c.first_players * self.weights.tracking + c.second_players * self.weights.velocities

    def action_radius(self, level: float) -> float:
        """Largest |x - x*| with V <= level: sqrt(2 level (1 + 1/w_f)), or sqrt(2 level) without order 1."""
        spread = 1.0 + (1.0 / self.weights.tracking if self.constants.first_players else 0.0)
        return math.sqrt(2.0 * level * spread)

    def estimate_radius(self, level: float) -> float:
        """Largest |y_i - x*| with V <= level: sqrt(level (2 + 1/p)), from |y_i - xbar| + |xbar - x*|."""
        return math.sqrt(level * (2.0 + 1.0 / self.weights.estimates))

    def velocity_radius(self, level: float, k2: float) -> float:
        """Largest |v_s| with V <= level, as |v_s| <= |vbar_s| + k2 |[grad_i f_i(y_i)]_s|."""
        c = self.constants
        if not c.second_players:
            return 0.0
        squares = 2.0 * (k2 * c.second_rows_norm) ** 2 + 2.0 / self.weights.velocities
        return math.sqrt(level * (squares + (k2 * c.hessian_norm) ** 2 / self.weights.estimates))

    def level_within(self, reach: float, *, tracking: bool = True) -> float:
        """Largest level whose set has |xbar - x*|, |y_i - x*| and, with tracking, |x - x*| at most reach."""
        radii = [math.sqrt(2.0), self.estimate_radius(1.0)]
        largest = max(*radii, self.action_radius(1.0) if tracking else 0.0)
        return (reach / largest) ** 2 * (1.0 - ROUNDING)


def comparison_matrix(
    c: LoopConstants, g: DynamicsConstants, gains: Gains, weights: Weights, *, tracking: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Theta and diag(1/2, w_s/2, w_f/2, p) as a vector, without the rows of groups that have no player.

    Order: actions, velocities, tracking, estimates. Theta in 1/s. tracking = False leaves x_f - z_f out too.
    """
    k1, k2, k3, k4 = gains.k1, gains.k2, gains.k3, gains.k4
    w_s, w_f, p = weights.velocities, weights.tracking, weights.estimates
    theta = np.zeros((4, 4))
    nu_s, nu_f = w_s * g.second_velocities, w_f * g.first_velocities
    actions_speed, estimates_speed = k2 * c.second_rows_norm, k2 * c.hessian_norm
    theta[ACTIONS, VELOCITIES] = 1.0 + nu_s * actions_speed
    theta[ACTIONS, TRACKING] = w_f * k2 * c.first_rows_norm + nu_f * actions_speed
    theta[ACTIONS, ESTIMATES] = k2 * c.estimate_coupling(p)
    theta[VELOCITIES, TRACKING] = w_s * g.second_tracking + nu_f
    theta[VELOCITIES, ESTIMATES] = (
        w_s * (k2 * k3 * c.exact_b + g.second_estimates)
        + 2.0 * p * math.sqrt(c.players)
        + nu_s * estimates_speed
    )
    theta[TRACKING, ESTIMATES] = w_f * (k2 * c.first_lipschitz + g.first_estimates) + nu_f * estimates_speed
    theta = -0.5 * (theta + theta.T)
    theta[ACTIONS, ACTIONS] = k2 * c.monotonicity
    theta[VELOCITIES, VELOCITIES] = w_s * (k4 - g.second_velocities)
    theta[TRACKING, TRACKING] = w_f * (k1 - g.first_tracking)
    theta[ESTIMATES, ESTIMATES] = 2.0 * p * (k3 * c.slowest_consensus - k2 * c.estimate_pull)
    present = [ACTIONS, *_groups(c, tracking=tracking), ESTIMATES]
    scale = np.array([0.5, 0.5 * w_s, 0.5 * w_f, p])
    return theta[np.ix_(present, present)], scale[present]


def proved_rate(
    c: LoopConstants, g: DynamicsConstants, gains: Gains, weights: Weights, *, tracking: bool = True
) -> float:
    """K_0 in 1/s, the largest with Theta >= K_0 diag(1/2, w_s/2, w_f/2, p); negative if nothing is proved."""
    theta, scale = comparison_matrix(c, g, gains, weights, tracking=tracking)
    if not np.all(np.isfinite(theta)):
        return -math.inf
    root = np.sqrt(scale)
    return float(np.linalg.eigvalsh(theta / np.outer(root, root))[0])


def best_certificate(
    c: LoopConstants, g: DynamicsConstants, gains: Gains, *, tracking: bool = True
) -> Certificate:
    """The weights that prove the largest rate for given gains.

    The rate is quasi-concave in the weights (Theta and its bound are linear in them but for one convex
    norm), so a simplex search in their logarithms from the start of `sufficient_gains` finds its maximum
    closely; any weights found prove their rate. w_f stays between e^-4 and e^4: |x_f - z_f| is bounded
    through it.
    """
    start = _starting_weights(c, gains)

    def unpacked(logs: FloatArray) -> Weights:
        return Weights(*np.exp(np.clip(logs, [-60.0, -4.0, -60.0], [60.0, 4.0, 60.0])).tolist())

    def loss(logs: FloatArray) -> float:
        rate = proved_rate(c, g, gains, unpacked(logs), tracking=tracking)
        return -rate if math.isfinite(rate) else LARGEST

    logs = np.log([start.velocities, start.tracking, start.estimates])
    for _ in range(2):
        logs = minimize(loss, logs, method="Nelder-Mead", options={"maxiter": 300, "xatol": 1e-4}).x
    weights = unpacked(logs)
    return Certificate(c, weights, proved_rate(c, g, gains, weights, tracking=tracking))


@dataclass(frozen=True)
class SufficientGains:
    """Thresholds for k3, k1 and k4 in 1/s that prove a rate for a given k2, and the weights that do it."""

    k1: float
    k3: float
    k4: float
    weights: Weights


def sufficient_gains(
    c: LoopConstants,
    g: DynamicsConstants,
    k2: float,
    *,
    rate: float = 0.0,
    margin: float = MARGIN,
    tracking: bool = True,
    estimates_weight: float | None = None,
    given: Gains | None = None,
) -> SufficientGains:
    """Thresholds by Schur complements, in the paper's order k2, k3, k1, k4.

    Each threshold makes one more leading block of Theta - rate diag(...) positive definite:

        k3 > (k2 max y'E B y + rate/2 + k2^2 c^2 / (8 p A)) / lambda_min(M)
        k1 > eta_ff + rate/2 + w_f c_f' [block of actions and estimates]^-1 c_f / 4
        k4 > rate/2 + c_s' [block of actions, tracking and estimates]^-1 c_s / (4 w_s)

    with A = k2 m - rate/2, c = ||2 p E h - B'||, c_f = (k2 ||h_f||, k2 l_f + eta_f), c_s the velocities' row.
    p minimizes k3*, w_s minimizes k4*; an estimates_weight given is the p of k1* and k4*. These two are for
    k3 at `margin` times its threshold and, k4*, for k1 at K1_MARGIN times its own; for the k3 and k1 of
    `given` instead where these exceed their thresholds. rate must be below 2 k2 m.
    Infinite thresholds where nothing can be proved (not strongly monotone, not connected).
    """
    A = k2 * c.monotonicity - 0.5 * rate
    if A <= 0.0 or c.slowest_consensus <= 0.0:
        return SufficientGains(math.inf, math.inf, math.inf, Weights(1.0, 1.0, 1.0))

    def k3_for(log_p: float) -> float:
        p = math.exp(log_p)
        return k2**2 * c.estimate_coupling(p) ** 2 / (8.0 * p * A)

    found = minimize_scalar(k3_for, bounds=(-25.0, 10.0), method="bounded", options={"xatol": 1e-10})
    p = math.exp(float(found.x)) if estimates_weight is None else estimates_weight
    k3 = (k2 * c.estimate_pull + 0.5 * rate + k3_for(float(found.x))) / c.slowest_consensus
    own_k3 = given.k3 if given is not None and given.k3 > k3 else margin * k3

    def shifted(k1: float, k4: float, w_s: float) -> FloatArray:
        gains = Gains(k1, k2, own_k3, k4, 1.0, 1.0, 1.0, 1.0)
        theta, scale = comparison_matrix(c, g, gains, Weights(w_s, 1.0, p), tracking=tracking)
        return theta - rate * np.diag(scale)

    groups = _groups(c, tracking=tracking)
    k1 = 0.0
    if TRACKING in groups:
        zero_gain = shifted(0.0, 0.0, 1.0)
        k1 = max(0.0, _schur(zero_gain, 1 + groups.index(TRACKING), (0, len(groups) + 1)))
    k4, w_s = 0.0, 1.0
    if VELOCITIES in groups:
        others = [index for index in range(len(groups) + 2) if index != 1]
        own_k1 = K1_MARGIN * k1 if k1 > 0.0 else 1e-3 * k2
        if given is not None and given.k1 > k1:
            own_k1 = given.k1

        def k4_for(log_w: float) -> float:
            w = math.exp(log_w)
            return min(_schur(shifted(own_k1, 0.0, w), 1, others) / w, LARGEST)

        best = minimize_scalar(k4_for, bounds=(-60.0, 20.0), method="bounded", options={"xatol": 1e-10})
        w_s, k4 = math.exp(float(best.x)), max(0.0, k4_for(float(best.x)))
        k4 = k4 if k4 < LARGEST else math.inf
    return SufficientGains(k1, k3, k4, Weights(w_s, 1.0, p))


def _schur(matrix: FloatArray, row: int, others: "list[int] | tuple[int, ...]") -> float:
    """What must be added to a diagonal entry to make [row, others] singular: r' B^-1 r minus the entry.

    Infinite if the block B of the others is not positive definite.
    """
    if not np.all(np.isfinite(matrix)):
        return math.inf
    block = matrix[np.ix_(others, others)]
    if np.linalg.eigvalsh(block)[0] <= 0.0:
        return math.inf
    r = matrix[row, list(others)]
    return float(r @ np.linalg.solve(block, r) - matrix[row, row])


def _starting_weights(c: LoopConstants, gains: Gains) -> Weights:
    """p that minimizes the estimates' threshold, w_s that balances the two parts of their coupling."""
    p = max(c.largest_lipschitz, 1e-12) / (2.0 * math.sqrt(c.players) * max(c.pseudo_gradient_norm, 1e-12))
    coupling = gains.k2 * gains.k3 * c.exact_b
    w_s = 2.0 * p * math.sqrt(c.players) / coupling if coupling > 0.0 else 1.0
    return Weights(w_s, 1.0, p)


def _groups(c: LoopConstants, *, tracking: bool) -> list[int]:
    """Indices of the groups of players that exist."""
    return [VELOCITIES] * (c.second_players > 0) + [TRACKING] * (tracking and c.first_players > 0)


def theorem_2_thresholds(
    c: LoopConstants, k2: float, *, margin: float = MARGIN, given: Gains | None = None
) -> SufficientGains:
    """Thresholds without unknown dynamics at rate 0, k4* for k3 at `margin` times k3*.

    k4* is for the k3 of `given` instead where this exceeds k3*.

    p minimizes k4* here: larger than for k3* alone, and growing with k3, which keeps k4* bounded.
    k1* = 0: x_f does not feed back into z, y or v, so the loop is a cascade of the rest and of (x_f - z_f)'
    = -k1 (x_f - z_f) - z_f'. What remains is proportional to k2 (a change of the unit of time), so k2* = 0.
    """

    def thresholds_for(log_p: float) -> SufficientGains:
        p = math.exp(log_p)
        return sufficient_gains(
            c, NO_DYNAMICS, k2, margin=margin, tracking=False, estimates_weight=p, given=given
        )

    first = sufficient_gains(c, NO_DYNAMICS, k2, margin=margin, tracking=False, given=given)
    if c.second_players == 0 or not math.isfinite(first.k4):
        return first
    largest = max(margin, given.k3 / first.k3) if given is not None and first.k3 > 0.0 else margin
    start = math.log(first.weights.estimates)
    bounds = (start, start + math.log(2.0 * largest))
    best = minimize_scalar(
        lambda log_p: min(thresholds_for(log_p).k4, LARGEST), bounds=bounds, method="bounded"
    )
    found = thresholds_for(float(best.x))
    return found if found.k4 < first.k4 else first


def theorem_2_rate(c: LoopConstants, gains: Gains) -> float:
    """Rate in 1/s of |x - x*| without unknown dynamics: min{k1, K_0 / 2}, K_0 that of the loop without x_f.

    V falls with K_0 and is a sum of squares, so norms fall with K_0 / 2; x_f follows with k1. Not positive:
    nothing is proved.
    """
    rate = 0.5 * best_certificate(c, NO_DYNAMICS, gains, tracking=False).rate
    return min(gains.k1, rate) if c.first_players else rate
