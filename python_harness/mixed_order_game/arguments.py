"""What callers and command lines give as numbers and words."""

from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import MixedOrderGameError

WORDS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


def value_of_text(text: str) -> float | bool:
    """A number, or one of WORDS in small letters or capitals. Raises ValueError."""
    word = text.strip().lower()
    if word in WORDS:
        return WORDS[word]
    try:
        return float(word)
    except ValueError:
        raise ValueError(f"a number, true or false (yes, no, on, off) expected, not {text!r}") from None


def array_argument(value: object, name: str, error: type[MixedOrderGameError]) -> NDArray[np.float64]:
    """The value as an array. Raises the error, with the argument's name, for what is no array of numbers."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):  # also of rows that differ in length
        raise error(f"{name} is not an array of numbers") from None


def number_argument(value: object, name: str, error: type[MixedOrderGameError]) -> float:
    """The value as a float. Raises the error, with the argument's name, for anything but a number."""
    scalar: Any = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if isinstance(scalar, bool | np.bool_) or not isinstance(scalar, Real):
        raise error(f"{name} is {value!r}, expected a number")
    return float(scalar)
