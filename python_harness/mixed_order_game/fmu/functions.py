"""Functions of the user's that a run asks, and the steps that they are asked at."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import array_argument
from ..errors import ExperimentError, SimulationError, reason

ABSOLUTE = 0.01
"""Absolute tolerance in parts of the relative one, as in the FMU."""
GROWTH, SHRINKING, SAFETY = 1.5, 0.1, 0.8
"""From one step to the next."""


def called(
    function: Callable[..., ArrayLike], arguments: tuple[object, ...], shape: tuple[int, ...], what: str
) -> NDArray[np.float64]:
    """What a function gives.

    Raises SimulationError for what it raises, ExperimentError for another shape.
    """
    try:
        value = function(*arguments)
    except Exception as error:
        raise SimulationError(f"{what}: {type(error).__name__}: {reason(error)}") from error
    array = array_argument(value, what, ExperimentError)
    if array.shape != shape:
        raise ExperimentError(f"{what} has the shape {array.shape}, not {shape}")
    return array


def step_factor(error: float, order: int) -> float:
    """By what the next step is longer, for an error in parts of the tolerance of a method of that order."""
    factor = SAFETY * float(max(error, 1e-9)) ** (-1.0 / (order + 1))
    return float(min(max(factor, SHRINKING), GROWTH))


def end_of_step(time: float, h: float, end: float) -> float:
    """time + h, or what leaves no rest that is much shorter than the step."""
    left = end - time
    if left <= 1.01 * h:
        return end
    return time + (0.5 * left if left < 2.0 * h else h)
