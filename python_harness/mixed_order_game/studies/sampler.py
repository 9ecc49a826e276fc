"""One loaded FMU that turns start values into the figures of a run, with few calls from Python."""

from collections.abc import Mapping, Sequence
from ctypes import c_double, c_int, c_uint
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2True
from numpy.typing import NDArray

from ..arguments import number_argument
from ..errors import SimulationError
from ..fmu.model import Value, check_value
from ..fmu.run import Simulator
from ..fmu.turn import in_turn
from ..results.metrics import Metrics, changed_values, sample_times, sampled_metrics
from ..results.result import Result
from ..version import package_version

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
            value = number_argument(getattr(self, name), name, SimulationError)
            if not (np.isfinite(value) and value > 0.0):
                raise SimulationError(f"{name} = {value:g} is not positive")
        if self.step > self.stop_time:
            raise SimulationError(f"step = {self.step:g} s is longer than the run, {self.stop_time:g} s")
        for name in ("settle_time", "band"):
            if getattr(self, name) is not None:
                number_argument(getattr(self, name), name, SimulationError)
        if self.settle_time is not None and not 0.0 <= self.settle_time <= self.stop_time:
            raise SimulationError(f"settle_time = {self.settle_time:g} s is outside the run")
        if self.band is not None and not (np.isfinite(self.band) and self.band > 0.0):
            raise SimulationError(f"band = {self.band:g} is not positive")


@dataclass(frozen=True)
class _Signals:
    """Recorded reals of one kind: value references and their shape."""

    references: Any
    names: Sequence[str]

    @property
    def count(self) -> int:
        return len(self.names)


class Sampler(Simulator):
    """A Simulator whose runs read one block of reals per sample, at times that need not be equally spaced."""

    def __init__(self, fmu: Path | str) -> None:
        super().__init__(fmu)
        N, D = self.model.players, self.model.dimension
        self._entries = [(i, k) for i in range(1, N + 1) for k in range(1, D + 1)]
        self._block = self._signals([f"{stem}[{i},{k}]" for stem in ("x", "u") for i, k in self._entries])
        self._equilibrium = self._signals([f"x_star[{i},{k}]" for i, k in self._entries])

    @in_turn
    def measure(self, values: Mapping[str, Value], settings: Settings) -> Metrics:
        """Figures of the run with these start values. Raises VariableError, SimulationError as run does."""
        time = sample_times(settings.stop_time, settings.step)
        samples, x_star, events = self._sampled(values, time, settings.tolerance)
        x, u = self._shaped(samples)
        return sampled_metrics(
            time, x - x_star, u, events=events, band=settings.band, settle_time=settings.settle_time
        )

    @in_turn
    def record(self, values: Mapping[str, Value], settings: Settings) -> Result:
        """The same run as a Result with x, u, x_star and solver_events, on the times of measure."""
        time = sample_times(settings.stop_time, settings.step)
        samples, x_star, events = self._sampled(values, time, settings.tolerance)
        columns = {name: np.ascontiguousarray(samples[:, k]) for k, name in enumerate(self._block.names)}
        constants = zip(self._equilibrium.names, x_star.ravel(), strict=True)
        columns |= {name: np.full(len(time), value) for name, value in constants}
        x, _ = self._shaped(samples)
        columns["nash_error"] = np.linalg.norm(x - x_star, axis=(1, 2))
        parameters = self.model.start_values(values)
        columns["solver_events"] = np.full(len(time), events)
        return Result(
            time=time,
            columns=columns,
            units={name: self.model.variable(name).unit or "" for name in columns},
            parameters=parameters,
            changed=changed_values(self.model, parameters),
            title=self.model.title,
            guid=self.model.guid,
            package_version=package_version(),
            stop_time=settings.stop_time,
            step=settings.step,
            tolerance=settings.tolerance,
            messages=tuple(message for _, message in self._messages),
        )

    def _sampled(
        self, values: Mapping[str, Value], time: FloatArray, tolerance: float
    ) -> tuple[FloatArray, FloatArray, int]:
        """Rows of x and u (T, 2 N D), x* (N, D), and the sphere events of the run."""
        if self._slave is None:
            raise SimulationError("the simulator is closed")
        checked = {
            name: check_value(self.model.variable(name), value)
            for name, value in self.model.expanded(values).items()
        }
        try:
            self._initialize(checked, time, tolerance)
            self._slave.exitInitializationMode()
            x_star = self._read(self._equilibrium)
            samples = self._walk(time.tolist())
            events = self._events()
            self._slave.terminate()
        except FMICallException as error:
            raise SimulationError(self._said() or str(error)) from error
        return samples, x_star.reshape(self.model.players, self.model.dimension), events

    def _walk(self, time: Sequence[float]) -> FloatArray:
        slave, component = self._slave, self._slave.component
        references, width = self._block.references, self._block.count
        rows = (c_double * width * len(time))()
        slave.fmi2GetReal(component, references, width, rows[0])
        for row, (now, then) in enumerate(pairwise(time), start=1):
            slave.fmi2DoStep(component, now, then - now, fmi2True)
            slave.fmi2GetReal(component, references, width, rows[row])
        return np.array(rows, dtype=np.float64)

    def _read(self, signals: _Signals) -> FloatArray:
        values = (c_double * signals.count)()
        self._slave.fmi2GetReal(self._slave.component, signals.references, signals.count, values)
        return np.array(values)

    def _events(self) -> int:
        reference = (c_uint * 1)(self.model.variable("solver_events").reference)
        value = (c_int * 1)()
        self._slave.fmi2GetInteger(self._slave.component, reference, 1, value)
        return int(value[0])

    def _signals(self, names: Sequence[str]) -> _Signals:
        numbers = [self.model.variable(name).reference for name in names]
        return _Signals((c_uint * len(numbers))(*numbers), names)

    def _shaped(self, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        shape = (len(samples), self.model.players, self.model.dimension)
        x, u = np.hsplit(samples, 2)
        return x.reshape(shape), u.reshape(shape)
