"""Gains, delta, W_max, beta and epsilon that meet every hypothesis of Theorem 1 from a given initial state.

The theorem fixes delta and W_max before the gains, but both depend on the compact set in which g is
represented, and that set depends on the gains: vbar_s(0) = v_s(0) + k2 grad f(y(0)) grows with k2, and the
boundedness lemma's set holds W_max and delta themselves. The order that works, without the boundedness
lemma:

1. k2 and with it p (and k3), which need no constant of g;
2. the level V(0) of the initial state, the balls that hold its sublevel set, the constants of g on them;
3. W* and the residual on that set, so delta >= |eps_il| + |d_il| and W_max >= W*'W*;
4. k1 and k4 (with w_s, which may raise the level: steps 2 to 4 are repeated until it stands still);
5. beta and epsilon from the radius that is wanted.

On the sublevel set V' <= -K_0 V + c with c / K_0 <= V(0) <= level, so no trajectory leaves it: one
invariant set serves both the bound of the states and the radius.

W* = 0 is admissible in every game: then eps_i = g_i(y_i), delta carries everything and the network nothing.
Its bound of the residual is proved, not sampled, and the mirror bound of `network_fit` shows how little a
network with few centres could gain over it on a large ball, so the designs rest on W* = 0.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from . import paper_bounds
from .certificate import (
    K1_MARGIN,
    MARGIN,
    Certificate,
    Weights,
    comparison_matrix,
    proved_rate,
    sufficient_gains,
)
from .constants import DynamicsConstants, LoopConstants, dynamics_bound, dynamics_constants, loop_constants
from .domain import Domain, domain, initial_errors
from .game import AnalysedGame, Gains
from .lyapunov import scaled_identity

K3_MARGIN = 3.0
"""k3 over its threshold: more than MARGIN, because k1* and k4* fall as k3 rises above its own."""
SETTLED = 1.01
"""The guarantee's settling time ends where the transient adds 1 % to the wanted radius."""


@dataclass(frozen=True, eq=False)
class Design:
    """Gains with the set and the constants on which every hypothesis holds, and what they guarantee."""

    gains: Gains
    certificate: Certificate  # the weights are 1, 1, p for the paper's own constants
    domain: Domain
    dynamics: DynamicsConstants  # on the domain
    residual: float  # largest |eps_il| on the domain, for W* = 0
    radius: float  # lim sup |x - x*| guaranteed
    mean_radius: float  # lim sup of the root mean square of |x - x*| over time
    settling_time: float  # s, from when on the radius holds up to 1 %


def sharper_design(game: AnalysedGame, *, k2: float, radius: float, tracking_bound: float = 1e9) -> Design:
    """A design by the comparison matrix, for k2 in 1/s and a wanted lim sup of |x - x*|.

    W_max is the game's. Raises ArithmeticError with the figures if no gains below tracking_bound do.
    """
    constants = loop_constants(game.parameters)
    rate = k2 * constants.monotonicity
    gains = replace(game.gains, k2=k2)
    weights, level = Weights(0.0, 1.0, 1.0), 0.0
    for _ in range(50):
        parameters = replace(game.parameters, k2=k2)
        found = _domain(game, Certificate(constants, weights, rate), level)
        local = dynamics_constants(parameters, found.action_radius, found.estimate_radius)
        thresholds = sufficient_gains(constants, local, k2, rate=rate, margin=K3_MARGIN)
        largest = max(thresholds.k1, thresholds.k3, thresholds.k4)
        if not largest < tracking_bound:
            raise ArithmeticError(
                f"no gains found: thresholds k1 = {thresholds.k1:.3g}, k3 = {thresholds.k3:.3g},"
                f" k4 = {thresholds.k4:.3g} 1/s on the set |x - x*| <= {found.action_radius:.3g}"
            )
        gains = replace(
            gains,
            k1=max(K1_MARGIN * thresholds.k1, k2),
            k3=K3_MARGIN * thresholds.k3,
            k4=max(MARGIN * thresholds.k4, k2),
        )
        weights = thresholds.weights
        now = float(initial_errors(parameters).level(weights)[0])
        if abs(now - level) <= 1e-9 * now:
            break
        level = now
    found = domain(Certificate(constants, weights, rate), level)
    local = dynamics_constants(parameters, found.action_radius, found.estimate_radius)
    proved = proved_rate(constants, local, gains, weights)
    return _finished(game, gains, Certificate(constants, weights, proved), level, radius)


def design_within(
    game: AnalysedGame, *, k2: float, radius: float, reach: float, speed: float = math.inf
) -> Design:
    """A design by the comparison matrix on the largest sublevel set with |y - x*| <= reach, |v_s| <= speed.

    For games whose constants are those of a box; whether the set holds the initial state is not asked.
    Raises ArithmeticError if no gains do.
    """
    constants = loop_constants(game.parameters)
    local = dynamics_constants(game.parameters, reach, reach)
    thresholds = sufficient_gains(constants, local, k2, rate=k2 * constants.monotonicity, margin=K3_MARGIN)
    if not math.isfinite(max(thresholds.k1, thresholds.k3, thresholds.k4)):
        raise ArithmeticError("no gains found: the constants that the thresholds need are not all proved")
    gains = replace(
        game.gains,
        k1=max(K1_MARGIN * thresholds.k1, k2),
        k2=k2,
        k3=K3_MARGIN * thresholds.k3,
        k4=max(MARGIN * thresholds.k4, k2),
    )
    proved = proved_rate(constants, local, gains, thresholds.weights)
    certificate = Certificate(constants, thresholds.weights, proved)
    level = certificate.level_within(reach)
    fastest = certificate.velocity_radius(level, k2)
    if fastest > speed:
        level *= (speed / fastest) ** 2
    return _finished(game, gains, certificate, level, radius)


def paper_design(game: AnalysedGame, *, radius: float, factor: float = 1.1) -> Design:
    """A design by the paper's own coefficients of Theorem 1; epsilon and beta by the sharper level.

    P = p I with the p that makes k4* (k3* without players of order 2) smallest; gains `factor` times their
    thresholds. The level of V(0) takes the weights 1, so vbar_s(0) enters in full.
    """
    constants = loop_constants(game.parameters)

    def attempt(log_p: float) -> tuple[Gains, Certificate, float]:
        p = math.exp(log_p)
        weights = Weights(1.0, 1.0, p)
        gains, level = game.gains, 0.0
        for _ in range(50):
            found = _domain(game, Certificate(constants, weights, 1.0), level)
            local = dynamics_constants(game.parameters, found.action_radius, found.estimate_radius)
            c = paper_constants(game, constants, p=p, dynamics=local)
            gains = paper_bounds.gains_above(paper_bounds.theorem_1_coefficients, c, game.gains, factor)
            now = float(initial_errors(replace(game.parameters, k2=gains.k2)).level(weights)[0])
            if abs(now - level) <= 1e-9 * now:
                break
            level = now
        rate = paper_bounds.theorem_1_coefficients(c, gains).rate(c.pair)
        return gains, Certificate(constants, weights, rate), level

    last = "k4" if constants.second_players else "k3"
    best = minimize_scalar(
        lambda log_p: math.log(getattr(attempt(log_p)[0], last)), bounds=(-12.0, 2.0), method="bounded"
    )
    gains, certificate, level = attempt(float(best.x))
    return _finished(game, gains, certificate, level, radius)


def paper_constants(
    game: AnalysedGame,
    c: LoopConstants,
    *,
    p: float,
    dynamics: DynamicsConstants,
    coordinates: int | None = None,
) -> paper_bounds.PaperConstants:
    """What the paper's inequalities take, for P = p I. coordinates: D by default, 1 for the print."""
    first = c.first
    return paper_bounds.PaperConstants(
        players=c.players,
        first_players=c.first_players,
        neurons=len(game.centers),
        coordinates=c.dimension if coordinates is None else coordinates,
        monotonicity=c.monotonicity,
        lipschitz=c.largest_lipschitz,
        b=c.paper_b,
        pair=scaled_identity(c.slowest_consensus, p),
        first_dynamics=float(dynamics.lipschitz[first].max(initial=0.0)),
        second_dynamics=float(dynamics.lipschitz[~first].max(initial=0.0)),
        first_velocities=dynamics.of_velocities(first),
        second_velocities=dynamics.of_velocities(~first),
        dynamics_at_equilibrium=float(dynamics_bound(game.parameters, 0.0).max()),
        disturbance=float(game.parameters.disturbance_bound.max()),
    )


def _domain(game: AnalysedGame, certificate: Certificate, level: float) -> Domain:
    """The set of a level, at least that of the initial level with these weights."""
    start = float(initial_errors(game.parameters).level(certificate.weights)[0])
    return domain(certificate, max(level, start))


def _finished(
    game: AnalysedGame, gains: Gains, certificate: Certificate, level: float, radius: float
) -> Design:
    """delta, epsilon and beta for a certificate that holds on the set of this level."""
    constants = certificate.constants
    parameters = replace(game.parameters, k2=gains.k2)
    # lim sup V: half of it from epsilon, half from the weights (W* = 0, so |W~| <= sqrt(W_max)).
    spread = certificate.action_radius(1.0) ** 2
    wanted = min(radius**2 / spread, level)
    total = constants.dimension * certificate.total_weight
    epsilon = min(game.gains.epsilon, 0.5 * wanted * certificate.rate / total)
    left = wanted - total * epsilon / certificate.rate
    beta = max(game.gains.beta, total * gains.W_max / (2.0 * left))
    found = domain(certificate, level)
    local = dynamics_constants(parameters, found.action_radius, found.estimate_radius)
    carried = dynamics_bound(parameters, found.estimate_radius)
    delta = float((carried + parameters.disturbance_bound).max())
    gains = replace(gains, delta=max(delta, game.gains.delta), epsilon=epsilon, beta=beta)
    ultimate = certificate.ultimate_level(gains, optimal_weight_norm=0.0)
    reached = certificate.action_radius(ultimate)
    extra = (SETTLED**2 - 1.0) * ultimate
    settling = math.log(max(level / extra, 1.0)) / certificate.rate
    return Design(
        gains=gains,
        certificate=certificate,
        domain=found,
        dynamics=local,
        residual=float(carried.max()),
        radius=reached,
        mean_radius=mean_radius(certificate, local, gains),
        settling_time=settling,
    )


def mean_radius(certificate: Certificate, dynamics: DynamicsConstants, gains: Gains) -> float:
    """lim sup over T of the root mean square of |x - x*| over [0, T]: neither W_max nor beta enters.

    Integrating V' <= -r'Theta r + c, c = D epsilon (n w_f + (N - n) w_s), over [0, T] and dropping V(T) >=
    0 gives a mean of r'Theta r of at most c + V(0)/T. With |x - x*| <= u'r, u = 1 for actions and tracking,
    and (u'r)^2 <= (u'Theta^-1 u) r'Theta r, the mean of |x - x*|^2 is at most c u'Theta^-1 u in the limit.
    Theta here is the comparison matrix when the certificate's weights make it positive definite, else K_0
    diag(1/2, w_s/2, w_f/2, p), which the rate alone implies.
    """
    c = certificate.constants
    theta, scale = comparison_matrix(c, dynamics, gains, certificate.weights)
    if proved_rate(c, dynamics, gains, certificate.weights) <= 0.0:
        theta = certificate.rate * np.diag(scale)
    u = np.zeros(len(scale))
    u[0] = 1.0
    if c.first_players:
        u[-2] = 1.0
    noise = c.dimension * certificate.total_weight * gains.epsilon
    return math.sqrt(noise * float(u @ np.linalg.solve(theta, u)))
