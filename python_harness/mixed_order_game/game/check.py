"""Checks a game file and tells problems with their places.

The judge is the host tool that makes FMUs: a game is valid when it says so. It stops at the first problem and
tells where every entry of the file stands; the JSON Schema finds those problems after it that a schema can.
"""

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import GameError
from ..extras import has, need
from ..files.reading import ReadError, expect_file, read_text, toml_of
from ..fmu.build import game_file
from .host_tool import ask
from .schema import game_schema

LONGEST_TEXT = 40
LONGEST_LIST = 4

Entry = tuple[str | int, ...]
"""Keys and 0-based list positions; () is the file itself."""


@dataclass(frozen=True, order=True)
class Problem:
    """One thing wrong with a game file. Line and column count from one."""

    line: int
    column: int
    sentence: str


@dataclass(frozen=True)
class _Found:
    entry: Entry
    sentence: str


def check_game(game: Path | str) -> tuple[Problem, ...]:
    """Find the problems in a game file; without the package jsonschema the first one only.

    Parameters
    ----------
    game
        A game file (.toml) or a game of the package by its name.

    Returns
    -------
    tuple of Problem
        Line, column and sentence of each; empty if the file is valid.

    Raises
    ------
    GameError
        If there is no such file (a FileNotFoundError, too).
    BuildError
        If the installation lacks the host tool.

    Examples
    --------
    >>> mog.check_game("five_vehicles")
    ()
    """
    game = game_file(game)
    expect_file(game, "game file", GameError)
    answer = ask("--check", game)  # problem is None if it is valid
    if answer["problem"] is None:
        return ()
    told = answer["problem"]
    problems = {Problem(told["line"], told["column"], told["message"])}
    try:
        document = toml_of(read_text(game))
    except ReadError:  # not UTF-8, not TOML, or a fine point of TOML on which parsers differ
        document = {}
    if document and has("jsonschema"):
        places = answer["places"]
        others = (each for each in _violations(document) if _shown(each.entry) != told["entry"])
        problems |= {Problem(*_place(each.entry, places), each.sentence) for each in others}
    return tuple(sorted(problems))


def _place(entry: Entry, places: Mapping[str, Sequence[int]]) -> tuple[int, int]:
    """Line and column of an entry, of what would hold it if there is no such entry."""
    while entry and _shown(entry) not in places:
        entry = entry[:-1]
    line, column = places[_shown(entry)] if entry else (1, 1)
    return line, column


def _violations(document: Mapping[str, Any]) -> Iterator[_Found]:
    """What the JSON Schema finds, in the words of the host tool."""
    jsonschema = need("jsonschema")
    players, dimension = document.get("player"), document.get("dimension")
    schema = game_schema(
        players=len(players) if isinstance(players, list) else None,
        dimension=dimension if isinstance(dimension, int) else None,
    )
    checker = jsonschema.Draft202012Validator.TYPE_CHECKER.redefine_many(
        {
            "integer": lambda _, value: _is_integer(value),
            "number": lambda _, value: (
                _is_integer(value) or (isinstance(value, float) and math.isfinite(value))
            ),
        }
    )
    validator = jsonschema.validators.extend(jsonschema.Draft202012Validator, type_checker=checker)
    for error in validator(schema).iter_errors(document):
        yield from _told(tuple(error.absolute_path), error, schema)


def _told(entry: Entry, error: Any, schema: Mapping[str, Any]) -> Iterator[_Found]:
    """One violation as one sentence for each entry that it is about."""
    if "propertyNames" in error.absolute_schema_path:
        named = (*entry, error.instance)
        expected = schema["properties"]["parameters"]["propertyNames"]["x-expected"]
        yield _Found(named, f"{_shown(named)} stands there, expected {expected}")
    elif error.validator == "additionalProperties":
        known = list(error.schema["properties"])
        for key in error.instance:
            if key not in known:
                near = difflib.get_close_matches(key, known, n=1)
                hint = (
                    f"the closest known key is {near[0]}" if near else f"expected one of {', '.join(known)}"
                )
                yield _Found(
                    (*entry, key), f'"{_readable(key)}" is an unknown key of {_shown(entry)}, {hint}'
                )
    elif error.validator == "required":
        for key in error.validator_value:
            if key not in error.instance:
                expected = _expected(error.schema["properties"][key], schema)
                yield _Found((*entry, key), f"{_shown((*entry, key))} is missing, expected {expected}")
    else:
        expected = _expected(error.schema, schema)
        yield _Found(entry, f"{_shown(entry)} is {_value(error.instance)}, expected {expected}")


def _expected(each: Mapping[str, Any], schema: Mapping[str, Any]) -> str:
    """What a part of the schema expects, in words."""
    while "x-expected" not in each:
        each = schema["$defs"][each["$ref"].rsplit("/", 1)[1]] if "$ref" in each else each["then"]
    return str(each["x-expected"])


def _shown(entry: Entry) -> str:
    """("player", 1, "cost") as player[2].cost."""
    text = "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in entry)
    return text.removeprefix(".") or "the game definition"


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{_readable(value)}"'
    if isinstance(value, int | float):
        return repr(value).removesuffix(".0")
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, Sequence):
        plain = len(value) <= LONGEST_LIST and all(
            isinstance(item, int | float) and not isinstance(item, bool) for item in value
        )
        return f"[{', '.join(map(_value, value))}]" if plain else f"a list of {len(value)}"
    return "a date or time"


def _readable(text: str) -> str:
    """Short enough for a message, and in one line."""
    shown = text if len(text) <= LONGEST_TEXT else text[:LONGEST_TEXT] + "..."
    return "".join(each if each.isprintable() else " " for each in shown)


def _is_integer(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
