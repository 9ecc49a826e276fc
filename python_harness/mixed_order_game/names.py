"""Structured names of FMI 2.0 with 1-based indices: x[1,2] is the stem x with index (1, 2)."""

import re
from collections.abc import Iterable

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
