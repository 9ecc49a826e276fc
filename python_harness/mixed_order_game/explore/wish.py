"""What the page asks for: variables of the FMU that are changed, pushes during the run, and its end."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import number_argument
from ..errors import MixedOrderGameError
from ..fmu.model import Model, Value, check_value
from ..fmu.schedule import Disturbance

FloatArray = NDArray[np.float64]

MOST_PUSHES = 100


class WishError(MixedOrderGameError):
    """A request that the page would not make, from an address edited by hand, say."""


@dataclass(frozen=True)
class Push:
    """d_ext[player,coordinate] (1-based) of a size, from a time in s on for a duration in s."""

    time: float
    player: int
    coordinate: int
    size: float
    duration: float


@dataclass(frozen=True)
class Wish:
    """Start values that differ from the FMU's, by its names, pushes, and the end of the run in s."""

    changes: Mapping[str, Value]
    pushes: tuple[Push, ...]
    stop_time: float

    def disturbance(self, model: Model) -> Disturbance | None:
        """All pushes together as rows over time; None without any."""
        if not self.pushes:
            return None
        ends = [(push.time, push.time + push.duration) for push in self.pushes]
        times = np.unique([0.0, *(time for pair in ends for time in pair)])
        values = np.zeros((len(times), model.players, model.dimension))
        for push, (begin, end) in zip(self.pushes, ends, strict=True):
            rows = (begin <= times) & (times < end)
            values[rows, push.player - 1, push.coordinate - 1] += push.size
        return Disturbance(times, values)


def wish_of(data: Any, model: Model) -> Wish:
    """The wish in a decoded JSON object.

    Raises WishError, and VariableError for a change that the FMU would not take.
    """
    if not isinstance(data, dict):
        raise WishError(f"{data!r} is not an object with changes, pushes and stop_time")
    unknown = sorted(data.keys() - {"changes", "pushes", "stop_time"})
    if unknown:
        raise WishError(f"there is no {unknown[0]}, expected changes, pushes and stop_time")
    changes, pushes = data.get("changes", {}), data.get("pushes", [])
    if not isinstance(changes, dict):
        raise WishError(f"changes is {changes!r}, expected values by name")
    if not isinstance(pushes, list) or len(pushes) > MOST_PUSHES:
        raise WishError(f"pushes is no list of at most {MOST_PUSHES}")
    stop_time = number_argument(data.get("stop_time", model.stop_time), "stop_time", WishError)
    if not (np.isfinite(stop_time) and stop_time > 0.0):
        raise WishError(f"the end of the run is {stop_time:g} s, expected a positive number")
    return Wish(
        changes={
            name: check_value(model.variable(name), value) for name, value in model.expanded(changes).items()
        },
        pushes=tuple(_push(push, model) for push in pushes),
        stop_time=stop_time,
    )


def _push(data: Any, model: Model) -> Push:
    names = ("time", "player", "coordinate", "size", "duration")
    if not isinstance(data, Sequence) or isinstance(data, str) or len(data) != len(names):
        raise WishError(f"{data!r} is not a push: {', '.join(names)} expected")
    time, player, coordinate, size, duration = (
        number_argument(value, f"the push's {name}", WishError)
        for value, name in zip(data, names, strict=True)
    )
    for name, value, most in (
        ("player", player, model.players),
        ("coordinate", coordinate, model.dimension),
    ):
        if value not in range(1, most + 1):
            raise WishError(f"the push's {name} is {value:g}, expected 1 to {most}")
    if not (np.isfinite([time, size, duration]).all() and time >= 0.0 and duration > 0.0):
        raise WishError(
            f"the push {data!r} needs a time of at least 0, a finite size and a positive duration"
        )
    return Push(time, int(player), int(coordinate), size, duration)
