"""A game file for some of a game's players: what their FMU carries, and nothing of the others.

Of the players elsewhere it says their orders alone. It keeps the edges along which its own players hear and
the named parameters that their texts use.
"""

import json
import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from ..errors import GameError
from .definition import PARTS, Table, initial_estimates, with_defaults

KEY = re.compile(r"[A-Za-z0-9_-]+")
NAME = re.compile(r"[A-Za-z_]\w*")


def part_of_game(tables: Table, players: Collection[int]) -> dict[str, Any]:
    """The tables of a valid game with the 1-based players given alone.

    Raises GameError for players that the game does not have, and for a file that holds a part itself.
    """
    whole = with_defaults(tables)
    held = sorted(set(players))
    count = len(whole["player"])
    if any(player.get("elsewhere") for player in whole["player"]):
        raise GameError("the game file holds a part of a game already, expected a whole game")
    wrong = [number for number in held if not 1 <= number <= count]
    if wrong or not held:
        raise GameError(
            f"the players are {', '.join(map(str, held)) or 'none'}, expected numbers from 1 to {count}"
        )
    if len(held) == count:
        return whole
    tables_of = [
        _player(whole, number) if number in held else {"elsewhere": True, "order": player["order"]}
        for number, player in enumerate(whole["player"], 1)
    ]
    edges = [edge for edge in whole["graph"]["edges"] if _is_heard(edge, held, directed=_directed(whole))]
    named = "player" if len(held) == 1 else "players"
    part = {
        **{key: value for key, value in whole.items() if key not in ("equilibrium", "parameters", "player")},
        "title": f"{whole['title']}: {named} {', '.join(map(str, held))}",
        "graph": {**whole["graph"], "edges": edges},
    }
    used = {name for number in held for text in _texts(tables_of[number - 1]) for name in NAME.findall(text)}
    parameters = {name: value for name, value in whole.get("parameters", {}).items() if name in used}
    return {**part, **({"parameters": parameters} if parameters else {}), "player": tables_of}


def toml_of_game(tables: Table) -> str:
    """The text of a game file: values in one line each, as in files written by hand."""
    lines = []
    for key, value in tables.items():
        if not isinstance(value, Mapping) and key != "player":
            lines.append(f"{key} = {_value(value)}")
    for key, value in tables.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{key}]", *_entries(value)]
    for player in tables["player"]:
        lines += ["", "[[player]]", *_entries(player)]
    return "\n".join(lines) + "\n"


def _entries(table: Table) -> list[str]:
    return [f"{_key(key)} = {_value(value)}" for key, value in table.items()]


def _key(key: str) -> str:
    return key if KEY.fullmatch(key) else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_entries(value)) + " }" if value else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _directed(whole: Table) -> bool:
    return bool(whole["graph"].get("directed", False))


def _is_heard(edge: list[Any], held: Collection[int], *, directed: bool) -> bool:
    """Whether a held player hears along an edge [i, j, ...]; along a directed one j hears i."""
    return edge[1] in held or (not directed and edge[0] in held)


def _player(whole: Mapping[str, Any], number: int) -> dict[str, Any]:
    """A player's table; where its estimates begin at the others' x0, with these numbers."""
    player = dict(whole["player"][number - 1])
    if player.get("y0") == "x0":
        player["y0"] = initial_estimates(whole["player"], number - 1, whole["dimension"])
    return player


def _texts(player: Mapping[str, Any]) -> Iterator[str]:
    for part in PARTS:
        expression = player.get(part, {}).get("expression", [])
        yield from [expression] if isinstance(expression, str) else expression
