"""The inequalities of the paper's proofs as printed: diagonal coefficients, thresholds, rates and radii.

Every coefficient here was derived again. What was found, with D = 1 as in the paper's theory:

- The coefficients of the boundedness lemma (Psi), of Theorem 1 and of Theorem 2 (Phi) are valid bounds. The
  split k2 k3 b |y| |v| <= b/2 (k3^2 |v|^2 + k2^2 |y|^2) of Theorem 1 is Young's inequality for k3 |v| and
  k2 |y|. |[grad_i f_i(y_i)]_i - P(xbar)| <= max l_i |y - 1 (x) xbar| needs no sqrt(N), the rows act on
  different estimates. 4 N W_max - sum W~'W~ >= 0 may be added to V' with any factor c >= 0; with c = 1
  it gives -sum W~'W~ = -2 beta V_5. g_i(x) - g_i(y_i) is at most eta_i (|x_f - z_f| + |y_i - xbar|).
  H_1 multiplies y' alone, which depends on y - 1 (x) xbar and not on the rate of xbar. The robust term
  gives e (d + eps - phi) <= epsilon: tanh(K delta e / epsilon) in the lemma |eta| - eta tanh(eta / s) <= K s
  with eta = delta e, s = epsilon / K.
- Dynamics of the velocities are not the paper's; what they take from the Phi of Theorem 1 is derived in
  theory_to_code.md, by the paper's own means.
- The boundedness lemma's last step is wrong by up to sqrt(2): a_f |x_f - z_f| + a_s |v| is at most
  sqrt(2 (a_f^2 + a_s^2)) sqrt(V), not (a_f + a_s) sqrt(V); they are equal only for a_f = a_s.
- With D coordinates, N epsilon and 4 N W_max become N D epsilon and 4 N D W_max, and sqrt(n), sqrt(N - n) in
  a_f and a_s become sqrt(n D), sqrt((N - n) D): each of the N D weight columns has its own bound.

`coordinates` below is D where the sum runs over columns; 1 gives the paper's print.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from .game import Gains
from .lyapunov import LyapunovPair


@dataclass(frozen=True)
class PaperConstants:
    """What the paper's inequalities take. All of one coordinate, but `coordinates`."""

    players: int  # N
    first_players: int  # n
    neurons: int  # q
    coordinates: int  # D, or 1 for the print
    monotonicity: float  # m
    lipschitz: float  # max l_i
    b: float
    pair: LyapunovPair
    first_dynamics: float = 0.0  # max eta_i over order 1
    second_dynamics: float = 0.0  # max eta_i over order 2
    first_velocities: float = 0.0  # max nu_i over order 1
    second_velocities: float = 0.0  # max nu_i over order 2
    dynamics_at_equilibrium: float = 0.0  # g >= |g_il(x*)|
    disturbance: float = 0.0  # d >= |d_il(t)|

    @property
    def second_players(self) -> int:
        """N - n."""
        return self.players - self.first_players


@dataclass(frozen=True)
class Coefficients:
    """Factors of -|xbar - x*|^2, -|vbar_s|^2, -|x_f - z_f|^2 and -|y - 1 (x) xbar|^2 in the bound of V'."""

    actions: float
    velocities: float  # inf without players of order 2
    tracking: float  # inf without players of order 1
    estimates: float

    @property
    def smallest(self) -> float:
        """The smallest; all bounds need it positive."""
        return min(self.actions, self.velocities, self.tracking, self.estimates)

    def rate(self, pair: LyapunovPair) -> float:
        """Largest K with V' <= -K V for V_1 to V_4: min{2 c_1, 2 c_2, 2 c_3, c_4 / lambda_max(P)}, 1/s.

        The boundedness lemma takes the smaller min c / max{lambda_max(P), 1/2}.
        """
        halves = 2.0 * min(self.actions, self.velocities, self.tracking)
        return min(halves, self.estimates / pair.largest_P)


Formula = Callable[[PaperConstants, Gains], Coefficients]


def boundedness_coefficients(c: PaperConstants, gains: Gains) -> Coefficients:
    """Psi_1 to Psi_4 of the boundedness lemma (before Theorem 1)."""
    N, lipschitz, P = c.players, c.lipschitz, c.pair.largest_P
    k1, k2, k3, k4 = gains.k1, gains.k2, gains.k3, gains.k4
    eta_f = math.sqrt(c.first_players) * c.first_dynamics
    eta_s = math.sqrt(c.second_players) * c.second_dynamics
    actions = k2 * c.monotonicity - (1.0 + eta_s) / 2.0 - 1.0
    tracking = (
        k1
        - eta_f
        - (k2 * math.sqrt(N) * lipschitz + eta_f) ** 2 / 2.0
        - (k2 * lipschitz) ** 2 / 2.0
        - eta_s / 2.0
    )
    velocities = k4 - (1.0 + eta_s) / 2.0 - (2.0 * math.sqrt(N) * P + k2 * k3 * c.b) ** 2 / 2.0 - eta_s / 2.0
    estimates = (
        k3 * c.pair.smallest_Q
        - 2.0 * k2 * math.sqrt(N) * lipschitz * P
        - 1.0
        - (2.0 * k2 * N * lipschitz * P + k2 * lipschitz) ** 2 / 2.0
    )
    return _present(c, Coefficients(actions, velocities, tracking, estimates))


def theorem_1_coefficients(c: PaperConstants, gains: Gains) -> Coefficients:
    """Phi_1 to Phi_4 of Theorem 1 (robust strategy, unknown dynamics and disturbances)."""
    N, lipschitz, P = c.players, c.lipschitz, c.pair.largest_P
    k1, k2, k3, k4 = gains.k1, gains.k2, gains.k3, gains.k4
    root = math.sqrt(N)
    eta_f, eta_s = c.first_dynamics, c.second_dynamics
    eta_sf = math.sqrt(c.second_players) * eta_s
    actions = (
        k2 * c.monotonicity - 0.5 - (2.0 * N * lipschitz * P + lipschitz) ** 2 / 2.0 - root * lipschitz / 2.0
    )
    velocities = k4 - 0.5 - root * P - k3**2 * c.b / 2.0 - eta_sf / 2.0 - eta_s / 2.0
    tracking = k1 - root * lipschitz * k2**2 - math.sqrt(c.first_players) * eta_f - eta_f / 2.0 - eta_sf / 2.0
    estimates = (
        k3 * c.pair.smallest_Q
        - 2.0 * k2 * root * lipschitz * P
        - k2**2 / 2.0
        - root * P
        - k2**2 * c.b / 2.0
        - root * lipschitz / 2.0
        - eta_f / 2.0
        - eta_s / 2.0
    )
    nu_f = math.sqrt(c.first_players) * c.first_velocities
    nu_s = math.sqrt(c.second_players) * c.second_velocities
    for nu in (nu_f, nu_s):  # half a square of each of two products, where they are
        actions -= 0.5 * (nu > 0.0)
        estimates -= 0.5 * (nu > 0.0)
    through_gradients = (N + 1) * (k2 * lipschitz) ** 2 / 2.0
    velocities -= nu_s + 0.5 * (nu_f > 0.0) + through_gradients * nu_s**2
    tracking -= nu_f**2 / 2.0 + through_gradients * nu_f**2
    return _present(c, Coefficients(actions, velocities, tracking, estimates))


def theorem_2_coefficients(c: PaperConstants, gains: Gains) -> Coefficients:
    """Phi_1 to Phi_4 of Theorem 2 (no unknown dynamics, no disturbance, no robust part)."""
    N, lipschitz, P = c.players, c.lipschitz, c.pair.largest_P
    k1, k2, k3, k4 = gains.k1, gains.k2, gains.k3, gains.k4
    root = math.sqrt(N)
    actions = k2 * c.monotonicity - 2.5
    velocities = k4 - 0.5 - (k2 * k3 * c.b) ** 2 / 2.0 - root * P
    tracking = k1 - (k2 * lipschitz) ** 2 * N / 2.0 - k2 * lipschitz / 2.0
    estimates = (
        k3 * c.pair.smallest_Q
        - (k2 * lipschitz) ** 2 / 2.0
        - 0.5
        - lipschitz * k2 / 2.0
        - 2.0 * k2 * root * lipschitz * P
        - (k2 * N * lipschitz * P) ** 2
        - root * P
    )
    return _present(c, Coefficients(actions, velocities, tracking, estimates))


def _present(c: PaperConstants, coefficients: Coefficients) -> Coefficients:
    """Terms of a group without players put no condition."""
    return replace(
        coefficients,
        velocities=coefficients.velocities if c.second_players else math.inf,
        tracking=coefficients.tracking if c.first_players else math.inf,
    )


ORDER = ("k2", "k3", "k1", "k4")
"""The paper's order of choice: the thresholds of k3 and k1 depend on k2, that of k4 on k2 and k3."""


@dataclass(frozen=True)
class Thresholds:
    """k2*, then k1*(k2), k3*(k2), k4*(k2, k3), in 1/s: each coefficient is positive exactly above its own."""

    k1: float
    k2: float
    k3: float
    k4: float

    def met(self, gains: Gains) -> bool:
        """Whether every gain lies above its threshold."""
        return all(getattr(gains, name) > getattr(self, name) for name in ("k1", "k2", "k3", "k4"))


def thresholds(formula: Formula, c: PaperConstants, gains: Gains) -> Thresholds:
    """Thresholds at the given gains: k2* by itself, k1* and k3* for their k2, k4* for their k2 and k3.

    Each coefficient is linear in its own gain, with slope m, 1, 1 and lambda_min(Q), which is solved for. A
    game that is not strongly monotone or a graph that is not connected has infinite thresholds; a group
    without players has the threshold 0.
    """
    now = formula(c, gains)

    def threshold(gain: float, coefficient: float, slope: float) -> float:
        if math.isinf(coefficient) and coefficient > 0.0:
            return 0.0
        value = gain - coefficient / slope if slope > 0.0 else math.inf
        return max(0.0, value) if not math.isnan(value) else math.inf

    return Thresholds(
        k1=threshold(gains.k1, now.tracking, 1.0),
        k2=threshold(gains.k2, now.actions, c.monotonicity),
        k3=threshold(gains.k3, now.estimates, c.pair.smallest_Q),
        k4=threshold(gains.k4, now.velocities, 1.0),
    )


def thresholds_for(
    formula: Formula, c: PaperConstants, gains: Gains, factor: float
) -> tuple[Thresholds, Gains]:
    """Thresholds in the paper's order, each for the given gains before it where these exceed their own.

    A gain that does not exceed its threshold counts as `factor` > 1 times that in the ones after it. So
    gains above all thresholds returned are those for which every coefficient is positive. Also returns the
    gains that were counted.
    """
    counted = gains
    for name in ORDER:
        threshold = getattr(thresholds(formula, c, counted), name)
        if getattr(gains, name) <= threshold:
            counted = replace_gain(counted, name, factor * threshold)
    return thresholds(formula, c, counted), counted


def gains_above(formula: Formula, c: PaperConstants, gains: Gains, factor: float) -> Gains:
    """Gains `factor` > 1 times their thresholds, chosen in the paper's order k2, then k1 and k3, then k4.

    The other entries of `gains` are kept, and so is a gain whose threshold is 0.
    """
    for name in ORDER:
        threshold = getattr(thresholds(formula, c, gains), name)
        if threshold > 0.0:
            gains = replace_gain(gains, name, factor * threshold)
    return gains


def gains_for_rate(formula: Formula, c: PaperConstants, gains: Gains, rate: float) -> Gains:
    """Gains for which every coefficient is just what the rate K of V needs, in the paper's order.

    K / 2 for actions, velocities and tracking, K lambda_max(P) for estimates. The other entries are kept.
    """
    wanted = {
        "k2": ("actions", c.monotonicity, 0.5 * rate),
        "k3": ("estimates", c.pair.smallest_Q, c.pair.largest_P * rate),
        "k1": ("tracking", 1.0, 0.5 * rate),
        "k4": ("velocities", 1.0, 0.5 * rate),
    }
    floor = 1e-6
    for name, (coefficient, slope, value) in wanted.items():
        now = getattr(formula(c, gains), coefficient)
        if math.isfinite(now):
            gains = replace_gain(gains, name, max(getattr(gains, name) + (value - now) / slope, floor))
    return gains


def replace_gain(gains: Gains, name: str, value: float) -> Gains:
    """The gains with one of them changed."""
    return replace(gains, **{name: value})


def ultimate_level(c: PaperConstants, gains: Gains, coefficients: Coefficients) -> float:
    """lim sup of V in Theorem 1 as printed: (N D epsilon + 4 N D W_max) / K, K = min{rate, 2 beta}.

    Infinite if a coefficient is not positive.
    """
    rate = min(coefficients.rate(c.pair), 2.0 * gains.beta)
    columns = c.players * c.coordinates
    return columns * (gains.epsilon + 4.0 * gains.W_max) / rate if rate > 0.0 else math.inf


def sharper_ultimate_level(c: PaperConstants, gains: Gains, coefficients: Coefficients) -> float:
    """lim sup of V in Theorem 1 with the best factor: N D epsilon / K_0 + 2 N D W_max / beta.

    K_0 is the rate without 2 beta. Any multiple c >= 0 of 4 N D W_max - sum W~'W~ >= 0 may be added to V',
    which gives the level (N D epsilon + 4 c N D W_max) / min{K_0, 2 beta c}. It falls in c up to c = K_0 /
    (2 beta) and rises after it. The paper takes c = 1, so it needs large gains k for a small radius; here
    beta alone (and epsilon) make it small, with the gains k fixed just above their thresholds. Infinite if
    K_0 <= 0.
    """
    rate = coefficients.rate(c.pair)
    columns = c.players * c.coordinates
    if rate <= 0.0:
        return math.inf
    return columns * gains.epsilon / rate + 2.0 * columns * gains.W_max / gains.beta


def action_radius(level: float, *, first_players: int) -> float:
    """Largest |x - x*| with V <= level: 2 sqrt(level), or sqrt(2 level) if all players are of order 2.

    |x - x*| <= |xbar - x*| + |x_f - z_f| and both halves of the squares are in V.
    """
    return (2.0 if first_players else math.sqrt(2.0)) * math.sqrt(level)


def boundedness_level(
    c: PaperConstants, gains: Gains, coefficients: Coefficients, *, corrected: bool
) -> float:
    """Level of V above which the boundedness lemma has V decrease; infinite if a coefficient is not positive.

    With rate r = min Psi / max{lambda_max(P), 1/2}, V' <= -r V + a_f |x_f - z_f| + a_s |vbar_s|, and the
    lemma wants V' <= -r V / 2. Printed: sqrt(V) >= 2 (a_f + a_s) / r. Since |x_f - z_f|^2 + |vbar_s|^2 <= 2
    V,

        a_f |x_f - z_f| + a_s |vbar_s| <= sqrt(a_f^2 + a_s^2) sqrt(2 V),

    which is attained, so what is needed is sqrt(V) >= 2 sqrt(2 (a_f^2 + a_s^2)) / r, more than printed unless
    a_f = a_s (n = N - n). A loose point: delta in a_f and a_s can be left out, because -e phi <= 0.
    """
    size = math.sqrt(c.neurons * gains.W_max) + gains.delta + c.disturbance + c.dynamics_at_equilibrium
    a_f = math.sqrt(c.first_players * c.coordinates) * size
    a_s = math.sqrt(c.second_players * c.coordinates) * size
    rate = coefficients.smallest / max(c.pair.largest_P, 0.5)
    push = math.sqrt(2.0 * (a_f**2 + a_s**2)) if corrected else a_f + a_s
    return (2.0 * push / rate) ** 2 if rate > 0.0 else math.inf
