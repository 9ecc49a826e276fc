"""Structured names of FMI 2.0 with 1-based indices: x[1,2] is the stem x with index (1, 2)."""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

INDEXED = re.compile(r"([^\[\]]+)\[(\d+(?:,\d+)*)\]")


def parse_name(name: str) -> tuple[str, tuple[int, ...]]:
    """Stem and 1-based index; a name without brackets has the index ()."""
    match = INDEXED.fullmatch(name)
    if match is None:
        return name, ()
    return match[1], tuple(map(int, match[2].split(",")))


def split_names(text: str) -> list[str]:
    """Names of a comma-separated list; the commas inside brackets belong to the names."""
    return [name.strip() for name in re.split(r",(?![^\[]*\])", text) if name.strip()]


def indices_of(names: Iterable[str], stem: str) -> dict[tuple[int, ...], str]:
    """Names of one stem by their 1-based indices."""
    parsed = ((parse_name(name), name) for name in names)
    return {index: name for (each, index), name in parsed if each == stem}


def gather(
    columns: Mapping[str, NDArray[np.float64]], stem: str, shape: Sequence[int]
) -> NDArray[np.float64] | None:
    """Columns stem[i,...] of (T,) samples as one array (T, *shape), NaN where there is no column.

    None if no column of that stem exists.
    """
    found = indices_of(columns, stem)
    if not found:
        return None
    samples = len(columns[next(iter(found.values()))])
    array = np.full((*shape, samples), np.nan)
    for index, name in found.items():
        array[tuple(position - 1 for position in index)] = columns[name]
    return np.ascontiguousarray(np.moveaxis(array, -1, 0))
