"""Designs of experiments: grids, Latin hypercube and Sobol samples, random initial states."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arguments import value_of_text
from ..errors import MixedOrderGameError
from ..fmu.model import Value
from .sampling import Sampling

FloatArray = NDArray[np.float64]

LARGEST_AXIS = 1_000_000
COUNTED_RANGE = 3
PLAIN_RANGE = 2


class DesignError(MixedOrderGameError, ValueError):
    """A design that makes no sense: an empty grid, a range without extent, a count that is not positive."""


@dataclass(frozen=True)
class Range:
    """The interval from low to high, uniform, or uniform in the logarithm."""

    low: float
    high: float
    logarithmic: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.low) and np.isfinite(self.high) and self.low < self.high):
            raise DesignError(f"the range {self.low:g}:{self.high:g} does not go up")
        if self.logarithmic and self.low <= 0.0:
            raise DesignError(f"the logarithmic range {self.low:g}:{self.high:g} does not begin above 0")

    def at(self, part: FloatArray) -> FloatArray:
        """Values at parts from 0 (low) to 1 (high)."""
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** part)
        return np.asarray(self.low + (self.high - self.low) * part)

    def points(self, count: int) -> tuple[float, ...]:
        """Count equally spaced values, both ends included."""
        if not 2 <= count <= LARGEST_AXIS:  # noqa: PLR2004 - both ends
            raise DesignError(f"a range is divided into 2 to {LARGEST_AXIS} values, not {count}")
        values = self.at(np.linspace(0.0, 1.0, count))
        values[[0, -1]] = self.low, self.high
        return tuple(values.tolist())


def range_of_text(text: str) -> Range:
    """LOW:HIGH or LOW:HIGH:log."""
    parts, logarithmic = _range_parts(text)
    if len(parts) != PLAIN_RANGE:
        raise DesignError(f"{text!r} is not a range: LOW:HIGH or LOW:HIGH:log expected")
    return Range(_number(parts[0]), _number(parts[1]), logarithmic)


def grid_of_text(text: str) -> tuple[Value, ...]:
    """Values 1,2,5 or true,false, or FIRST:LAST:COUNT, or FIRST:LAST:COUNT:log."""
    if ":" not in text:
        values = tuple(_value(part) for part in text.split(","))
        if len(set(values)) != len(values):
            raise DesignError(f"{text!r} lists a value twice")
        return values
    parts, logarithmic = _range_parts(text)
    if len(parts) != COUNTED_RANGE or not parts[2].isdigit():
        raise DesignError(
            f"{text!r} is not a grid: 1,2,5 or FIRST:LAST:COUNT or FIRST:LAST:COUNT:log expected"
        )
    return Range(_number(parts[0]), _number(parts[1]), logarithmic).points(int(parts[2]))


def sample(ranges: Mapping[str, Range], count: int, sampling: Sampling, seed: int) -> FloatArray:
    """Points of a Latin hypercube or of a scrambled Sobol sequence, (count, number of ranges).

    Raises DesignError for a count that is not positive or, for Sobol, not a power of two.
    """
    from scipy.stats import qmc

    if not 1 <= count <= LARGEST_AXIS:
        raise DesignError(f"a design has 1 to {LARGEST_AXIS} samples, not {count}")
    generator = np.random.default_rng([seed, 1])
    if sampling is Sampling.SOBOL:
        if count & (count - 1):
            below = 1 << (count.bit_length() - 1)
            raise DesignError(
                f"a Sobol design is balanced for a power of two: {below} or {2 * below}, not {count}"
            )
        unit = qmc.Sobol(len(ranges), rng=generator).random(count)
    else:
        unit = qmc.LatinHypercube(len(ranges), rng=generator).random(count)
    columns = [each.at(unit[:, k]) for k, each in enumerate(ranges.values())]
    return np.column_stack(columns)


def initial_states(
    count: int, box: Range, players: int, dimension: int, seed: int, *, stream: int = 2
) -> FloatArray:
    """Uniform random entries, (count, players, dimension); state k does not depend on count."""
    shape = (players, dimension)
    draws = (np.random.default_rng([seed, stream, k]).random(shape) for k in range(count))
    return np.array([box.at(draw) for draw in draws]).reshape(count, *shape)


def _range_parts(text: str) -> tuple[list[str], bool]:
    parts = text.split(":")
    logarithmic = parts[-1].strip() == "log"
    return (parts[:-1] if logarithmic else parts), logarithmic


def _value(text: str) -> Value:
    try:
        value = value_of_text(text)
    except ValueError as error:
        raise DesignError(str(error)) from None
    return value if isinstance(value, bool) else _number(text)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise DesignError(f"{text!r} is not a number") from None
    if not np.isfinite(value):
        raise DesignError(f"{text!r} is not finite")
    return value
