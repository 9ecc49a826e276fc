"""One game for the analysis, from a game file or an FMU: parameters, network and the file's tables."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError
from ..fmu.build import fmu_of, source_of
from ..fmu.model import Model, Value, read_model
from ..game.definition import Table, require_coefficients
from ..game.parameters import GameParameters, common, game_parameters, moves
from .graph import consensus_eigenvalues

FloatArray = NDArray[np.float64]

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


def moving(gains: Gains, parameters: GameParameters) -> list[tuple[str, float]]:
    """Gains by name, without k1 or k4 where no player has order 1 or 2."""
    orders = parameters.order.tolist()
    return [(name, value) for name, value in vars(gains).items() if moves(name, orders)]


def read_game(path: Path | str, changes: Mapping[str, Value] | None = None) -> AnalysedGame:
    """Read a game file (.toml), a game of the package by its name or an FMU (.fmu).

    changes: start values in place of its own. Raises GameError for a file that is missing, breaks the
    definition of a game or has expressions, ModelError for a broken FMU, BuildError as cached_fmu does,
    VariableError for a change that the FMU would not take.
    """
    path = source_of(path)
    model = read_model(fmu_of(path))
    require_coefficients(model.expressions, ANALYSIS)
    return replace(game_of_model(model, changes), path=path)


def game_of_model(model: Model, changes: Mapping[str, Value] | None = None) -> AnalysedGame:
    """The game of an FMU with start values changed; of expressions its parameters tell nothing but where.

    Raises GameError where the theorems' gains, networks or graphs are others than the game's, VariableError
    for a change that the FMU would not take.
    """
    _require_alike(model.game)
    values = model.start_values(changes)
    parameters = game_parameters(model, changes)
    _require_dissipative(parameters)
    centers = np.array(model.game["rbf"]["centers"], dtype=np.float64)
    for (m, *_), variable in model.indexed("center").items():
        centers[m - 1] = values[variable.name]
    if centers.ndim == 1:  # numbers stand for that number times the all-ones vector
        centers = np.outer(centers, np.ones(parameters.x0.size))
    return AnalysedGame(
        title=model.title,
        parameters=parameters,
        beta=float(values["beta"]),
        centers=centers.reshape(-1, parameters.x0.size),
        width=float(values["rho"]),
        tables=model.game,
        path=model.path,
    )


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


def finite_or_none(value: object) -> object:
    """The value as JSON has it: numbers that are not finite become None."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
