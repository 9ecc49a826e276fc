"""One game for the analysis, from a game file or an FMU: parameters, network and the file's tables."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError
from ..files.reading import ReadError, expect_file, read_text, suffix_of, toml_of
from ..fmu.build import source_of
from ..fmu.model import Value, read_model
from ..game.definition import (
    expressions_of,
    initial_estimates,
    initial_references,
    require_coefficients,
    with_defaults,
)
from ..game.parameters import GameParameters, common, game_parameters
from .graph import consensus_eigenvalues

FloatArray = NDArray[np.float64]
Table = Mapping[str, Any]

ANALYSIS = "the analysis"
"""What refuses expressions, in sentences."""


@dataclass(frozen=True, eq=False)
class Gains:
    """The numbers a designer chooses: k1 to k4 in 1/s, beta in 1/s, delta per coordinate, epsilon, W_max."""

    k1: float
    k2: float
    k3: float
    k4: float
    beta: float
    delta: float
    epsilon: float
    W_max: float


@dataclass(frozen=True, eq=False)
class AnalysedGame:
    """What the analysis needs of a game. N players, D coordinates, q neurons."""

    title: str
    parameters: GameParameters
    beta: float  # adaptation gain, 1/s
    centers: FloatArray  # (q, N D), mu_m; entry j D + l meets y_ijl
    width: float  # rho
    tables: Table  # the game file, its defaults applied
    path: Path

    @property
    def gains(self) -> Gains:
        """The game's own gains."""
        p = self.parameters
        values = (p.k1, p.k2, p.k3, p.k4, self.beta, p.delta, p.epsilon, p.W_max)
        names = ("k1", "k2", "k3", "k4", "beta", "delta", "epsilon", "W_max")
        return Gains(*(common(value, name, ANALYSIS) for name, value in zip(names, values, strict=True)))

    def with_gains(self, gains: Gains) -> "AnalysedGame":
        """The same game with other gains."""
        names = ("k1", "k2", "k3", "k4", "delta", "epsilon", "W_max")
        chosen = {name: getattr(gains, name) for name in names}
        return replace(self, parameters=replace(self.parameters, **chosen), beta=gains.beta)


def read_game(path: Path | str, changes: Mapping[str, Value] | None = None) -> AnalysedGame:
    """Read a game file (.toml), a game of the package by its name or an FMU (.fmu).

    changes replace start values of an FMU.

    Raises GameError for a file that is missing, breaks the definition of a game or has expressions,
    ModelError for a broken FMU, VariableError for a change that the FMU would not take.
    """
    path = source_of(path)
    if suffix_of(path) == ".fmu":
        model = read_model(path)
        require_coefficients(model.expressions, ANALYSIS)
        _require_alike(model.game)
        values = model.start_values(changes)
        parameters = game_parameters(model, changes)
        _require_dissipative(parameters)
        network = {**model.game["rbf"], "width": float(values["rho"])}
        for index, variable in model.indexed("center").items():
            network["centers"] = list(network["centers"])
            network["centers"][index[0] - 1] = float(values[variable.name])
        size = parameters.x0.size
        beta = float(values["beta"])
        return AnalysedGame(
            model.title, parameters, beta, _centers(network, size), float(network["width"]), model.game, path
        )
    if changes:
        raise GameError("changes need an FMU; edit the game file instead")
    expect_file(path, "game file", GameError)
    try:
        tables = toml_of(read_text(path))
    except ReadError as error:
        raise GameError(f"{path} cannot be read: {error}") from error
    return game_from_tables(tables, path)


def game_from_tables(tables: Table, path: Path) -> AnalysedGame:
    """The game of parsed tables. Raises GameError naming the file if a key is missing or has a wrong shape.

    Only what the analysis reads is checked; the full check is made when an FMU is built.
    """
    try:
        return _game_from_tables(tables, path)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        told = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        raise GameError(f"{path} breaks the definition of a game: {told}") from error


def _require_alike(tables: Table) -> None:
    """The theorems have one gain of each kind and one network, and begin with weights of 0."""
    for key, alike, has in (
        ("gains", "the same gains for all players", "has gains of its own"),
        ("rbf", "the same network for all players", "has a network of its own"),
        ("W0", "initial weights of 0", "has others"),
        ("elsewhere", "whole games", "is elsewhere"),
        ("plant", "plants inside the loop", "has an external one"),
    ):
        own = [i for i, player in enumerate(tables["player"], start=1) if player.get(key)]
        if own:
            raise GameError(f"{ANALYSIS} takes {alike}; player {own[0]} {has}")


def _require_dissipative(parameters: GameParameters) -> None:
    """Of directed graphs, the certificates' P = p I serves those whose M + M' is positive definite."""
    if not parameters.directed:
        return
    least = 2.0 * float(consensus_eigenvalues(parameters.adjacency).min())
    if least <= 0.0:
        raise GameError(
            f"{ANALYSIS} takes directed graphs for which M + M' is positive definite, M = L (x) I + A_0; "
            f"that of this game has the eigenvalue {least:.3g}"
        )


def without_square(tables: Table) -> dict[str, Any]:
    """Tables of the same game with every square term of the unknown dynamics removed."""
    players = []
    for player in tables["player"]:
        dynamics = {**player.get("dynamics", {}), "square": []}
        players.append({**player, "dynamics": dynamics})
    return {**tables, "title": f"{tables['title']}, without the square", "player": players}


def toml_text(tables: Table) -> str:
    """A game's tables as a TOML file: plain values, tables one level deep, the players as inline tables."""
    plain = {
        key: value for key, value in tables.items() if not isinstance(value, Mapping) and key != "player"
    }
    lines = [f"{key} = {_toml_value(value)}" for key, value in plain.items()]
    for key, table in tables.items():
        if isinstance(table, Mapping):
            lines += ["", f"[{key}]", *(f"{name} = {_toml_value(value)}" for name, value in table.items())]
    for player in tables["player"]:
        lines += ["", "[[player]]", *(f"{name} = {_toml_value(value)}" for name, value in player.items())]
    return "\n".join(lines) + "\n"


def _toml_value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    return repr(value)


def _game_from_tables(tables: Table, path: Path) -> AnalysedGame:
    tables = with_defaults(tables)
    require_coefficients(expressions_of(tables), ANALYSIS)
    _require_alike(tables)
    players, gains = tables["player"], tables["gains"]
    N, D = len(players), int(tables["dimension"])
    order = np.array([int(player["order"]) for player in players])

    def rows(key: str, *default: float) -> FloatArray:
        return np.array([_coordinates(player.get(key, *default), D) for player in players])

    def part(table: str, key: str) -> FloatArray:
        return np.array([_coordinates(player.get(table, {}).get(key, 0.0), D) for player in players])

    coupling = np.zeros((N, N))
    dynamics = {key: np.zeros((N, N, D)) for key in ("linear", "square")}
    y0 = np.zeros((N, N, D))
    for i, player in enumerate(players):
        for j, value in player.get("cost", {}).get("coupling", []):
            coupling[i, _player(j, N)] = float(value)
        for key, array in dynamics.items():
            for j, value in player.get("dynamics", {}).get(key, []):
                array[i, _player(j, N)] = _coordinates(value, D)
        y0[i] = [_coordinates(row, D) for row in initial_estimates(players, i, D)]
    adjacency = np.zeros((N, N))
    for i, j, *weight in tables["graph"]["edges"]:
        a, b = _player(i, N), _player(j, N)
        adjacency[b, a] = float(weight[0]) if weight else 1.0
        if not tables["graph"].get("directed", False):
            adjacency[a, b] = adjacency[b, a]
    parameters = GameParameters(
        order=order,
        **{name: float(gains[name]) for name in ("k1", "k2", "k3", "k4", "delta", "epsilon")},
        W_max=float(tables["rbf"]["W_max"]),
        adjacency=adjacency,
        cost_quadratic=np.array([float(player.get("cost", {}).get("quadratic", 0.0)) for player in players]),
        cost_linear=part("cost", "linear"),
        cost_coupling=coupling,
        x0=rows("x0"),
        v0=rows("v0", 0.0),
        z0=np.array([_coordinates(initial_references(player), D) for player in players]),
        y0=y0,
        dynamics_linear=dynamics["linear"],
        dynamics_square=dynamics["square"],
        disturbance_bound=np.abs(part("disturbance", "bias")) + np.abs(part("disturbance", "amplitude")),
        expressions={},
        x_star=None,
    )
    _require_dissipative(parameters)
    return AnalysedGame(
        title=str(tables["title"]),
        parameters=parameters,
        beta=float(gains["beta"]),
        centers=_centers(tables["rbf"], N * D),
        width=float(tables["rbf"]["width"]),
        tables=tables,
        path=path,
    )


def _centers(network: Table, size: int) -> FloatArray:
    """(q, N D): numbers stand for that number times the all-ones vector."""
    centers = np.array(network["centers"], dtype=np.float64)
    return np.outer(centers, np.ones(size)) if centers.ndim == 1 else centers.reshape(-1, size)


def _coordinates(value: object, dimension: int) -> FloatArray:
    """D numbers; one number stands for D equal ones."""
    array = np.array(value, dtype=np.float64)
    if array.shape not in ((), (dimension,)) or not np.all(np.isfinite(array)):
        raise ValueError(f"{value!r} is not a finite number or a list of {dimension}")
    return np.broadcast_to(array, (dimension,)).copy()


def _player(number: object, players: int) -> int:
    """0-based index of a player's number."""
    if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= players:
        raise ValueError(f"{number!r} is not a player from 1 to {players}")
    return number - 1


def finite_or_none(value: object) -> object:
    """The value as JSON has it: numbers that are not finite become None."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
