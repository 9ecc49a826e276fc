"""A game definition as the reader of game files understands it: defaults applied, expressions found.

What reads costs, dynamics or disturbances as coefficients asks here first whether they are all there is.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import GameError

Table = Mapping[str, Any]
Expressions = Mapping[str, Sequence[int]]
"""1-based numbers of the players whose cost, dynamics or disturbance has an expression."""

PARTS = {"cost": "costs", "dynamics": "dynamics", "disturbance": "disturbances"}
"""Keys of a player that may have an expression, and their names in sentences."""

OF_THE_OTHER_ORDER = {1: "v0", 2: "z0"}
"""A default that players of an order leave."""


@dataclass(frozen=True)
class NamedParameter:
    """A named parameter of a game's expressions, as the game file has it."""

    name: str
    value: Any  # a number, a list of numbers or a list of rows
    min: float | None = None
    max: float | None = None
    unit: str = ""
    description: str = ""
    fixed: bool = False  # part of the expressions, and no variable of the FMU


def named_parameters(tables: Table) -> tuple[NamedParameter, ...]:
    """The [parameters] of a valid game file, in its order."""
    return tuple(
        NamedParameter(name, **entry) if isinstance(entry, Mapping) else NamedParameter(name, entry)
        for name, entry in tables.get("parameters", {}).items()
    )


def with_defaults(tables: Table) -> dict[str, Any]:
    """The same game without [defaults]: a player's key replaces the whole key of the default.

    Raises TypeError or KeyError for tables that break the definition of a game.
    """
    defaults = tables.get("defaults", {})
    if not isinstance(defaults, Mapping):
        raise TypeError(f"defaults is {defaults!r}, expected a table")
    players = []
    for own in tables["player"]:
        order = own.get("order", defaults.get("order"))
        none = OF_THE_OTHER_ORDER.get(order)
        players.append({**{key: value for key, value in defaults.items() if key != none}, **own})
    return {**{key: value for key, value in tables.items() if key != "defaults"}, "player": players}


def expressions_of(tables: Table) -> dict[str, tuple[int, ...]]:
    """The expressions of a game whose defaults are applied; empty if there are none."""
    found = {
        part: tuple(
            number
            for number, player in enumerate(tables["player"], 1)
            if "expression" in player.get(part, {})
        )
        for part in PARTS
    }
    return {part: numbers for part, numbers in found.items() if numbers}


def has_expressions(expressions: Expressions, *parts: str) -> str | None:
    """Whose cost, dynamics or disturbance has one, the first for short; None if none of these parts has."""
    for part in parts or PARTS:
        if part in expressions:
            verb = "have" if part == "dynamics" else "has"
            return f"player {expressions[part][0]}'s {part} {verb} an expression"
    return None


def require_coefficients(expressions: Expressions, what: str, *parts: str) -> None:
    """Refuse expressions in these parts, or in any, for what reads them as coefficients.

    Raises GameError.
    """
    found = has_expressions(expressions, *parts)
    if found:
        raise GameError(f"{what} reads {named_parts(parts or PARTS)} as coefficients; {found}")


def named_parts(parts: Iterable[str]) -> str:
    """Keys of a player that may have an expression, as "costs, dynamics and disturbances"."""
    *most, last = (PARTS[part] for part in parts)
    return f"{', '.join(most)} and {last}" if most else last


def initial_references(player: Table) -> object:
    """z0 of a player: numbers as the file has them, x0 where it says so, 0 when absent."""
    z0 = player.get("z0", 0.0)
    return player["x0"] if z0 == "x0" else z0


def initial_estimates(players: Sequence[Table], i: int, dimension: int) -> list[Any]:
    """y0 of the 0-based player i, an entry for each player: one number or D numbers."""
    y0 = players[i].get("y0", 0.0)
    if y0 == "x0":
        return [player["x0"] for player in players]
    if not isinstance(y0, list):
        return [y0] * len(players)
    if dimension > 1 and len(y0) == dimension and not isinstance(y0[0], list):
        return [y0] * len(players)
    return y0
