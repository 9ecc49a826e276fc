"""Gains for a new game: large enough for its costs and its graph, checked by the exact unperturbed loop.

The order of choice is that of the paper's theorems: k2 for the pseudo-gradient, then k1 and k3 against k2,
then k4. The theorems' own thresholds are very conservative; here a common factor grows until the linear loop
of Theorem 2 decays at half the rate of the pseudo-gradient flow x' = -k2 P(x).
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError
from ..theory.exact_loop import LARGEST_LINEAR_LOOP
from ..theory.spectrum import (
    gradient_map,
    linear_loop,
    monotonicity_constant,
    nash_equilibrium,
    spectral_abscissa,
)
from .definition import require_coefficients
from .parameters import GameParameters

FACTORS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
UNCHECKED = 4.0
"""Factor for games whose linear loop is too large to be checked."""

SAFETY = 2.0
"""Robust gain delta over the largest perturbation at the equilibrium."""


@dataclass(frozen=True)
class Choice:
    """Gains, k1 to k4 in 1/s, and what is known about them."""

    k1: float
    k2: float
    k3: float
    k4: float
    delta: float
    abscissa: float | None  # of the unperturbed loop, 1/s; None if it is too large to be checked


def choose_gains(game: GameParameters) -> Choice:
    """Gains for a game's costs, graph and perturbations; its own gains are not looked at.

    Raises GameError if no factor gives a loop that decays well, or for expressions.
    """
    require_coefficients(game.expressions, "the choice of gains")
    k2 = 1.0
    steepest = float(np.linalg.norm(gradient_map(game), 2))  # Lipschitz constant of P
    slowest = _slowest_consensus(game.adjacency)
    push = np.abs(game.unknown_dynamics(nash_equilibrium(game))) + game.disturbance_bound
    delta = _round_up(max(1.0, SAFETY * float(push.max())))
    wished = -0.5 * k2 * monotonicity_constant(game)

    def choice(factor: float) -> Choice:
        k3 = _round_up(factor * k2 * steepest / slowest)
        return Choice(10.0 * k2, k2, k3, _round_up(4.0 * factor * k2 * steepest), delta, None)

    if game.players > LARGEST_LINEAR_LOOP:
        return choice(UNCHECKED)
    for factor in FACTORS:
        found = choice(factor)
        gains = {name: getattr(found, name) for name in ("k1", "k2", "k3", "k4")}
        abscissa = spectral_abscissa(linear_loop(replace(game, **gains)))
        if abscissa <= wished:
            return replace(found, abscissa=abscissa)
    raise GameError("no gains were found that stabilise this game on this graph")


def _slowest_consensus(adjacency: NDArray[np.float64]) -> float:
    """Smallest eigenvalue of L + diag(a_.j) for the player j that is farthest from the others.

    Of a directed graph the least real part over all j.
    """
    import networkx as nx

    if not np.array_equal(adjacency, adjacency.T):
        degrees = np.diag(adjacency.sum(axis=1)) - adjacency
        blocks = degrees + np.array([np.diag(column) for column in adjacency.T])
        return float(np.linalg.eigvals(blocks).real.min())
    closeness = nx.closeness_centrality(nx.from_numpy_array(adjacency))
    j = min(closeness, key=lambda node: closeness[node])
    laplacian = np.diag(adjacency.sum(axis=1)) - adjacency
    return float(np.linalg.eigvalsh(laplacian + np.diag(adjacency[j]))[0])


def _round_up(value: float) -> float:
    """The next number of two digits: 41.3 gives 42, 413 gives 420."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit - 1e-9) * unit:.6g}")
