"""The published JSON Schema of game files, and its form for a game of known size."""

import copy
import json
from pathlib import Path
from typing import Any

from ..errors import BuildError

FILE = "game.schema.json"


def schema_path() -> Path:
    """The schema file (JSON Schema 2020-12). Raises BuildError if the installation lacks it."""
    path = Path(__file__).resolve().with_name(FILE)
    if not path.is_file():
        raise BuildError(
            f"this installation carries no {FILE}: install the package mixed-order-game with pip"
        )
    return path


def game_schema(*, players: int | None = None, dimension: int | None = None) -> dict[str, Any]:
    """The schema, with the lengths that follow from N and D where these are given and allowed."""
    schema: dict[str, Any] = json.loads(schema_path().read_text(encoding="utf-8"))
    definitions = copy.deepcopy(schema["$defs"])
    bounds = schema["properties"]["dimension"]
    if dimension is not None and not bounds["minimum"] <= dimension <= bounds["maximum"]:
        dimension = None
    bounds = schema["properties"]["player"]
    if players is not None and not bounds["minItems"] <= players <= bounds["maxItems"]:
        players = None
    if dimension is not None:
        numbers = "1 number" if dimension == 1 else f"{dimension} numbers"
        expected = f"a list of {numbers} or one number that stands for all of them"
        each = definitions["perCoordinate"]
        each["then"] |= {"minItems": dimension, "maxItems": dimension, "x-expected": expected}
        each["else"]["x-expected"] = expected
        texts = definitions["expressions"]
        expected = f"a text, or a list of {dimension} texts"
        texts["then"] |= {"minItems": dimension, "maxItems": dimension, "x-expected": expected}
        texts["else"]["x-expected"] = expected
    if players is not None:
        definitions["playerIndex"] |= {
            "maximum": players,
            "x-expected": f"an integer from 1 to {players}",
        }
        guess = schema["properties"]["equilibrium"]["properties"]["guess"]
        guess |= {
            "minItems": players,
            "maxItems": players,
            "x-expected": f"a list of {players} actions, one for each player",
        }
    if players is not None and dimension is not None:
        of_players = {"minItems": players, "maxItems": players}
        of_coordinates = {"minItems": dimension, "maxItems": dimension, "items": {"$ref": "#/$defs/finite"}}
        estimates = definitions["estimates"]["then"]
        estimates["anyOf"] = [of_players] if dimension == 1 else [of_players, of_coordinates]
        estimates["x-expected"] = (
            f'"x0", a list of {players} estimates, one for each player, a list of {dimension} numbers, '
            "or one number"
        )
        length = players * dimension
        definitions["vectorCenter"] |= {
            "minItems": length,
            "maxItems": length,
            "x-expected": f"a list of {length} numbers, player by player, as the first center is a list",
        }
        # The first center decides; editors whose validators do not know prefixItems go by any of them.
        schema["properties"]["rbf"]["properties"]["centers"]["if"] = {"prefixItems": [{"type": "array"}]}
    return {**schema, "$defs": definitions}
