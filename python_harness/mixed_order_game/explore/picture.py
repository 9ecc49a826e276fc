"""One run as the page draws it: few samples, dense where the loop moves, packed as 32-bit floats."""

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MixedOrderGameError
from ..fmu.model import Model
from ..fmu.run import Block, Simulator
from ..results.metrics import Metrics, sampled_metrics
from .wish import Wish

FloatArray = NDArray[np.float64]

MOST_POINTS = 40_000
"""Of all curves together: what a browser draws in a few hundredths of a second."""

MOST_SAMPLES, LEAST_SAMPLES = 600, 150

AFTER_PUSH = 150
"""Samples from the beginning, and from the end, of a push."""

CLOSEST = 1e-6
"""Least distance of two samples, as a part of the run."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Samples of a run, as far as it went."""

    time: FloatArray  # (T,), s; from the start on, shorter than asked for where the run ended early
    x: FloatArray  # (T, N, D)
    x_star: FloatArray  # (N, D)
    error: FloatArray  # (T,), 2-norm of x - x*
    metrics: Metrics | None  # of a whole run
    problem: str | None  # why the run ended early, or did not begin

    def packed(self) -> bytes:
        """For the page: length of a JSON text (uint32), the text, and float32 of x_star, time, error, x[i,l].

        All little-endian; x[1,1] at all times comes first, then x[1,2], and so on.
        """
        figures = None if self.metrics is None else self.metrics.as_json()
        head = json.dumps({"samples": len(self.time), "problem": self.problem, "figures": figures}).encode()
        head += b" " * (-len(head) % 4)
        curves = self.x.reshape(len(self.time), self.x_star.size).T
        with np.errstate(over="ignore"):  # of a run that escapes
            blocks = [block.astype("<f4").tobytes() for block in (self.x_star, self.time, self.error, curves)]
        return b"".join([struct.pack("<I", len(head)), head, *blocks])


def picture_of(simulator: Simulator, wish: Wish, go_on: Callable[[], None] = lambda: None) -> Picture:
    """Run the game as wished; what the FMU refuses becomes the picture's problem.

    go_on: called at each sample; what it raises ends the run.
    """
    model = simulator.model
    time = sample_times(wish, model.players * model.dimension)
    samples = _Samples(model, len(time), go_on)
    problem = None
    try:
        simulator.walk(
            time,
            samples,
            values=wish.changes,
            tolerance=model.tolerance,
            inputs=wish.disturbance(model),
        )
    except MixedOrderGameError as error:
        problem = str(error)
    shape = (samples.taken, model.players, model.dimension)
    x, u, error_norm = np.split(samples.values, [shape[1] * shape[2], 2 * shape[1] * shape[2]], axis=1)
    x_star = samples.x_star.reshape(shape[1:])
    metrics = None
    if problem is None:
        metrics = sampled_metrics(time, x.reshape(shape) - x_star, u.reshape(shape))
    return Picture(time[: samples.taken], x.reshape(shape), x_star, error_norm[:, 0], metrics, problem)


def refused(model: Model, problem: str) -> Picture:
    """The picture of a wish that cannot be tried."""
    shape = (model.players, model.dimension)
    return Picture(np.empty(0), np.empty((0, *shape)), np.full(shape, np.nan), np.empty(0), None, problem)


def sample_times(wish: Wish, curves: int) -> FloatArray:
    """Times (T,) in s from 0 to the end, closer behind the start and behind each push."""
    stop = wish.stop_time
    count = int(np.clip(MOST_POINTS // curves, LEAST_SAMPLES, MOST_SAMPLES))
    times = [stop * np.linspace(0.0, 1.0, count + 1) ** 2]
    for push in wish.pushes:
        for moment in (push.time, push.time + push.duration):
            if moment < stop:
                times += [moment + (stop - moment) * np.linspace(0.0, 1.0, AFTER_PUSH) ** 2]
    every = np.unique(np.concatenate(times))
    kept = every[np.diff(every, prepend=-np.inf) > CLOSEST * stop]
    return np.append(kept[stop - kept > CLOSEST * stop], stop)


class _Samples:
    """Records x, u and nash_error at every sample that is reached, x* at the first."""

    def __init__(self, model: Model, samples: int, go_on: Callable[[], None]) -> None:
        def variables(stem: str) -> list[Any]:
            return [variable for _, variable in sorted(model.indexed(stem).items())]

        signals = [*variables("x"), *variables("u"), model.variable("nash_error")]
        self._signals = Block(signals, samples)
        self._x_star = Block(variables("x_star"), 1)
        self._x_star.values[:] = np.nan
        self._go_on = go_on
        self.taken = 0

    def reader(self, slave: Any) -> Callable[[int], None]:
        self._x_star.reader(slave)(0)
        signals = self._signals.reader(slave)

        def read(sample: int) -> None:
            self._go_on()
            signals(sample)
            self.taken = sample + 1

        return read

    @property
    def values(self) -> FloatArray:
        """(T, 2 N D + 1) of the samples reached."""
        return np.asarray(self._signals.values[: self.taken])

    @property
    def x_star(self) -> FloatArray:
        """(N D,)."""
        return np.asarray(self._x_star.values[0])
