"""Runs an FMU through fmpy's co-simulation slave, one communication step at a time.

fmpy.simulate_fmu is not used: a Simulator keeps its instance between runs (reset instead of load), reads any
variable, reports progress, sets inputs and tunable parameters on the way and turns the FMU's log into errors.
"""

import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from ctypes import POINTER, c_double, c_int, c_uint
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from typing import Any, Self, cast

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE, fmi2Discard
from numpy.typing import ArrayLike, NDArray

from .errors import SimulationError
from .model import Model, Value, Variable, check_value, read_model
from .results import Result
from .version import package_version

Inputs = Callable[[float], ArrayLike] | ArrayLike
"""External disturbance d_ext: a function of the time in s giving (N, D), or an array (N, D) or (T, N, D)."""

Changes = Mapping[float, Mapping[str, Value]]
"""Tunable parameters and inputs to set during the run: time in s -> name -> value."""

Progress = Callable[[float], None]
"""Called with the time reached, in s, after every step."""

LARGEST_SAMPLES = 10_000_000
LEFT_OUT = ("y", "W")
"""Estimates and weights: N^2 D and N q D columns, recorded only when asked for."""


def run(
    fmu: Path | str,
    *,
    start_values: Mapping[str, Value] | None = None,
    stop_time: float = 20.0,
    start_time: float = 0.0,
    step: float = 0.02,
    tolerance: float = 1e-6,
    outputs: Sequence[str] | None = None,
    inputs: Inputs | None = None,
    changes: Changes | None = None,
    progress: Progress | None = None,
) -> Result:
    """Run an FMU once. For several runs of one FMU use Simulator, whose run() this is."""
    with Simulator(fmu) as simulator:
        return simulator.run(
            start_values=start_values,
            stop_time=stop_time,
            start_time=start_time,
            step=step,
            tolerance=tolerance,
            outputs=outputs,
            inputs=inputs,
            changes=changes,
            progress=progress,
        )


class Simulator:
    """One FMU, unpacked and loaded once, run as often as wanted. Use it in a with statement.

    Raises ModelError if the FMU cannot be read, SimulationError if it cannot be loaded on this machine.
    """

    def __init__(self, fmu: Path | str) -> None:
        self.model: Model = read_model(fmu)
        self._messages: list[tuple[int, str]] = []
        self._folder = Path(tempfile.mkdtemp(prefix="mixed-order-game-"))
        self._slave: Any = None
        try:
            fmpy.extract(str(self.model.path), unzipdir=self._folder)
            self._callbacks = fmi2CallbackFunctions()
            self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
            self._callbacks.allocateMemory = defaultCallbacks.allocateMemory
            self._callbacks.freeMemory = defaultCallbacks.freeMemory
            slave = FMU2Slave(
                guid=self.model.guid,
                modelIdentifier="MixedOrderGame",
                unzipDirectory=str(self._folder),
                instanceName="mixed_order_game",
            )
            slave.instantiate(callbacks=self._callbacks)
            self._slave = slave
        except Exception as error:  # fmpy raises bare Exceptions
            self.close()
            said = self._said()
            raise SimulationError(f"{self.model.path} cannot be loaded: {said or error}") from error
        self._used = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and remove the unpacked files. Closing twice is allowed."""
        if self._slave is not None:
            self._slave.freeInstance()
            self._slave = None
        shutil.rmtree(self._folder, ignore_errors=True)

    def run(
        self,
        *,
        start_values: Mapping[str, Value] | None = None,
        stop_time: float = 20.0,
        start_time: float = 0.0,
        step: float = 0.02,
        tolerance: float = 1e-6,
        outputs: Sequence[str] | None = None,
        inputs: Inputs | None = None,
        changes: Changes | None = None,
        progress: Progress | None = None,
    ) -> Result:
        """Run from start_time to stop_time, in s, and sample every step, both ends included.

        start_values: parameters and inputs to set first, others keep the FMU's start values.
        step: communication step in s; the last one is shorter if the horizon is not a multiple of it.
        tolerance: relative tolerance of the integrator.
        outputs: names to record; x stands for every x[i,l]. Default: all outputs and locals but y and W.
            x_star is always recorded.
        inputs: external disturbance d_ext, held over each step at the value of the step's beginning: a
            function of the time in s giving (N, D), or an array (N, D), or (T, N, D) with one row a sample.
        changes: tunable parameters and inputs set on the way, each before the step that begins at its time;
            a time between two samples becomes a communication point of its own. A sample at the time of a
            change is taken before it.

        Raises VariableError for a variable that does not exist or does not take its value, SimulationError
        for times, shapes and tolerances that make no sense and for whatever the FMU refuses.
        """
        if self._slave is None:
            raise SimulationError("the simulator is closed")
        time = _samples(start_time, stop_time, step)
        if not (np.isfinite(tolerance) and 0.0 < tolerance < 1.0):
            raise SimulationError(f"tolerance = {tolerance:g} is not between 0 and 1")
        parameters = self.model.start_values(start_values)
        schedule = _schedule(self.model, changes or {}, time)
        disturbance = _Disturbance(self.model, inputs, len(time))
        recorder = _Recorder(self._slave, self._recorded(outputs), len(time))

        try:
            self._initialize({name: parameters[name] for name in start_values or {}}, time, tolerance)
            disturbance.set(self._slave, 0, start_time)
            self._slave.exitInitializationMode()
            recorder.read(0)
            for sample in range(1, len(time)):
                begin, end = float(time[sample - 1]), float(time[sample])
                disturbance.set(self._slave, sample - 1, begin)
                self._step(begin, end, schedule)
                recorder.read(sample)
                if progress is not None:
                    progress(end)
            self._slave.terminate()
        except FMICallException as error:
            raise SimulationError(self._said() or str(error)) from error

        return Result(
            time=time,
            columns=recorder.columns(),
            units={variable.name: variable.unit or "" for variable in recorder.variables},
            parameters=parameters,
            title=self.model.title,
            guid=self.model.guid,
            package_version=package_version(),
            stop_time=stop_time,
            step=step,
            tolerance=tolerance,
            messages=tuple(message for _, message in self._messages),
            changed={
                name: value for name, value in parameters.items() if self.model.variable(name).start != value
            },
        )

    def _initialize(self, values: Mapping[str, Value], time: NDArray[np.float64], tolerance: float) -> None:
        self._messages.clear()
        if self._used:
            self._slave.reset()
        self._used = True
        self._slave.setupExperiment(tolerance=tolerance, startTime=float(time[0]), stopTime=float(time[-1]))
        self._set(values)
        self._slave.enterInitializationMode()

    def _set(self, values: Mapping[str, Value]) -> None:
        variables = self.model.variables
        for kind, setter in (("Real", "setReal"), ("Integer", "setInteger"), ("Boolean", "setBoolean")):
            chosen = {name: value for name, value in values.items() if variables[name].type == kind}
            if chosen:
                references = [variables[name].reference for name in chosen]
                getattr(self._slave, setter)(references, list(chosen.values()))

    def _step(self, begin: float, end: float, schedule: Mapping[float, Mapping[str, Value]]) -> None:
        """Steps from begin to end, through the changes at begin and between."""
        points = [begin, *(when for when in schedule if begin < when < end), end]
        for now, then in pairwise(points):
            if now in schedule:
                self._set(schedule[now])
            self._slave.doStep(now, then - now)

    def _recorded(self, outputs: Sequence[str] | None) -> list[Variable]:
        if outputs is not None:
            return self.model.select([*outputs, "x_star"])
        left_out = {variable.name for stem in LEFT_OUT for variable in self.model.indexed(stem).values()}
        return [
            variable
            for variable in self.model.variables.values()
            if variable.causality in ("output", "local", "calculatedParameter")
            and variable.variability != "constant"
            and variable.name not in left_out
        ]

    def _log(self, _: object, _name: bytes, status: int, _category: bytes, message: bytes) -> None:
        self._messages.append((status, message.decode("utf-8", errors="replace")))

    def _said(self) -> str:
        """The last error that the FMU logged; empty if it logged none."""
        return next((text for status, text in reversed(self._messages) if status >= fmi2Discard), "")


class _Recorder:
    """Reads the chosen variables straight into the rows of two arrays, one for reals, one for integers."""

    def __init__(self, slave: Any, variables: Sequence[Variable], samples: int) -> None:
        self.variables = variables
        self._slave = slave
        self._reals = [variable for variable in variables if variable.type == "Real"]
        self._integers = [variable for variable in variables if variable.type != "Real"]
        self._real_references = _references(self._reals)
        self._integer_references = _references(self._integers)
        self._real_values = np.empty((samples, len(self._reals)))
        self._integer_values = np.empty((samples, len(self._integers)), dtype=np.int32)

    def read(self, sample: int) -> None:
        component = self._slave.component
        if self._reals:
            row = self._real_values[sample].ctypes.data_as(POINTER(c_double))
            self._slave.fmi2GetReal(component, self._real_references, len(self._reals), row)
        if self._integers:
            row_of_integers = self._integer_values[sample].ctypes.data_as(POINTER(c_int))
            self._slave.fmi2GetInteger(
                component, self._integer_references, len(self._integers), row_of_integers
            )

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Columns in the order of the variables; integers below 2^53 are exact as floats."""
        columns = {
            variable.name: np.ascontiguousarray(self._real_values[:, position])
            for position, variable in enumerate(self._reals)
        }
        columns |= {
            variable.name: self._integer_values[:, position].astype(np.float64)
            for position, variable in enumerate(self._integers)
        }
        return {variable.name: columns[variable.name] for variable in self.variables}


class _Disturbance:
    """The external disturbance d_ext at the beginning of every step."""

    def __init__(self, model: Model, inputs: Inputs | None, samples: int) -> None:
        self._function: Callable[[float], ArrayLike] | None = None
        self._array: NDArray[np.float64] | None = None
        self._shape = (model.players, model.dimension)
        names = model.indexed("d_ext")
        self._references = _references([names[index] for index in sorted(names)])
        self._buffer = (c_double * len(names))()
        if inputs is None:
            return
        if callable(inputs):
            self._function = inputs
            return
        array = np.asarray(inputs, dtype=np.float64)
        if array.shape not in (self._shape, (samples, *self._shape)):
            raise SimulationError(
                f"inputs has the shape {array.shape}, not {self._shape} or {(samples, *self._shape)}"
            )
        _check_finite(array, "inputs")
        self._array = np.broadcast_to(array, (samples, *self._shape))

    def set(self, slave: Any, sample: int, time: float) -> None:
        """Set the inputs for the step that begins with this sample; nothing if there are none."""
        if self._function is not None:
            value = np.asarray(self._function(time), dtype=np.float64)
            if value.shape != self._shape:
                raise SimulationError(f"inputs({time:g}) has the shape {value.shape}, not {self._shape}")
            _check_finite(value, f"inputs({time:g})")
        elif self._array is not None:
            value = self._array[sample]
        else:
            return
        self._buffer[:] = cast("Any", value.ravel().tolist())
        slave.fmi2SetReal(slave.component, self._references, len(self._buffer), self._buffer)


def _samples(start: float, stop: float, step: float) -> NDArray[np.float64]:
    """Times start, start + step, ..., stop."""
    if not (np.isfinite(start) and np.isfinite(stop) and start < stop):
        raise SimulationError(f"stop_time = {stop:g} s is not after start_time = {start:g} s")
    if not (np.isfinite(step) and step > 0.0):
        raise SimulationError(f"step = {step:g} s is not positive")
    intervals = (stop - start) / step
    if intervals > LARGEST_SAMPLES:
        raise SimulationError(f"step = {step:g} s gives more than {LARGEST_SAMPLES} samples")
    whole = max(1, round(intervals))
    if abs(intervals - whole) <= 1e-9 * whole:
        return start + (stop - start) * (np.arange(whole + 1) / whole)
    inner = start + step * np.arange(int(intervals) + 1)
    return np.append(inner, stop)


def _schedule(model: Model, changes: Changes, samples: NDArray[np.float64]) -> dict[float, dict[str, Value]]:
    """The changes by time, their values checked; a time that is nearly a sample's becomes that sample's."""
    schedule: dict[float, dict[str, Value]] = {}
    start, stop = float(samples[0]), float(samples[-1])
    for when in sorted(changes):
        nearest = float(samples[np.argmin(np.abs(samples - when))])
        point = nearest if abs(when - nearest) <= 1e-9 * (stop - start) else float(when)
        if not start <= point < stop:
            raise SimulationError(f"the change at {when:g} s is outside [{start:g}, {stop:g}) s")
        values = {
            name: check_value(model.variable(name), value, during_run=True)
            for name, value in changes[when].items()
        }
        schedule.setdefault(point, {}).update(values)
    return schedule


def _references(variables: Iterable[Variable]) -> Any:
    numbers = [variable.reference for variable in variables]
    return (c_uint * len(numbers))(*numbers)


def _check_finite(array: NDArray[np.float64], name: str) -> None:
    if not np.all(np.isfinite(array)):
        raise SimulationError(f"{name} must be finite")
