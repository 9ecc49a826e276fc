"""What the page has to know of a game before it draws anything."""

from typing import Any

from ..fmu.model import Model, Variable
from ..game.definition import named_parameters
from ..game.parameters import GAINS, moves
from .game_file import SWITCHES

MOST_INPUTS = 100
"""Named parameters of a game up to which each has a field on the page."""


def facts_of(model: Model, name: str) -> dict[str, Any]:
    """Sizes, names, controls with their ranges, graph and start; name is what the user called the game."""
    named = [each.name for each in named_parameters(model.game) if not each.fixed]
    gains = [gain for gain in GAINS if moves(gain, model.order)]
    parameters = [variable for stem in named for variable in model.select([stem])]
    return {
        "name": name,
        "title": model.title,
        "players": model.player_names,
        "order": model.order,
        "dimension": model.dimension,
        "directed": model.directed,
        "stop_time": model.stop_time,
        "gains": [_control(variable) for stem in gains for variable in model.select([stem])],
        "switches": [_control(model.variable(switch)) for switch in SWITCHES],
        "parameters": [_control(variable) for variable in parameters[:MOST_INPUTS]],
        "edges": {variable.name: variable.start for variable in model.indexed("a").values()},
        "x0": {variable.name: variable.start for _, variable in sorted(model.indexed("x0").items())},
    }


def _control(variable: Variable) -> dict[str, Any]:
    return {
        "name": variable.name,
        "start": variable.start,
        "minimum": variable.minimum,
        "maximum": variable.maximum,
        "unit": "" if variable.unit in (None, "1") else variable.unit,
        "meaning": variable.description,
    }
