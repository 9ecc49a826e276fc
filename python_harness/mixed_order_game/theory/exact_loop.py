"""The unperturbed loop exactly (quadratic costs): stable or not, slowest rate, settling, true thresholds."""

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..game.parameters import GameParameters
from .graph import is_connected
from .spectrum import initial_deviation, linear_loop, nash_equilibrium, predicted_deviation, spectral_abscissa

FloatArray = NDArray[np.float64]

LARGEST_LINEAR_LOOP = 30
"""Most players for which the dense linear loop (2 N + N^2 states) is set up."""

BISECTED = 1e-3
"""Relative width at which the search for a gain's stability limit ends."""

SPAN = 1e3
"""A gain's stability limits are searched up to so many times its given value, and down to that part of it."""

GRID = 8
"""Values a decade of that search; a change of stability and back within one interval would be missed."""

LARGEST_SEARCH = 12
"""Most players for which gains' stability limits are searched: each takes some 60 spectra."""

SETTLED = 0.02
"""Part of the start's error that counts as settled."""


@dataclass(frozen=True)
class ExactLoop:
    """Spectrum of the loop of Theorem 2."""

    abscissa: float  # largest real part, 1/s
    settling_time: float  # s, from when on |x - x*|_2 <= 2 % of its start; inf if unstable

    @property
    def stable(self) -> bool:
        """Exponentially stable."""
        return self.abscissa < 0.0


def exact_loop(parameters: GameParameters) -> ExactLoop:
    """Eigenvalues of M and the settling time from the game's initial state by the matrix exponential.

    The time is that of the last of 4000 equally spaced samples above the bound, over a span in which the
    slowest mode falls by exp(12), longer where the rest of the state starts farther away than the actions;
    actions that start at the equilibrium settle at 0.
    """
    abscissa = _abscissa(parameters)
    if abscissa >= 0.0:
        return ExactLoop(abscissa, np.inf)
    start = float(np.linalg.norm(parameters.x0 - nash_equilibrium(parameters)))
    if start == 0.0:
        return ExactLoop(abscissa, 0.0)
    farther = float(np.linalg.norm(initial_deviation(parameters))) / start
    times, deviation = predicted_deviation(parameters, (12.0 + np.log(farther)) / -abscissa, 4000)
    error = np.linalg.norm(deviation.reshape(len(times), -1), axis=1)
    above = np.flatnonzero(error > SETTLED * start)
    last = int(above[-1]) + 1 if above.size else 0
    return ExactLoop(abscissa, float(times[last]) if last < len(times) else np.inf)


def _abscissa(parameters: GameParameters) -> float:
    """Largest real part of the eigenvalues in 1/s; 0 where only rounding tells it from 0.

    A graph that is not connected leaves estimates that nothing corrects: an eigenvalue 0.
    """
    matrix = linear_loop(parameters)
    abscissa = spectral_abscissa(matrix)
    rounding = len(matrix) * np.finfo(float).eps * float(np.abs(matrix).max())
    if abs(abscissa) <= rounding or not is_connected(parameters.adjacency):
        return max(abscissa, 0.0)
    return abscissa


def exact_threshold(parameters: GameParameters, name: str, *, span: float = SPAN) -> float:
    """Least value of one gain (k1, k3 or k4), others as given, from which on the unperturbed loop is stable.

    Searched from `span` times the given value downwards, GRID values a decade, then bisected; 0 if
    stable down to the given value over `span`, inf if unstable at the top.
    """
    return _edge(parameters, name, span)


def exact_ceiling(parameters: GameParameters, name: str, *, span: float = SPAN) -> float:
    """Greatest value of one gain (k2), others as given, below which the unperturbed loop is stable, in 1/s.

    The same search upwards: inf if stable up to `span` times the given value, 0 if unstable at the bottom.
    """
    edge = _edge(parameters, name, 1.0 / span)
    return {0.0: float("inf"), float("inf"): 0.0}.get(edge, edge)


def _edge(parameters: GameParameters, name: str, span: float) -> float:
    """The last stable value on the way from own * span to own / span; 0 if all are stable, inf if none is."""
    own = float(getattr(parameters, name))

    def stable(value: float) -> bool:
        changed = replace(parameters, **cast("dict[str, Any]", {name: value}))
        return _abscissa(changed) < 0.0

    count = round(2 * GRID * abs(np.log10(span))) + 1
    values = (own * np.geomspace(span, 1.0 / span, count)).tolist()
    inside = values[0]
    if not stable(inside):
        return float("inf")
    for outside in values[1:]:
        if not stable(outside):
            break
        inside = outside
    else:
        return 0.0
    while abs(np.log(outside / inside)) > BISECTED:
        middle = float(np.sqrt(outside * inside))
        inside, outside = (middle, outside) if stable(middle) else (inside, middle)
    return float(inside)
