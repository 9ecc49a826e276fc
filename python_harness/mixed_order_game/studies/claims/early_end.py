"""Runs that the FMU gives up: how far they had gone tells whether they were leaving."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import SimulationError
from ...fmu.model import Model, Value
from ...fmu.run import Block, Progress, Simulator
from ...game.parameters import GameParameters
from ...results.result import Result
from ...theory.spectrum import nash_equilibrium

ESCAPED = 10.0
"""A run that ends early has escaped if |x - x*| had grown to this many times the size of the actions."""

ESCAPED_WITHIN = 1e6
"""Or if an entry of v or z had: with large gains these are far larger on the way than the actions."""

GONE = 1.0 / float(np.finfo(np.float64).eps)
"""This many times the size of the actions away, x no longer resolves x*: runs that still grow end there."""

SAMPLES, REFINEMENTS = 64, 4
"""An end is looked for between two samples on grids of SAMPLES intervals, one within the other."""


@dataclass(frozen=True)
class Ended:
    """A run that the FMU gave up."""

    time: float  # s, shortly before
    start: float  # largest |x - x*| at 0
    error: float  # and at that time
    size: float  # of the actions of the game: largest of start, |x*| and 1
    message: str  # the FMU's
    within: float = 0.0  # largest |v| and |z| at that time

    @property
    def escaped(self) -> bool:
        """Whether the run was leaving."""
        return not (self.error < ESCAPED * self.size and self.within < ESCAPED_WITHIN * self.size)

    def __str__(self) -> str:
        far = ""
        if not self.error < ESCAPED * self.size:
            far = f", {self.error:.3g} from x* after a start at {self.start:.3g}"
        elif self.escaped:
            far = f", |v| or |z| at {self.within:.3g}"
        return f"The run ended after {self.time:.4g} s{far}: {self.message}"


def run_or_end(
    simulator: Simulator,
    game: GameParameters,
    *,
    start_values: Mapping[str, Value],
    stop_time: float,
    step: float,
    tolerance: float,
    outputs: Sequence[str] | None = None,
    fine_start: bool = False,
    progress: Progress | None = None,
) -> Result | Ended:
    """The result of such a run from 0, or where and how it ended; arguments are as for `Simulator.run`."""
    reached = [0.0]

    def follow(time: float) -> None:
        reached.append(time)
        if progress is not None:
            progress(time)

    try:
        return simulator.run(
            start_values=start_values,
            stop_time=stop_time,
            step=step,
            tolerance=tolerance,
            outputs=outputs,
            progress=follow,
            fine_start=fine_start,
        )
    except SimulationError as error:
        message = str(error)
    good, bad = reached[-1], min(reached[-1] + step, stop_time)
    x_star = nash_equilibrium(game).ravel()
    start = float(np.abs(game.x0.ravel() - x_star).max())
    last = _Last(simulator.model)
    ended = Ended(0.0, start, start, size_of_actions(game), message)
    for _ in range(REFINEMENTS):
        times = np.unique(np.append(0.0, np.linspace(good, bad, SAMPLES + 1)))
        with suppress(SimulationError):
            simulator.walk(times, last, values=start_values, tolerance=tolerance)
        if last.count == 0:
            break
        good, bad = times[last.count - 1], times[min(last.count, len(times) - 1)]
        far = float(np.abs(last.x - x_star).max())
        ended = Ended(float(good), start, far, ended.size, message, within=last.within)
        if ended.escaped or not good < bad:
            break
    return ended


def size_of_actions(game: GameParameters) -> float:
    """Largest of |x0 - x*|, |x*| and 1."""
    x_star = nash_equilibrium(game)
    return max(float(np.abs(game.x0 - x_star).max()), float(np.abs(x_star).max()), 1.0)


class _Last:
    """Records what a run was at the last sample that it reached."""

    def __init__(self, model: Model) -> None:
        of_kinds = [[each for _, each in sorted(model.indexed(stem).items())] for stem in ("x", "v", "z")]
        self._actions = len(of_kinds[0])
        self._block = Block([each for kind in of_kinds for each in kind], 1)
        self.count = 0
        """Samples reached."""

    def reader(self, slave: Any) -> Callable[[int], None]:
        read = self._block.reader(slave)
        self.count = 0

        def take(sample: int) -> None:
            read(0)
            self.count = sample + 1

        return take

    @property
    def x(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Actions (N D,)."""
        return np.asarray(self._block.values[0, : self._actions], dtype=np.float64)

    @property
    def within(self) -> float:
        """Largest |v| and |z|."""
        return float(np.abs(self._block.values[0, self._actions :]).max(initial=0.0))
