"""Checks a game file and tells problems with their lines.

The judge is the host tool that makes FMUs: a game is valid when it says so. It stops at the first problem and
names the entry; the line comes from the file's syntax tree, and the JSON Schema finds those after it that a
schema can.
"""

import difflib
import math
import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BuildError, GameError, reason
from ..files.reading import ReadError, expect_file, read_text, toml_of
from ..fmu.build import game_file, host_tool
from .positions import Path as Entry
from .positions import Positions
from .schema import game_schema

NOT_TOML = re.compile(r"line (\d+)(?:, column \d+)? of the game definition (.*)")
UNKNOWN_KEY = re.compile(r'"(.*)" is an unknown key of (\S+|the game definition), ')
ENTRY = re.compile(r"((?:[A-Za-z_]\w*)(?:\.\w+|\[\d+\])*) (?:is|leaves|has) ")
EXPRESSION = re.compile(r"([A-Za-z_]\w*(?:\.\w+|\[\d+\])*), line (\d+), column \d+: .*")
STEP = re.compile(r"(\w+)|\[(\d+)\]")

LONGEST_TEXT = 40
LONGEST_LIST = 4


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a game file."""

    line: int  # 1-based
    sentence: str


@dataclass(frozen=True)
class _Found:
    entry: Entry
    sentence: str


def check_game(game: Path | str) -> tuple[Problem, ...]:
    """The problems found in a game file, or in a game of the package by its name; empty if it is valid.

    Raises GameError if there is no such file, BuildError if the installation lacks the host tool.
    """
    game = game_file(game)
    expect_file(game, "game file", GameError)
    sentence = _judge(game)
    if sentence is None:
        return ()
    not_toml = NOT_TOML.fullmatch(sentence)
    if not_toml is not None:
        return (Problem(int(not_toml[1]), f"the file {not_toml[2]}"),)
    try:
        text = read_text(game)
        document = toml_of(text)
    except ReadError:  # not UTF-8, or a fine point of TOML on which parsers differ
        return (Problem(1, sentence),)
    positions = Positions(text)
    first = _Found(_entry_of(sentence, document), sentence)
    expression = EXPRESSION.fullmatch(sentence)
    if expression is not None:  # which knows its line, the text's own may be an earlier one
        first = _Found(_parsed(expression[1]), sentence)
    found = [first, *(each for each in _violations(document) if each.entry != first.entry)]
    problems = {Problem(positions.line(each.entry), each.sentence): None for each in found}
    if expression is not None:
        del problems[Problem(positions.line(first.entry), sentence)]
        problems[Problem(int(expression[2]), sentence)] = None
    return tuple(sorted(problems, key=lambda problem: problem.line))


def _judge(game: Path) -> str | None:
    """The host tool's sentence about a game; None if it is valid."""
    tool = host_tool()
    try:
        finished = subprocess.run(
            [str(tool), "--check", str(game)],
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            check=False,
        )
    except OSError as error:
        raise BuildError(f"cannot run {tool}: {reason(error)}") from error
    if finished.returncode == 0:
        return None
    if finished.returncode != 1:
        raise BuildError(f"{tool.name} ended with status {finished.returncode}: {finished.stderr.strip()}")
    return " ".join(finished.stderr.split()).removeprefix(f"{game}: ")


def _entry_of(sentence: str, document: Mapping[str, Any]) -> Entry:
    """The entry that a sentence of the host tool is about; () if it is about the whole game."""
    unknown = UNKNOWN_KEY.match(sentence)
    if unknown is not None:
        table = () if unknown[2] == "the game definition" else _parsed(unknown[2])
        keys = _at(document, table)
        cut = unknown[1].removesuffix(
            "..."
        )  # of a long key, control characters replaced, only the begin is told
        near = (key for key in keys if cut != unknown[1] and _readable(key).startswith(cut))
        key = unknown[1] if unknown[1] in keys else next(near, unknown[1])
        return (*table, key)
    for name in _names_of_parameters(document):  # that need not be words
        if sentence.startswith(f"parameters.{name} is "):
            return "parameters", name
    entry = ENTRY.match(sentence)
    return () if entry is None else _parsed(entry[1])


def _names_of_parameters(document: Mapping[str, Any]) -> Iterable[str]:
    parameters = document.get("parameters")
    return parameters if isinstance(parameters, Mapping) else ()


def _parsed(path: str) -> Entry:
    """player[2].cost as ("player", 1, "cost")."""
    return tuple(key or int(number) - 1 for key, number in STEP.findall(path))


def _at(document: Any, entry: Entry) -> Any:
    for step in entry:
        document = document[step]
    return document


def _violations(document: Mapping[str, Any]) -> Iterator[_Found]:
    """What the JSON Schema finds, in the words of the host tool."""
    import jsonschema

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
    validator = jsonschema.validators.extend(jsonschema.Draft202012Validator, type_checker=checker)  # type: ignore[no-untyped-call]
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
