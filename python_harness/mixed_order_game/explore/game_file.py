"""The game file of what the page shows: the FMU's own, with the changed variables written into it."""

import zipfile
from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import tomlkit

from ..errors import GameError
from ..files.reading import text_of
from ..fmu.model import Model, Value
from ..game.definition import has_expressions, initial_estimates, initial_references
from ..game.game import Game
from ..game.parameters import GAINS
from ..names import parse_name

SWITCHES = ("robust", "perturbed")


def changed_game(model: Model, changes: Mapping[str, Value]) -> Game:
    """The game whose FMU has these start values: gains, graph, initial actions, switches, named parameters.

    Everything else, references and estimates that start at x0 included, keeps the values of the model.
    Raises VariableError for a change that the FMU would not take, GameError for a variable that is none of
    these.
    """
    with zipfile.ZipFile(model.path) as archive:
        game = Game(tomlkit.parse(text_of(archive.read("resources/game.toml"))))
    values = model.start_values(changes)
    changed = model.changed_values(values)
    stems = {parse_name(name)[0] for name in changed}
    for name, value in changed.items():
        stem, index = parse_name(name)
        if stem in GAINS:
            _set_gain(game, model, stem, index, float(value))
        elif stem in SWITCHES:
            if "strategy" not in game:
                game["strategy"] = tomlkit.table()
            game["strategy"][stem] = bool(value)
        elif stem in model.game.get("parameters", {}):
            _set_parameter(game, stem, index, float(value))
        elif stem not in ("a", "x0"):
            raise GameError(f"{name} is not among what is written into a game file here: {_written(model)}")
    if "a" in stems:
        game["graph"]["edges"] = [
            [j, i, values[variable.name]] if model.directed else [i, j, values[variable.name]]
            for (i, j), variable in sorted(model.indexed("a").items())
            if values[variable.name]
        ]
    if "x0" in stems:
        _keep_what_starts_at_x0(game, model)
        for i in {parse_name(name)[1][0] for name in changed if parse_name(name)[0] == "x0"}:
            start = [float(values[f"x0[{i},{k}]"]) for k in range(1, model.dimension + 1)]
            game.player(i)["x0"] = start if model.dimension > 1 else start[0]
    return game


def _set_gain(game: Game, model: Model, stem: str, index: tuple[int, ...], value: float) -> None:
    if not index:
        game["gains"][stem] = value
        return
    table = tomlkit.inline_table()
    own = game.player(index[0]).get("gains", model.game["player"][index[0] - 1].get("gains", {}))
    table.update({**own, stem: value})  # a default's whole key is replaced
    game.player(index[0])["gains"] = table


def _set_parameter(game: Game, name: str, index: tuple[int, ...], value: float) -> None:
    tables = game["parameters"]
    entry = tables[name]
    holder: Any = entry if isinstance(entry, Mapping) else tables
    key = "value" if isinstance(entry, Mapping) else name
    if not index:
        holder[key] = value
        return
    entries: Any = holder[key]
    for position in index[:-1]:
        entries = entries[position - 1]
    entries[index[-1] - 1] = value


def _keep_what_starts_at_x0(game: Game, model: Model) -> None:
    """Say in numbers what the file says as "x0", and where the search for x* begins."""
    players = deepcopy(model.game["player"])
    for i, player in enumerate(players):
        if player.get("z0") == "x0":
            game.player(i + 1)["z0"] = initial_references(player)
        if player.get("y0") == "x0":
            game.player(i + 1)["y0"] = initial_estimates(players, i, model.dimension)
    if has_expressions(model.expressions, "cost") and "guess" not in game.get("equilibrium", {}):
        game["equilibrium"] = {"guess": [player["x0"] for player in players]}


def _written(model: Model) -> str:
    return ", ".join([*GAINS, "a", "x0", *SWITCHES, *model.game.get("parameters", {})])
