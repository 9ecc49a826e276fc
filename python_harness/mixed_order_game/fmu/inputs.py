"""External disturbances of a run: arrays, functions of time, and feedback of the state."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import array_argument
from ..errors import ExperimentError
from ..names import parse_name
from ..times import in_seconds
from .functions import ABSOLUTE, called, end_of_step, step_factor
from .model import Model
from .reals import Reals
from .schedule import Disturbance

FloatArray = NDArray[np.float64]

Inputs = Disturbance | Callable[[float], ArrayLike] | ArrayLike
"""External disturbance d_ext: rows over time, a function of the time in s giving
(N, D), or an array (N, D) or (T, N, D)."""

Dynamics = Callable[[float, NDArray[np.float64], NDArray[np.float64]], ArrayLike]
Feedback = Dynamics | Mapping[int, Dynamics]
"""Unknown dynamics g(t, x, v), carried by d_ext: t in s, x and v of all players (N, D), v NaN for order 1. It
gives (N, D); those of single players, by 1-based number, (D,) each."""

SHORTEST = 2e-3
"""Of the times between which feedback is asked, in times between two communication points."""


class NoInputs:
    """The external disturbance d_ext at the communication points; this one is none."""

    def __init__(self, model: Model, times: Sequence[float] = ()) -> None:
        self.times = times  # communication points that the disturbance asks for
        self._shape = (model.players, model.dimension)
        self._inside = np.array([number not in model.external for number in range(1, model.players + 1)])
        names = model.indexed("d_ext")
        self._reals = Reals([names[index].reference for index in sorted(names)])

    def set(self, slave: Any, time: float) -> None:
        """Set the inputs for the step that begins at a communication point."""

    def until(self, _time: float, end: float) -> float:
        """When they are to be set again: at the next communication point, or before."""
        return end

    def _give(self, slave: Any, values: FloatArray, *rates: FloatArray) -> None:
        """Set values (N, D) and, if given, their rates, all of them 0 where a plant is outside."""
        if not self._inside.all() and np.any(values[~self._inside]):
            pushed = np.argmax(~self._inside & np.any(values, axis=1)) + 1
            raise ExperimentError(
                f"player {pushed}, whose plant is outside, has no d_ext: add the push to the plant"
            )
        self._reals.tell(slave, *(each[self._inside] for each in (values, *rates)))


class Function(NoInputs):
    """A function of the time in s, asked at every communication point."""

    def __init__(self, model: Model, function: Callable[[float], ArrayLike]) -> None:
        super().__init__(model)
        self._function = function

    def set(self, slave: Any, time: float) -> None:
        """Set the function's value."""
        value = array_argument(self._function(time), f"inputs({time:.15g})", ExperimentError)
        if value.shape != self._shape:
            raise ExperimentError(f"inputs({time:.15g}) has the shape {value.shape}, not {self._shape}")
        check_finite(value, f"inputs({time:.15g})")
        self._give(slave, value)


class Rows(NoInputs):
    """Rows (T, N, D), each held from its time on, or changing at a rate (T, N, D) until the next one."""

    def __init__(
        self,
        model: Model,
        times: Sequence[float],
        values: NDArray[np.float64],
        rates: NDArray[np.float64] | None = None,
    ) -> None:
        super().__init__(model, times)
        self._rows = dict(zip(times, range(len(times)), strict=True))
        self._values = values
        self._rates = rates

    def set(self, slave: Any, time: float) -> None:
        """Set the row of that time, if there is one."""
        row = self._rows.get(time)
        if row is None:
            return
        self._give(slave, self._values[row], *([] if self._rates is None else [self._rates[row]]))


class FeedbackFunction(NoInputs):
    """Unknown dynamics g(t, x, v), straight from where they are asked on.

    They are asked as often as the tolerance wants it, by how far off the last line was at its end.
    """

    def __init__(self, model: Model, feedback: Feedback, tolerance: float) -> None:
        super().__init__(model)
        self._tolerance, self._step = tolerance, 0.0
        self._end, self._shortest = -np.inf, 0.0
        if not callable(feedback) and not isinstance(feedback, Mapping):
            raise ExperimentError(f"feedback is {feedback!r}, expected a function or functions by player")
        self._functions = None if callable(feedback) else dict(feedback)
        self._whole = feedback if callable(feedback) else None
        for number, function in (self._functions or {}).items():
            if number not in range(1, model.players + 1) or isinstance(number, bool):
                raise ExperimentError(
                    f"feedback has the player {number!r}, expected a number from 1 to {model.players}"
                )
            if number in model.external:
                raise ExperimentError(
                    f"player {number}, whose plant is outside, has no d_ext: add the feedback to the plant"
                )
            if not callable(function):
                raise ExperimentError(f"the feedback of player {number} is {function!r}, expected a function")
        self._order = model.order
        signals = model.select(["x", *(["v"] if model.indexed("v") else [])])
        self._signals = Reals([variable.reference for variable in signals])
        places = [(stem == "v", *index) for stem, index in (parse_name(each.name) for each in signals)]
        self._places = tuple(np.array(places).T - [[0], [1], [1]])
        self._last: tuple[float, FloatArray, FloatArray] | None = None

    def set(self, slave: Any, time: float) -> None:
        """Set the functions' values, and as their rates what they were since the last time."""
        signals = np.full((2, *self._shape), np.nan)
        signals[self._places] = self._signals.read(slave)
        value = self._asked(time, signals[0], signals[1])
        rate = np.zeros(self._shape)
        if self._last is not None and self._last[0] < time:
            begin, before, went = self._last
            h = time - begin
            rate = (value - before) / h
            bound = self._tolerance * (ABSOLUTE + np.abs(signals[0]))
            self._step = h * step_factor(float(np.max(h * h * np.abs(rate - went) / bound)), 2)
        self._give(slave, value, rate)
        self._last = (time, value, rate)

    def until(self, time: float, end: float) -> float:
        """When they are to be asked again: the next communication point or a time before it."""
        if end != self._end:
            self._end, self._shortest = end, SHORTEST * (end - time)
        return end_of_step(time, max(self._step, self._shortest), end)

    def _asked(self, time: float, x: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        at = f"at {in_seconds(time)}"
        if self._whole is not None:
            value = called(self._whole, (time, x, v), self._shape, f"feedback {at}")
        else:
            value = np.zeros(self._shape)
            for number, function in cast("dict[int, Dynamics]", self._functions).items():
                what = f"the feedback of player {number} {at}"
                value[number - 1] = called(function, (time, x.copy(), v.copy()), self._shape[1:], what)
        if not np.all(np.isfinite(value)):
            i = int(np.argwhere(~np.isfinite(value))[0, 0])
            hint = "" if self._order[i] > 1 else "; its v is NaN, as it has order 1"
            raise ExperimentError(
                f"the feedback of player {i + 1} {at} is {value[i].tolist()}, expected finite numbers{hint}"
            )
        return value


def disturbance_of(
    model: Model,
    inputs: Inputs | None,
    samples: NDArray[np.float64],
    feedback: Feedback | None = None,
    tolerance: float = 1e-6,
) -> NoInputs:
    """The inputs of a run, their shapes and values checked as far as they are known."""
    if feedback is not None:
        if inputs is not None:
            raise ExperimentError("inputs and feedback both set d_ext: add the disturbance in the feedback")
        return FeedbackFunction(model, feedback, tolerance)
    if inputs is None:
        return NoInputs(model)
    shape = (model.players, model.dimension)
    if isinstance(inputs, Disturbance):
        return _rows_of(model, inputs, samples)
    if callable(inputs):
        return Function(model, inputs)
    array = array_argument(inputs, "inputs", ExperimentError)
    if array.shape not in (shape, (len(samples), *shape)):
        raise ExperimentError(f"inputs has the shape {array.shape}, not {shape} or {(len(samples), *shape)}")
    check_finite(array, "inputs")
    return Rows(model, samples.tolist(), np.broadcast_to(array, (len(samples), *shape)))


def _rows_of(model: Model, inputs: Disturbance, samples: NDArray[np.float64]) -> Rows:
    """What is in force at the start, and every row between start and stop."""
    shape = (model.players, model.dimension)
    if inputs.values.shape[1:] != shape:
        raise ExperimentError(f"a row of inputs has the shape {inputs.values.shape[1:]}, not {shape}")
    times = on_samples(inputs.time, samples)
    last = np.diff(times, append=np.inf) > 0.0  # of rows that rounding put on one sample
    moved = Disturbance(times[last], inputs.values[last], inputs.linear)
    start, stop = samples[[0, -1]]
    points = [float(start), *moved.time[(start < moved.time) & (moved.time < stop)].tolist()]
    values, rates = zip(*map(moved.at, points), strict=True)
    return Rows(model, points, np.array(values), np.array(rates) if inputs.linear else None)


def on_samples(times: NDArray[np.float64], samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """The times, those of a sample put right where rounding has moved them."""
    after = np.clip(np.searchsorted(samples, times), 1, len(samples) - 1)
    before = after - 1
    nearest = np.where(times - samples[before] < samples[after] - times, samples[before], samples[after])
    span, largest = samples[-1] - samples[0], np.abs(samples).max()
    slack = 1e-9 * span + 4.0 * np.spacing(largest)
    return np.where(np.abs(times - nearest) <= slack, nearest, times)


def check_finite(array: NDArray[np.float64], name: str) -> None:
    """Raises ExperimentError for entries that are not finite."""
    if not np.all(np.isfinite(array)):
        raise ExperimentError(f"{name} must be finite")
