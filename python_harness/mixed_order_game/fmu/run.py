"""Runs an FMU through fmpy's co-simulation slave, one communication step at a time.

fmpy.simulate_fmu is not used: a Simulator keeps its instance between runs (reset instead of load), reads any
variable, reports progress, sets inputs and tunable parameters on the way and turns the FMU's log into errors.
"""

import logging
import os
import shutil
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import c_double, c_int, c_uint
from itertools import pairwise
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Any, Protocol, Self

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    defaultCallbacks,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Discard,
    fmi2True,
    fmi2Warning,
)
from numpy.typing import NDArray

from ..arguments import number_argument
from ..errors import ExperimentError, SimulationError
from ..files.temporary import explained, new_folder, temporary_folder
from ..game.parts import toml_of_game
from ..interrupts import noted_signals
from ..names import parse_name, split_names
from ..results.metrics import JUDGED, final_begin
from ..results.result import Result
from ..times import in_seconds
from ..version import package_version
from .build import GameSource, cached_fmu
from .inputs import Feedback, Inputs, NoInputs, disturbance_of, on_samples
from .model import Model, Value, Variable, check_value, read_model
from .parts import notes_of_parts
from .plants import PlantFunctions, Plants, initial_states, with_plants_outside
from .turn import Turn, in_turn

logger = logging.getLogger(__name__)

Changes = Mapping[float, Mapping[str, Value]]
"""Tunable parameters and inputs to set during the run: time in s -> name -> value."""

Progress = Callable[[float], None]
"""Called with the time reached, in s, after every step."""

_loading = Lock()

LARGEST_SAMPLES = 10_000_000
FINE_STEPS, FINE_SAMPLES, FINEST = 50, 300, 1e-4
"""Of a fine start: regular steps that it spans, its samples, and the first of them in regular steps."""


def run(
    game: GameSource = None,
    *,
    start_values: Mapping[str, Value] | None = None,
    stop_time: float | None = None,
    start_time: float = 0.0,
    step: float = 0.02,
    tolerance: float = 1e-6,
    outputs: Sequence[str] | None = None,
    inputs: Inputs | None = None,
    feedback: Feedback | None = None,
    plant: Plants | None = None,
    changes: Changes | None = None,
    progress: Progress | None = None,
    fine_start: bool = False,
) -> Result:
    """Run a game once, from start to stop, and sample it.

    For several runs of one game use a `Simulator`, which loads the FMU once.

    Parameters
    ----------
    game
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`; the paper's example
        when left out.
    start_values
        Parameters and inputs to set first, by name; others keep the FMU's start values. A name without
        indices stands for all of its kind, `a` for every `a[i,j]`, here, in `changes` and in `outputs`.
    stop_time
        End in s; default `start_time` plus the FMU's stop time.
    start_time
        Beginning in s; any, Unix time, say: disturbances are functions of it.
    step
        Time between samples in s; the last one is shorter if the horizon is not a multiple of it.
    tolerance
        Relative tolerance of the integrator, between 0 and 1.
    outputs
        Names to record; default all outputs and locals but y, W and the time derivatives. `x_star` is always
        recorded.
    inputs
        External disturbance d_ext: a function of the time in s giving (N, D), or an array (N, D) or (T, N, D)
        with one row a sample, each held over each communication step at the value of its beginning; or a
        `schedule.Disturbance`, whose rows act exactly at their times, held or straight between them.
    feedback
        Unknown dynamics g(t, x, v) besides the game's own, as a function, carried by d_ext: of the time in s
        and all players' x and v (N, D), v NaN for order 1, giving (N, D); or functions of single players by
        1-based number, giving (D,). Asked as often as `tolerance` wants it, straight in between; a jump is
        met within `step` / 500.
    plant
        Plants by 1-based player, as functions f(t, x, v, u) -> rate: t in s; x, v and u are the player's own
        action, velocity and control, (D,) each, v NaN for order 1; the rate (D,) is that of x for order 1, of
        v for order 2. It replaces the plant of the game: the player's dynamics and disturbance are left out,
        x0 and v0 are where it starts, u_max is refused (bound u in the function). It is integrated together
        with the FMU to `tolerance`, whatever `step` is; one whose rate jumps to and fro with x, v or u, as
        -sign(v) does, ends in an error.
    changes
        Tunable parameters and inputs set on the way: time in s -> name -> value, each before the step that
        begins at its time. A sample at the time of a change is taken before it.
    progress
        Called with the time reached, in s, after every step.
    fine_start
        Whether the first steps are sampled on a geometric grid besides, from a ten-thousandth of a step on,
        for figures that show how the control begins.

    Returns
    -------
    Result
        Signals as arrays, (T, N, D) for actions: time, player, coordinate.

    Raises
    ------
    GameError, ModelError
        For a game or FMU that is missing (a FileNotFoundError, too) or is none.
    VariableError
        For a variable that does not exist (a KeyError, too) or does not take its value.
    SimulationError
        For whatever the FMU refuses; for times, shapes and tolerances that make no sense it is an
        `ExperimentError`, a ValueError, too.

    Examples
    --------
    >>> result = mog.run("five_vehicles", start_values={"k1": 12.0}, stop_time=2.0)
    >>> result.x.shape
    (101, 5, 2)
    >>> result.largest_error(1.9) < 0.1
    True
    """
    with Simulator(game) as simulator:
        return simulator.run(
            start_values=start_values,
            stop_time=stop_time,
            start_time=start_time,
            step=step,
            tolerance=tolerance,
            outputs=outputs,
            inputs=inputs,
            feedback=feedback,
            plant=plant,
            changes=changes,
            progress=progress,
            fine_start=fine_start,
        )


@contextmanager
def _in_place() -> Iterator[None]:
    """Keep the working directory: fmpy changes it while it loads a library, and for good when that fails."""
    with _loading:
        here = os.getcwd()  # noqa: PTH109
        try:
            yield
        finally:
            os.chdir(here)


class Simulator:
    """One FMU, unpacked and loaded once, run as often as wanted. Use it in a with statement.

    Threads that share one wait for each other; to run at the same time each needs its own.

    fmu: a file (.fmu), or a game, of which it is made on first use: a game file (.toml), a game of the
    package by its name, a Game, or None for the paper's example; or the Model that read_model made of one.
    Raises what read_model raises, SimulationError if the FMU cannot be loaded on this machine.
    """

    _holds_all_players = True
    _library: Path | None = None
    """Shared library to load in place of the FMU's own."""

    def __init__(self, fmu: GameSource | Model = None) -> None:
        self.model: Model = fmu if isinstance(fmu, Model) else read_model(fmu)
        if self._holds_all_players:
            self.model.require_all_players()
        self._outside: dict[tuple[int, ...], Simulator] = {}
        self._initial: Mapping[str, Value] = {}  # of plants that a game has and functions replace
        self._messages: list[tuple[int, str]] = []
        self._turn = Turn()
        self._process = os.getpid()
        self._folder: Path | None = None
        self._slave: Any = None
        try:
            with noted_signals():
                self._folder = new_folder(SimulationError)
                self._load(self._folder)
        except BaseException:  # of a signal, too
            self.close()
            raise
        self._used = False

    def _load(self, folder: Path) -> None:
        """Unpack, load the library and make an instance, which needs the files no longer."""
        try:
            fmpy.extract(str(self.model.path), unzipdir=folder, include=_needed)
            self._callbacks = fmi2CallbackFunctions()
            self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
            self._callbacks.allocateMemory = defaultCallbacks.allocateMemory
            self._callbacks.freeMemory = defaultCallbacks.freeMemory
            with _in_place():
                slave = FMU2Slave(
                    guid=self.model.guid,
                    modelIdentifier="MixedOrderGame",
                    unzipDirectory=str(folder),
                    instanceName="mixed_order_game",
                    libraryPath=None if self._library is None else str(self._library),
                )
            slave.instantiate(callbacks=self._callbacks)
            self._slave = slave
        except Exception as error:  # fmpy raises bare Exceptions
            said = self._said() or explained(error, folder)
            raise SimulationError(f"{self.model.path} cannot be loaded: {said}") from error
        if os.name == "posix":  # elsewhere a library that is in use cannot be removed
            shutil.rmtree(folder, ignore_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and remove what is left of the unpacked files. Closing twice is allowed.

        In a forked process nothing is freed: that is its parent's. Raises SimulationError from within a run.
        """
        if os.getpid() != self._process:
            self._slave = None
            return
        self._free()

    @in_turn
    def _free(self) -> None:
        for simulator in self._outside.values():
            simulator.close()
        self._outside.clear()
        if self._slave is not None:
            self._slave.freeInstance()
            self._slave = None
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    @in_turn
    def run(
        self,
        *,
        start_values: Mapping[str, Value] | None = None,
        stop_time: float | None = None,
        start_time: float = 0.0,
        step: float = 0.02,
        tolerance: float = 1e-6,
        outputs: Sequence[str] | None = None,
        inputs: Inputs | None = None,
        feedback: Feedback | None = None,
        plant: Plants | None = None,
        changes: Changes | None = None,
        progress: Progress | None = None,
        fine_start: bool = False,
    ) -> Result:
        """Run from start_time to stop_time and sample every step, both ends included.

        The times of changes and of a Disturbance's rows become communication points when they lie between two
        samples; samples are taken at the same times as without them.

        Parameters, result and errors are those of `mixed_order_game.run`, but for the game, which this
        Simulator has loaded.
        """
        if plant is not None and (numbers := self._replaced(plant)) != self.model.external:
            return self._with_plants_outside(numbers).run(
                start_values=start_values,
                stop_time=stop_time,
                start_time=start_time,
                step=step,
                tolerance=tolerance,
                outputs=outputs,
                inputs=inputs,
                feedback=feedback,
                plant=plant,
                changes=changes,
                progress=progress,
                fine_start=fine_start,
            )
        if stop_time is None:
            stop_time = number_argument(start_time, "start_time", ExperimentError) + self.model.stop_time
        start_time, stop_time, step, tolerance = (
            number_argument(value, name, ExperimentError)
            for name, value in (
                ("start_time", start_time),
                ("stop_time", stop_time),
                ("step", step),
                ("tolerance", tolerance),
            )
        )
        time = samples(start_time, stop_time, step)
        if fine_start:
            time = _with_fine_start(time)
        if not (np.isfinite(tolerance) and 0.0 < tolerance < 1.0):
            raise ExperimentError(f"tolerance = {tolerance:g} is not between 0 and 1")
        start = self._start_of(start_values or {})
        judging = {} if "judge_from" in start else {"judge_from": final_begin(start_time, stop_time, None)}
        first = {**self._initial, **start, **judging}
        parameters = self.model.start_values(first)
        schedule = _schedule(self.model, changes or {}, time)
        own_tolerance = self._tolerance(first, tolerance)
        disturbance = disturbance_of(self.model, inputs, time, feedback, own_tolerance)
        if inputs is not None or feedback is not None:
            by = "inputs" if feedback is None else "feedback"
            _check_set_once(self.model, [start, *schedule.values()], ("d_ext",), by)
        plants = None
        if plant is not None:
            plants = PlantFunctions(self.model, plant, own_tolerance)
            for told in notes_of_parts(self.model):
                logger.info("coupled by a tool, %s", told)
            _check_set_once(self.model, schedule.values(), ("x", "v"), "plant")
        recorder = _Columns(self._recorded(outputs), len(time))
        begin = clock.perf_counter()
        messages = self._walk(
            time,
            recorder,
            values={name: parameters[name] for name in first},
            tolerance=tolerance,
            schedule=schedule,
            disturbance=disturbance,
            plants=plants,
            progress=progress,
        )
        logger.info(
            "ran %s from %.15g to %s in %.3g s of computing",
            self.model.title,
            start_time,
            in_seconds(stop_time),
            clock.perf_counter() - begin,
        )
        return self.result(
            time,
            recorder.columns(),
            parameters=parameters,
            changed={
                name: value
                for name, value in self.model.changed_values(self.model.start_values(start)).items()
                if value != self._initial.get(name)
            },
            step=step,
            tolerance=tolerance,
            stop_time=stop_time,
            messages=messages,
        )

    def _ready(self, plants: PlantFunctions | None = None) -> Any:
        """The instance. Raises SimulationError if it is closed, ModelError if plants are missing."""
        if self._slave is None:
            raise SimulationError("the simulator is closed")
        if plants is None:
            self.model.require_plants()
        return self._slave

    def _advance(
        self, begin: float, end: float, disturbance: NoInputs | None, plants: PlantFunctions | None
    ) -> None:
        """From one communication point to the next, and to those in between that the disturbance wants."""
        while begin < end:
            until = end if disturbance is None else disturbance.until(begin, end)
            if plants is None:
                self._slave.fmi2DoStep(self._slave.component, begin, until - begin, fmi2True)
            else:
                plants.advance(begin, until)
            begin = until
            if disturbance is not None and begin < end:
                disturbance.set(self._slave, begin)

    def _replaced(self, plant: Plants) -> tuple[int, ...]:
        """The players whose plants are functions. Raises ExperimentError for what are no such players."""
        if not isinstance(plant, Mapping):
            raise ExperimentError(f"plant is {plant!r}, expected functions by player, as in {{4: f}}")
        for number, function in plant.items():
            if isinstance(number, bool) or number not in range(1, self.model.players + 1):
                raise ExperimentError(
                    f"plant has the player {number!r}, expected a number from 1 to {self.model.players}"
                )
            if not callable(function):
                raise ExperimentError(f"the plant of player {number} is {function!r}, expected a function")
        for number in self.model.external:
            if number not in plant:
                raise ExperimentError(f"plant has no function of player {number}, whose plant is external")
        return tuple(sorted(plant))

    def _with_plants_outside(self, numbers: tuple[int, ...]) -> "Simulator":
        """A simulator of the same game in which these players' plants are external."""
        if numbers not in self._outside:
            with temporary_folder(SimulationError) as folder:
                game = folder / "game.toml"
                game.write_text(toml_of_game(with_plants_outside(self.model.game, numbers)), encoding="utf-8")
                simulator = Simulator(cached_fmu(game))
            own = [number for number in numbers if number not in self.model.external]
            simulator._initial = initial_states(self.model.game, own)
            self._outside[numbers] = simulator
        return self._outside[numbers]

    def _start_of(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Start values by single variables; x0 and v0 of a plant that is a function are those of x and v."""
        start: dict[str, Value] = {}
        names = {f"{stem}0{name[1:]}": name for name in self._initial for stem in (name[0],)}
        for name, value in values.items():
            stem, index = parse_name(name)
            if name in names:
                start[names[name]] = value
            elif not index and stem in ("x0", "v0"):
                start |= {own: value for key, own in names.items() if key.startswith(stem)}
                if self.model.indexed(stem):
                    start[name] = value
            else:
                start[name] = value
        return self.model.expanded(start)

    @staticmethod
    def _tolerance(start: Mapping[str, Value], tolerance: float) -> float:
        """That of the FMU."""
        own = start.get("tolerance_relative")
        return float(own) if own else tolerance

    @in_turn
    def walk(
        self,
        time: NDArray[np.float64],
        recorder: "Recorder",
        *,
        values: Mapping[str, Value],
        tolerance: float,
        inputs: Inputs | None = None,
    ) -> tuple[str, ...]:
        """Run through times (T,), in s, of any spacing, and let a recorder read at each.

        inputs: external disturbance d_ext, as in run. Returns what the FMU logged. Raises VariableError for a
        value that the FMU would not take, SimulationError for whatever it refuses. What the recorder raises
        ends the run.
        """
        start = self.model.expanded(values)
        checked = {name: check_value(self.model.variable(name), value) for name, value in start.items()}
        disturbance = disturbance_of(self.model, inputs, time)
        return self._walk(time, recorder, values=checked, tolerance=tolerance, disturbance=disturbance)

    def _walk(
        self,
        time: NDArray[np.float64],
        recorder: "Recorder",
        *,
        values: Mapping[str, Value],
        tolerance: float,
        schedule: "Mapping[float, Mapping[str, Value]] | None" = None,
        disturbance: NoInputs | None = None,
        plants: PlantFunctions | None = None,
        progress: Progress | None = None,
    ) -> tuple[str, ...]:
        slave = self._ready(plants)
        schedule = schedule or {}
        asked = [] if disturbance is None else disturbance.times
        samples = time.tolist()
        points = sorted({*samples, *schedule, *asked}) if schedule or asked else samples
        try:
            with noted_signals() as take_signals:
                self._initialize(values, samples, tolerance)
                if disturbance is not None:
                    disturbance.set(slave, points[0])
                slave.exitInitializationMode()
                if plants is not None:
                    plants.begin(slave, points[0])
                read = recorder.reader(slave)
                read(0)
                sample = 1
                for begin, end in pairwise(points):
                    take_signals()
                    if disturbance is not None:
                        disturbance.set(slave, begin)
                    if begin in schedule:
                        self._set(schedule[begin])
                    self._advance(begin, end, disturbance, plants)
                    if end == samples[sample]:
                        read(sample)
                        sample += 1
                        if progress is not None:
                            progress(end)
                slave.terminate()
        except FMICallException as error:
            raise SimulationError(self._said() or str(error)) from error
        return tuple(message for _, message in self._messages)

    @in_turn
    def at_start(self, names: Sequence[str], values: Mapping[str, Value]) -> NDArray[np.float64]:
        """Real variables (n,) right after initialization with these start values."""
        block = Block([self.model.variable(name) for name in names], 1)
        with self._initialized(values) as slave:
            block.reader(slave)(0)
        return np.asarray(block.values[0], dtype=np.float64)

    @in_turn
    def jacobian(
        self,
        states: Sequence[str],
        values: Mapping[str, Value],
        along: Sequence[Sequence[str]] | None = None,
    ) -> NDArray[np.float64]:
        """Derivatives (n, m) in 1/s of the rates of some states along others, after such an initialization.

        Entry [a, b] is the derivative of der(states[a]) along all of along[b] together, by default states[b].
        """
        along = [[name] for name in states] if along is None else along
        rates = [self.model.variable(f"der({name})").reference for name in states]
        columns = []
        with self._initialized(values) as slave:
            for names in along:
                references = [self.model.variable(name).reference for name in names]
                columns.append(slave.getDirectionalDerivative(rates, references, [1.0] * len(references)))
        return np.array(columns, dtype=np.float64).reshape(len(along), len(states)).T

    @contextmanager
    def _initialized(self, values: Mapping[str, Value]) -> Iterator[Any]:
        """The instance at the start of a run; what the FMU refuses becomes SimulationError."""
        self._ready()
        start = self.model.expanded(values)
        checked = {name: check_value(self.model.variable(name), value) for name, value in start.items()}
        try:
            self._initialize(checked, [0.0, self.model.stop_time], self.model.tolerance)
            self._slave.exitInitializationMode()
            yield self._slave
            self._slave.terminate()
        except FMICallException as error:
            raise SimulationError(self._said() or str(error)) from error

    def result(
        self,
        time: NDArray[np.float64],
        columns: Mapping[str, NDArray[np.float64]],
        *,
        parameters: Mapping[str, Value],
        changed: Mapping[str, Value],
        stop_time: float,
        step: float,
        tolerance: float,
        messages: tuple[str, ...],
    ) -> Result:
        """The Result of a walk, with what the model tells of its game and of the columns' units."""
        return Result(
            time=time,
            columns=columns,
            units={name: self.model.variable(name).unit or "" for name in columns},
            parameters=parameters,
            title=self.model.title,
            guid=self.model.guid,
            package_version=package_version(),
            stop_time=stop_time,
            step=step,
            tolerance=tolerance,
            messages=messages,
            changed=changed,
        )

    def _initialize(self, values: Mapping[str, Value], time: Sequence[float], tolerance: float) -> None:
        self._messages.clear()
        if self._used:
            self._slave.reset()
        self._used = True
        self._slave.setupExperiment(tolerance=tolerance, startTime=time[0], stopTime=time[-1])
        self._set(values)
        self._slave.enterInitializationMode()

    def _set(self, values: Mapping[str, Value]) -> None:
        variables = self.model.variables
        for kind, setter in (("Real", "setReal"), ("Integer", "setInteger"), ("Boolean", "setBoolean")):
            chosen = {name: value for name, value in values.items() if variables[name].type == kind}
            if chosen:
                references = [variables[name].reference for name in chosen]
                getattr(self._slave, setter)(references, list(chosen.values()))

    def _recorded(self, outputs: Sequence[str] | None) -> list[Variable]:
        if isinstance(outputs, str):  # as the command takes them
            outputs = split_names(outputs)
        if outputs is not None:
            return self.model.select([*outputs, "x_star", "nash_error", *JUDGED])
        return [self.model.variable(name) for name in self.model.signals()]

    def _log(self, _: object, _name: bytes, status: int, _category: bytes, message: bytes) -> None:
        text = message.decode("utf-8", errors="replace")
        logger.log(logging.WARNING if status == fmi2Warning else logging.DEBUG, "the FMU says: %s", text)
        self._messages.append((status, text))

    def _said(self) -> str:
        """The last error that the FMU logged; empty if it logged none."""
        return next((text for status, text in reversed(self._messages) if status >= fmi2Discard), "")


def _needed(name: str) -> bool:
    """Whether an instance on this machine needs a file of the archive."""
    return name.startswith((f"binaries/{fmpy.platform}/", "resources/"))


class Recorder(Protocol):
    """Takes what it wants from the instance at each sample of a run."""

    def reader(self, slave: Any) -> Callable[[int], None]:
        """Called at the first sample; what it returns is called at sample 0, 1, ... in turn."""


class Block:
    """Variables of one type, read in one call into a row of their values."""

    def __init__(self, variables: Sequence[Variable], rows: int) -> None:
        self.variables = variables
        kind = variables[0].type if variables else "Real"
        number = c_double if kind == "Real" else c_int
        self._getter = f"fmi2Get{kind}"
        self._references = _references(variables)
        self.values = np.empty((rows, len(variables)), dtype=np.float64 if kind == "Real" else np.int32)
        """(rows, variables)"""
        buffer: Any = self.values
        self._rows: Any = (number * len(variables) * rows).from_buffer(buffer) if variables else None

    def reader(self, slave: Any) -> Callable[[int], None]:
        """What reads all of them into a row."""
        get, component = getattr(slave, self._getter), slave.component
        references, count, rows = self._references, len(self.variables), self._rows

        def read(row: int) -> None:
            get(component, references, count, rows[row])

        return read if count else lambda _row: None

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The values by variable; integers below 2^53 are exact as floats."""
        return {
            variable.name: np.ascontiguousarray(self.values[:, position], dtype=np.float64)
            for position, variable in enumerate(self.variables)
        }


class _Columns:
    """Records variables of all types."""

    def __init__(self, variables: Sequence[Variable], samples: int) -> None:
        self._variables = variables
        self._blocks = [
            Block([variable for variable in variables if variable.type == kind], samples)
            for kind in ("Real", "Integer", "Boolean")
        ]

    def reader(self, slave: Any) -> Callable[[int], None]:
        readers = [block.reader(slave) for block in self._blocks if block.variables]

        def read(sample: int) -> None:
            for reader in readers:
                reader(sample)

        return read

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Columns in the order of the variables."""
        columns = {name: column for block in self._blocks for name, column in block.columns().items()}
        return {variable.name: columns[variable.name] for variable in self._variables}


def samples(start: float, stop: float, step: float) -> NDArray[np.float64]:
    """Times start, start + step, ..., stop."""
    if not (np.isfinite(start) and np.isfinite(stop) and start < stop):
        raise ExperimentError(f"stop_time = {in_seconds(stop)} is not after start_time = {in_seconds(start)}")
    if not (np.isfinite(step) and step > 0.0):
        raise ExperimentError(f"step = {step:g} s is not positive")
    intervals = (stop - start) / step
    if intervals > LARGEST_SAMPLES:
        raise ExperimentError(f"step = {step:g} s gives more than {LARGEST_SAMPLES} samples")
    whole = max(1, round(intervals))
    spacing = float(np.spacing(max(abs(start), abs(stop))))
    if abs(intervals - whole) <= 1e-9 * whole + 2.0 * spacing / step:
        times = start + (stop - start) * (np.arange(whole + 1) / whole)
    else:
        times = np.append(start + step * np.arange(int(intervals) + 1), stop)
    if np.diff(times).min() <= 0.0:
        raise ExperimentError(f"step = {step:g} s is below the resolution of times at {in_seconds(stop)}")
    return times


def _with_fine_start(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """The samples and, before the FINE_STEPS-th, a geometric grid; as far as the times resolve it."""
    begin, step = time[0], time[1] - time[0]
    last = min(FINE_STEPS, len(time) - 1)
    grid = begin + np.geomspace(FINEST * step, time[last] - begin, FINE_SAMPLES)[:-1]
    after = np.searchsorted(time, grid, side="right")
    apart = 10.0 * np.spacing(np.abs(time).max()) + 1e-9 * step
    clear = (grid - time[after - 1] > apart) & (time[after] - grid > apart)
    return np.union1d(time, grid[clear])


def _schedule(model: Model, changes: Changes, samples: NDArray[np.float64]) -> dict[float, dict[str, Value]]:
    """The changes by time, their values checked; a time that is nearly a sample's becomes that sample's."""
    schedule: dict[float, dict[str, Value]] = {}
    start, stop = float(samples[0]), float(samples[-1])
    times = {number_argument(when, "the time of a change", ExperimentError): when for when in changes}
    when = np.array(sorted(times), dtype=np.float64)
    for time, point in zip(when.tolist(), on_samples(when, samples).tolist(), strict=True):
        if not start <= point < stop:
            raise ExperimentError(
                f"the change at {in_seconds(time)} is outside [{start:.15g}, {stop:.15g}) s"
            )
        values = {
            name: check_value(model.variable(name), value, during_run=True)
            for name, value in model.expanded(changes[times[time]]).items()
        }
        schedule.setdefault(point, {}).update(values)
    return schedule


def _check_set_once(
    model: Model, values: Iterable[Mapping[str, Value]], stems: Sequence[str], by: str
) -> None:
    inputs = {variable.name for stem in stems for variable in model.indexed(stem).values()}
    twice = next((name for each in values for name in each if name in inputs), None)
    if twice is not None:
        raise ExperimentError(f"{twice} is set twice: by {by} and by start_values or changes")


def _references(variables: Iterable[Variable]) -> Any:
    numbers = [variable.reference for variable in variables]
    return (c_uint * len(numbers))(*numbers)
