"""Runs that the FMU gives up: how far the actions had gone tells whether they were leaving."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...errors import SimulationError
from ...fmu.run import Progress
from ...game.parameters import GameParameters
from ...results.result import Result
from ...theory.spectrum import nash_equilibrium

ESCAPED = 10.0
"""A run that ends early has escaped if |x - x*| had grown to this many times the size of the actions."""


@dataclass(frozen=True)
class Ended:
    """A run that the FMU gave up."""

    time: float  # s, a sample shortly before
    start: float  # largest |x - x*| at 0
    error: float  # and at that sample
    size: float  # of the actions of the game: largest of start, |x*| and 1
    message: str  # the FMU's

    @property
    def escaped(self) -> bool:
        """Whether the actions were leaving."""
        return not self.error < ESCAPED * self.size

    def __str__(self) -> str:
        far = f", {self.error:.3g} from x* after a start at {self.start:.3g}" if self.escaped else ""
        return f"The run ended after {self.time:.4g} s{far}: {self.message}"


def run_or_end(
    run: Callable[[float, Progress], Result],
    game: GameParameters,
    stop_time: float,
    progress: Progress | None = None,
) -> Result | Ended:
    """The result of run(stop_time, progress), or where it ended; a run that ends is repeated up to there.

    stop_time in s. run takes the stop time, and what to call with the time of each sample.
    """
    reached = [0.0]

    def follow(time: float) -> None:
        reached.append(time)
        if progress is not None:
            progress(time)

    try:
        return run(stop_time, follow)
    except SimulationError as error:
        x_star = nash_equilibrium(game)
        start = float(np.abs(game.x0 - x_star).max())
        size = max(start, float(np.abs(x_star).max()), 1.0)
        time = reached[max(len(reached) - 2, 0)]
        last = run(time, lambda _: None).largest_error(time, time) if time > 0.0 else start
        return Ended(time, start, last, size, str(error))
