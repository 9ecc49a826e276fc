"""One loaded FMU that turns start values into the figures of a run, with few calls from Python."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import number_argument
from ..errors import ExperimentError
from ..fmu.model import Model, Value
from ..fmu.run import Block, Simulator
from ..results.metrics import Metrics, sample_times, sampled_metrics
from ..results.result import Result

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """What all runs of a sweep have in common. Times in s."""

    stop_time: float = 20.0
    step: float = 0.02
    tolerance: float = 1e-6
    settle_time: float | None = None  # beginning of the final error; None: 80 % of the run
    band: float | None = None  # of the settling time; None: 2 % of the largest initial |x - x*|

    def __post_init__(self) -> None:
        for name in ("stop_time", "step", "tolerance"):
            value = number_argument(getattr(self, name), name, ExperimentError)
            if not (np.isfinite(value) and value > 0.0):
                raise ExperimentError(f"{name} = {value:g} is not positive")
        if self.step > self.stop_time:
            raise ExperimentError(f"step = {self.step:g} s is longer than the run, {self.stop_time:g} s")
        for name in ("settle_time", "band"):
            if getattr(self, name) is not None:
                number_argument(getattr(self, name), name, ExperimentError)
        if self.settle_time is not None and not 0.0 <= self.settle_time <= self.stop_time:
            raise ExperimentError(f"settle_time = {self.settle_time:g} s is outside the run")
        if self.band is not None and not (np.isfinite(self.band) and self.band > 0.0):
            raise ExperimentError(f"band = {self.band:g} is not positive")


class Sampler(Simulator):
    """A Simulator whose runs give their figures, at times that are finer where the control begins."""

    def measure(self, values: Mapping[str, Value], settings: Settings) -> Metrics:
        """Figures of the run with these start values. Raises VariableError, SimulationError as run does."""
        time = sample_times(settings.stop_time, settings.step)
        recorder = _Signals(self.model, len(time))
        self.walk(time, recorder, values=values, tolerance=settings.tolerance)
        return sampled_metrics(
            time,
            recorder.deviation,
            recorder.u,
            events=recorder.events,
            band=settings.band,
            settle_time=settings.settle_time,
        )

    def record(self, values: Mapping[str, Value], settings: Settings) -> Result:
        """The same run, on the same times, as a Result with x, u, x_star, nash_error and solver_events."""
        time = sample_times(settings.stop_time, settings.step)
        recorder = _Signals(self.model, len(time))
        messages = self.walk(time, recorder, values=values, tolerance=settings.tolerance)
        return self.result(
            time,
            recorder.columns(),
            parameters=self.model.start_values(values),
            stop_time=settings.stop_time,
            step=settings.step,
            tolerance=settings.tolerance,
            messages=messages,
        )


class _Signals:
    """Records x and u at every sample, x* at the first one and the sphere events at the last one."""

    def __init__(self, model: Model, samples: int) -> None:
        entries = [(i, k) for i in range(1, model.players + 1) for k in range(1, model.dimension + 1)]

        def block(stems: Sequence[str], rows: int) -> Block:
            names = [f"{stem}[{i},{k}]" for stem in stems for i, k in entries]
            return Block([model.variable(name) for name in names], rows)

        self._shape = (samples, model.players, model.dimension)
        self._xu, self._x_star = block(["x", "u"], samples), block(["x_star"], 1)
        self._events = Block([model.variable("solver_events")], 1)

    def reader(self, slave: Any) -> Callable[[int], None]:
        xu, events, last = self._xu.reader(slave), self._events.reader(slave), self._shape[0] - 1
        self._x_star.reader(slave)(0)

        def read(sample: int) -> None:
            xu(sample)
            if sample == last:
                events(0)

        return read

    @property
    def deviation(self) -> FloatArray:
        """x - x*, (T, N, D)."""
        x, _ = np.hsplit(self._xu.values, 2)
        return (x - self._x_star.values).reshape(self._shape)

    @property
    def u(self) -> FloatArray:
        """(T, N, D)."""
        return np.hsplit(self._xu.values, 2)[1].reshape(self._shape)

    @property
    def events(self) -> int:
        """Weight columns that entered or left the sphere."""
        return int(self._events.values[0, 0])

    def columns(self) -> dict[str, FloatArray]:
        """What a Result holds."""
        samples = self._shape[0]
        constants = self._x_star.columns() | self._events.columns()
        return {
            **self._xu.columns(),
            **{name: np.full(samples, value[0]) for name, value in constants.items()},
            "nash_error": np.linalg.norm(self.deviation, axis=(1, 2)),
        }
