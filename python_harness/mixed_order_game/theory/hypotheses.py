"""The hypotheses of Theorem 1 one by one, on a given set, with the figures that decide them."""

import math
from dataclasses import dataclass

import numpy as np

from ..game.parameters import GameParameters
from .constants import LoopConstants, dynamics_bound
from .design import Design
from .domain import Domain, initial_errors
from .game import AnalysedGame, Gains
from .graph import unreached
from .network_fit import NetworkFit, mirror_bound
from .paper_bounds import ORDER, Thresholds


@dataclass(frozen=True)
class Hypothesis:
    """One condition; holds is None where the figures do not decide it."""

    name: str
    holds: bool | None
    figures: str


def standing_assumptions(game: AnalysedGame, c: LoopConstants) -> list[Hypothesis]:
    """Assumptions 1 to 5 on the whole space."""
    p = game.parameters
    squares = np.flatnonzero(np.abs(p.dynamics_square).reshape(p.players, -1).max(axis=1) > 0.0) + 1
    slopes = np.linalg.norm(p.dynamics_linear, axis=1).max()
    lipschitz = (
        f"g of player {', '.join(map(str, squares))} has a square, so no global Lipschitz constant"
        if squares.size
        else f"max eta_i = {slopes:.4g}"
    )
    return [
        Hypothesis(
            "Assumption 1: own gradients globally Lipschitz",
            holds=True,
            figures=f"max l_i = {c.largest_lipschitz:.4g}",
        ),
        connected_graph(p, c),
        Hypothesis(
            "Assumption 3: strongly monotone", holds=c.monotonicity > 0.0, figures=f"m = {c.monotonicity:.4g}"
        ),
        Hypothesis(
            "Assumption 4: Hessian rows of order 2 bounded",
            holds=True,
            figures=f"||H_1|| = {c.hessian_norm:.4g}",
        ),
        Hypothesis(
            "Assumption 5: g globally Lipschitz, d bounded", holds=not squares.size, figures=lipschitz
        ),
    ]


def connected_graph(p: GameParameters, c: LoopConstants) -> Hypothesis:
    """Assumption 2."""
    apart = [str(player + 1) for player in unreached(p.adjacency)]
    path = f"; no path from player 1 to {', '.join(apart)}" if apart else ""
    matrix = "L (x) I + A_0"
    if p.directed:
        path = "; directed, " + ("not strongly connected" if apart else "strongly connected")
        matrix = f"the symmetric part of {matrix}"
    return Hypothesis(
        "Assumption 2: undirected connected graph",
        holds=not apart and c.slowest_consensus > 0.0 and not p.directed,
        figures=f"lambda_min({matrix}) = {c.slowest_consensus:.4g}{path}",
    )


def unbounded_controls(parameters: GameParameters) -> list[Hypothesis]:
    """That no control is bounded, which fails where one is; empty for games without u_max."""
    bounded = np.flatnonzero(np.isfinite(parameters.u_max).any(axis=1)) + 1
    if not bounded.size:
        return []
    figures = f"u_max of player {', '.join(map(str, bounded))}: the rest tells of runs below it"
    return [Hypothesis("Controls without bounds", holds=False, figures=figures)]


def robust_term(game: AnalysedGame, found: Domain) -> Hypothesis:
    """delta >= |eps_il| + |d_il| while |y_i - x*| <= r.

    Holds if W* = 0 does it (bound of |g|); fails if the mirror bound forbids it for every W*.
    """
    p = game.parameters
    radius = found.estimate_radius
    enough = float((dynamics_bound(p, radius) + p.disturbance_bound).max())
    needed = mirror_bound(game, radius) + p.disturbance_bound
    player, coordinate = np.unravel_index(int(needed.argmax()), needed.shape)
    least = float(needed.max())
    holds = True if p.delta >= enough else False if p.delta < least else None
    return Hypothesis(
        "delta >= |eps_il| + |d_il|",
        holds=holds,
        figures=f"delta = {p.delta:.4g}; where |y_i - x*| <= {radius:.4g}, {enough:.4g} is enough (W* = 0)"
        f" and {least:.4g} is needed whatever W* is (player {player + 1}, coordinate {coordinate + 1})",
    )


def largest_representable_radius(game: AnalysedGame) -> float:
    """Largest r for which the mirror bound lets delta >= |eps_il| + |d_il| hold on |y_i - x*| <= r.

    The mirror bound is linear in r once r reaches the centres' hull; inf if it never forbids.
    """
    p = game.parameters
    left = p.delta - p.disturbance_bound
    if left.min() < 0.0:
        return 0.0
    near, far = mirror_bound(game, 1e6), mirror_bound(game, 2e6)
    slope = (far - near) / 1e6
    offset = near - 1e6 * slope
    with np.errstate(divide="ignore", invalid="ignore"):
        radii = np.where(slope > 0.0, (left - offset) / slope, math.inf)
    return float(radii.min())


def weight_bound(game: AnalysedGame, fit: NetworkFit | None) -> Hypothesis:
    """W*'W* <= W_max: W* = 0 always does it; the figures name the fit."""
    fitted = "" if fit is None else f"; the fitted W* has {float(fit.weight_norm2.max()):.4g}"
    return Hypothesis(
        "W*'W* <= W_max",
        holds=True,
        figures=f"W_max = {game.parameters.W_max:.4g}, W* = 0 is admissible{fitted}",
    )


def gain_thresholds(game: AnalysedGame, limits: Thresholds, counted: Gains) -> list[Hypothesis]:
    """k_i > k_i* for the four gains, thresholds for the gains counted."""
    own = game.gains
    return [
        Hypothesis(
            f"{name} > {name}*",
            holds=getattr(own, name) > getattr(limits, name),
            figures=f"{name} = {getattr(own, name):.4g}, {name}* = {getattr(limits, name):.4g} 1/s"
            + told_for(name, counted),
        )
        for name in ORDER
    ]


BOUNDED = (
    "Controls are bounded by u_max, which the theorems do not know: what follows from them is of runs in "
    "which no control comes to its bound."
)
"""Said of games with u_max before anything that a theorem or certificate tells."""


def told_for(name: str, counted: Gains) -> str:
    """The gains that a threshold is for, as " for k2 = 1"; empty for k2*."""
    before = {"k2": (), "k4": ("k2", "k3")}.get(name, ("k2",))
    told = ", ".join(f"{each} = {getattr(counted, each):.4g}" for each in before)
    return f" for {told}" if told else ""


def design_hypotheses(game: AnalysedGame, design: Design) -> list[Hypothesis]:
    """Every hypothesis on the set of a design, recomputed from its gains and its set alone."""
    designed = game.with_gains(design.gains)
    c = design.certificate.constants
    level = design.domain.level
    start = float(initial_errors(designed.parameters).level(design.certificate.weights)[0])
    ultimate = design.certificate.ultimate_level(design.gains, optimal_weight_norm=0.0)
    return [
        *unbounded_controls(game.parameters),
        *standing_assumptions(game, c)[:4],
        Hypothesis(
            "Assumption 5 on the set",
            holds=math.isfinite(design.dynamics.largest),
            figures=f"max eta_i = {design.dynamics.largest:.4g} where"
            f" |x - x*| <= {design.domain.action_radius:.4g} and"
            f" |y_i - x*| <= {design.domain.estimate_radius:.4g}",
        ),
        robust_term(designed, design.domain),
        weight_bound(designed, None),
        Hypothesis(
            "V' <= -K_0 V + c on the set",
            holds=design.certificate.rate > 0.0,
            figures=f"K_0 = {design.certificate.rate:.4g} 1/s",
        ),
        Hypothesis(
            "The set holds the initial state",
            holds=start <= level * (1.0 + 1e-9),
            figures=f"V(0) = {start:.6g}, level = {level:.6g}",
        ),
        Hypothesis(
            "The set is invariant",
            holds=ultimate <= level,
            figures=f"c / K_0 = {ultimate:.4g}, level = {level:.4g}",
        ),
    ]
