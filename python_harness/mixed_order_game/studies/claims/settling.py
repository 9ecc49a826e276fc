"""When a run counts as settled: the largest values in its last three windows agree.

A window spans at least three slowest time constants of the unperturbed loop and one period of the slowest
disturbance. It grows with the run, so that a drift that is slow against any fixed window is still seen.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

AGREEMENT = 0.1
"""Relative difference within which window maxima agree, and beyond which one is larger than another."""

TIME_CONSTANTS = 3.0
WINDOWS = 3
SHARE = 12
"""One window is at least this part of the run."""

SHORTEST = 6
"""Shortest run in windows: the last three, and as long before them for the transient."""

EXTENSION = 2.0
"""A run that has not settled is made this many times as long."""


@dataclass(frozen=True)
class Maxima:
    """Largest values of one signal in the last three windows, in their order."""

    values: tuple[float, float, float]
    floor: float  # what the integrator does not resolve: below it values count as equal

    @property
    def largest(self) -> float:
        """Over all three windows."""
        return max(self.values)

    @property
    def agree(self) -> bool:
        """Whether they are the same within AGREEMENT, or below the floor."""
        return max(self.values) <= max(self.floor, min(self.values) / (1.0 - AGREEMENT))

    @property
    def grow(self) -> bool:
        """Whether each exceeds the one before it by more than AGREEMENT, above the floor."""
        first, second, third = (max(value, self.floor) for value in self.values)
        return second > (1.0 + AGREEMENT) * first and third > (1.0 + AGREEMENT) * second

    def __str__(self) -> str:
        return ", ".join(f"{value:.3g}" for value in self.values)


def window_of(stop_time: float, least: float) -> float:
    """Length in s of the windows in which a run to stop_time is judged; three fit into any run."""
    return min(max(least, stop_time / SHARE), stop_time / WINDOWS)


def window_maxima(time: FloatArray, values: FloatArray, window: float, floor: float) -> Maxima:
    """Of samples (T,) >= 0 at times (T,) from 0 on, windows of that length, all in s."""
    stop = float(time[-1])
    edges = [stop - count * window for count in range(WINDOWS, -1, -1)]
    first, second, third = (
        float(values[(time >= begin - 1e-9 * stop) & (time <= end + 1e-9 * stop)].max())
        for begin, end in pairwise(edges)
    )
    return Maxima((first, second, third), floor)


def least_window(slowest_rate: float, periods: FloatArray) -> float:
    """Length in s of the shortest window that may be judged.

    slowest_rate: of the unperturbed loop, in 1/s; 0 if nothing decays. periods: of the disturbances, in s.
    """
    longest = TIME_CONSTANTS / slowest_rate if slowest_rate > 0.0 else np.inf
    return max(longest, float(periods.max(initial=0.0)))


def horizons(window: float, limit: float) -> Iterator[float]:
    """Lengths of the runs to try, in s, up to the limit itself; window: the least one."""
    stop = SHORTEST * window
    while stop < limit:
        yield stop
        stop *= EXTENSION
    yield limit
