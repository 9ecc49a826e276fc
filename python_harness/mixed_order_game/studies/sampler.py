"""One loaded FMU that turns start values into the figures of a run, in a handful of calls."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import number_argument
from ..errors import ExperimentError
from ..fmu.model import Model, Value
from ..fmu.run import Block, Simulator
from ..results.metrics import JUDGED, Metrics, final_begin, judged_metrics
from ..results.result import Result


@dataclass(frozen=True)
class Settings:
    """What all runs of a sweep have in common. Times in s."""

    stop_time: float = 20.0
    step: float = 0.02  # of the samples that are recorded; no figure depends on it
    tolerance: float = 1e-6
    settle_time: float | None = None  # beginning of the final error; None: 80 % of the run
    band: float | None = None  # of the settling time; None: 2 % of the initial norm of x - x*

    def __post_init__(self) -> None:
        for name in ("stop_time", "step", "tolerance"):
            value = number_argument(getattr(self, name), name, ExperimentError)
            if not (np.isfinite(value) and value > 0.0):
                raise ExperimentError(f"{name} = {value:g} is not positive")
        for name in ("settle_time", "band"):
            if getattr(self, name) is not None:
                number_argument(getattr(self, name), name, ExperimentError)
        if self.settle_time is not None and not 0.0 <= self.settle_time <= self.stop_time:
            raise ExperimentError(f"settle_time = {self.settle_time:g} s is outside the run")
        if self.band is not None and not (np.isfinite(self.band) and self.band > 0.0):
            raise ExperimentError(f"band = {self.band:g} is not positive")

    def judging(self) -> dict[str, Value]:
        """Start values by which the FMU judges as these settings say."""
        band: dict[str, Value] = {} if self.band is None else {"settling_band": self.band}
        return {"judge_from": final_begin(0.0, self.stop_time, self.settle_time), **band}


class Sampler(Simulator):
    """A Simulator whose runs give their figures: the FMU judges them itself, in a handful of calls a run."""

    def measure(self, values: Mapping[str, Value], settings: Settings) -> Metrics:
        """Figures of the run with these start values. Raises VariableError, SimulationError as run does."""
        figures = _Figures(self.model)
        start = {**settings.judging(), **values}
        self.walk(np.array([0.0, settings.stop_time]), figures, values=start, tolerance=settings.tolerance)
        return figures.metrics(settings)

    def record(self, values: Mapping[str, Value], settings: Settings) -> Result:
        """The same run as a Result with samples of x, u, x_star, nash_error and solver_events."""
        return self.run(
            start_values={**settings.judging(), **values},
            stop_time=settings.stop_time,
            step=settings.step,
            tolerance=settings.tolerance,
            outputs=["x", "u", "solver_events"],
        )


class _Figures:
    """Reads the distance from the equilibrium at the first sample and what the FMU found at the last."""

    def __init__(self, model: Model) -> None:
        self._start = Block([model.variable("nash_error")], 1)
        wanted = [model.variable(name) for name in (*JUDGED, "solver_events")]
        self._end = [
            Block([one for one in wanted if one.type == kind], 1) for kind in ("Real", "Integer", "Boolean")
        ]

    def reader(self, slave: Any) -> Callable[[int], None]:
        self._start.reader(slave)(0)
        readers = [block.reader(slave) for block in self._end]

        def read(sample: int) -> None:
            if sample:
                for reader in readers:
                    reader(0)

        return read

    def metrics(self, settings: Settings) -> Metrics:
        found = {
            variable.name: float(value)
            for block in self._end
            for variable, value in zip(block.variables, block.values[0], strict=True)
        }
        return judged_metrics(
            found,
            initial_error=float(self._start.values[0, 0]),
            band=settings.band or 0.0,
            events=found["solver_events"],
        )
