"""The loop of Theorem 2 whose parts talk once a period and hold in between what they heard.

Each part's own states s_a follow s_a' = M_aa s_a + sum_b M_ab s_b(k h), b over the other parts, whose states
are those at the beginning of the period: s(k h + h) = P s(k h). M is that of `linear_loop`.
"""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ..game.parameters import GameParameters
from .spectrum import linear_loop, owners

FloatArray = NDArray[np.float64]

SHORTEST, LONGEST, PERIODS = 0.1, 1e3, 60
"""Of the periods that are tried, in time constants of the fastest mode, and how many on a geometric grid."""


def period_map(game: GameParameters, groups: Sequence[Collection[int]], period: float) -> FloatArray:
    """P (n, n) for a period in s; groups of 1-based players, each player in one of them."""
    from scipy.linalg import expm

    matrix, of = linear_loop(game), owners(game)
    player = np.concatenate([of, of, np.repeat(np.arange(game.players), len(of))]) + 1
    found = np.zeros_like(matrix)
    for group in groups:
        own = np.flatnonzero(np.isin(player, list(group)))
        n = len(own)
        # expm [[A, 1], [0, 0]] h = [[e^(A h), integral of e^(A s) over a period], [0, 1]]
        both = np.zeros((2 * n, 2 * n))
        both[:n, :n], both[:n, n:] = matrix[np.ix_(own, own)], np.eye(n)
        power = expm(both * period)
        found[own] = power[:n, n:] @ matrix[own]
        found[np.ix_(own, own)] = power[:n, :n]
    return found


def longest_period(game: GameParameters, groups: Sequence[Collection[int]]) -> float:
    """Period in s below which P is stable for all periods; 0 if for none, infinite if no limit was found."""
    from scipy.optimize import brentq

    def excess(period: float) -> float:
        return float(np.abs(np.linalg.eigvals(period_map(game, groups, period))).max()) - 1.0

    fastest = float(np.abs(np.linalg.eigvals(linear_loop(game))).max())
    before = 0.0
    for period in np.geomspace(SHORTEST, LONGEST, PERIODS) / fastest:
        if excess(period) >= 0.0:
            return before if before == 0.0 else float(brentq(excess, before, period, rtol=1e-4))
        before = period
    return np.inf
