"""A game's parameters as arrays: of its file, and of an FMU whose start values may be changed."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError
from ..fmu.model import Model, Value
from .bounds import GameBounds
from .definition import (
    Expressions,
    Table,
    expressions_of,
    initial_estimates,
    initial_references,
    require_coefficients,
)

FloatArray = NDArray[np.float64]
OfPlayers = float | FloatArray
"""One number for all players, or an array (N,) where they have their own."""

GAINS = ("k1", "k2", "k3", "k4", "beta", "delta", "epsilon")
GAINS_OF_ORDER: Mapping[str, int] = {"k1": 1, "k4": 2}
"""Gains of the players of one order; others are of all."""


def moves(gain: str, orders: Iterable[int]) -> bool:
    """Whether a gain moves a player of one of these orders."""
    return GAINS_OF_ORDER.get(gain) in {None, *orders}


@dataclass(frozen=True, eq=False)
class GameParameters:
    """N players, D coordinates; indices are 0-based here. The gains k1 to k4 are in 1/s.

    Where players have gains of their own, k1 holds NaN for players of order 2 and k4 for those of order 1.
    """

    order: NDArray[np.int_]  # (N,), 1 velocity-driven, 2 acceleration-driven
    k1: OfPlayers
    k2: OfPlayers
    k3: OfPlayers
    k4: OfPlayers
    delta: OfPlayers
    epsilon: OfPlayers
    W_max: OfPlayers
    adjacency: FloatArray  # (N, N), a_ij; a_ij = a_ji unless the graph is directed
    cost_quadratic: FloatArray  # (N,), q_i
    cost_linear: FloatArray  # (N, D), l_i
    cost_coupling: FloatArray  # (N, N), c_ij
    x0: FloatArray  # (N, D)
    v0: FloatArray  # (N, D), 0 for order 1
    z0: FloatArray  # (N, D), 0 for order 2
    y0: FloatArray  # (N, N, D)
    dynamics_linear: FloatArray  # (N, N, D), G_ij,l times dynamics_gain[i]
    dynamics_square: FloatArray  # (N, N, D), H_ij,l times dynamics_gain[i]
    disturbance_bound: FloatArray  # (N, D), |bias| + |amplitude|, at least max_t |d_il(t)|
    u_max: FloatArray  # (N, D), bound of |u_il|; infinite where there is none
    expressions: Expressions  # which costs, dynamics and disturbances these coefficients are not all of
    x_star: FloatArray | None  # (N, D), of the FMU; needed where costs have expressions
    jacobian: FloatArray | None = None
    """(N D, N D), of the pseudo-gradient at x*, by player, then by coordinate; likewise"""
    bounds: GameBounds | None = None  # what is proved over a box, likewise

    @property
    def players(self) -> int:
        """N."""
        return len(self.order)

    @property
    def dimension(self) -> int:
        """D."""
        return int(self.x0.shape[1])

    @property
    def first_order(self) -> NDArray[np.bool_]:
        """(N,), true for velocity-driven players."""
        return np.equal(self.order, 1)

    @property
    def regulation(self) -> FloatArray:
        """(N,), 1/s: k1 of players of order 1, k4 of players of order 2."""
        return np.where(self.first_order, self.k1, self.k4)

    def of_players(self, name: str) -> FloatArray:
        """(N,): a gain, or W_max, of every player."""
        return np.broadcast_to(np.asarray(getattr(self, name), dtype=np.float64), (self.players,))

    @property
    def directed(self) -> bool:
        """Whether some player hears another one otherwise than it is heard."""
        return not np.array_equal(self.adjacency, self.adjacency.T)

    def unknown_dynamics(self, x: FloatArray) -> FloatArray:
        """g_i(x)_l = sum_j (G_ij,l x_jl + H_ij,l x_jl^2) for x (N, D); returns (N, D)."""
        require_coefficients(self.expressions, "the unknown term at a point", "dynamics")
        linear = np.einsum("ijl,jl->il", self.dynamics_linear, x)
        return np.asarray(linear + np.einsum("ijl,jl->il", self.dynamics_square, x * x))


def parameters_of(tables: Table) -> GameParameters:
    """Parameters of a valid game file whose defaults are applied; a number stands for D equal ones."""
    players: list[Table] = tables["player"]
    N, D = len(players), int(tables["dimension"])

    def rows(value_of: Callable[[Table], Any], *shape: int) -> FloatArray:
        return np.array([np.broadcast_to(value_of(player), shape) for player in players], dtype=np.float64)

    def pairs(part: str, key: str, *shape: int) -> FloatArray:
        """(N, N, ...) from the pairs [j, value] of each player."""
        array = np.zeros((N, N, *shape))
        for i, player in enumerate(players):
            for j, value in player.get(part, {}).get(key, []):
                array[i, j - 1] = value
        return array

    def of_players(table: str, name: str) -> OfPlayers:
        own = [player.get(table, {}).get(name) for player in players]
        common = tables.get(table, {}).get(name, math.nan)
        if all(value is None for value in own):
            return float(common)
        return np.array([common if value is None else value for value in own], dtype=np.float64)

    adjacency = np.zeros((N, N))
    for i, j, *weight in tables["graph"]["edges"]:
        adjacency[j - 1, i - 1] = weight[0] if weight else 1.0
        if not tables["graph"].get("directed", False):
            adjacency[i - 1, j - 1] = adjacency[j - 1, i - 1]
    return GameParameters(
        order=np.array([int(player["order"]) for player in players]),
        k1=of_players("gains", "k1"),
        k2=of_players("gains", "k2"),
        k3=of_players("gains", "k3"),
        k4=of_players("gains", "k4"),
        delta=of_players("gains", "delta"),
        epsilon=of_players("gains", "epsilon"),
        W_max=of_players("rbf", "W_max"),
        adjacency=adjacency,
        cost_quadratic=rows(lambda player: player.get("cost", {}).get("quadratic", 0.0)),
        cost_linear=rows(lambda player: player.get("cost", {}).get("linear", 0.0), D),
        cost_coupling=pairs("cost", "coupling"),
        x0=rows(lambda player: player.get("x0", 0.0), D),
        v0=rows(lambda player: player.get("v0", 0.0), D),
        z0=rows(initial_references, D),
        y0=np.array(
            [
                [np.broadcast_to(estimate, (D,)) for estimate in initial_estimates(players, i, D)]
                for i in range(N)
            ],
            dtype=np.float64,
        ),
        dynamics_linear=pairs("dynamics", "linear", D),
        dynamics_square=pairs("dynamics", "square", D),
        disturbance_bound=rows(lambda player: _bound(player.get("disturbance", {})), D),
        u_max=rows(lambda player: player.get("u_max", math.inf), D),
        expressions=expressions_of(tables),
        x_star=None,
    )


def game_parameters(model: Model, changes: Mapping[str, Value] | None = None) -> GameParameters:
    """Parameters of an FMU with changed start values in place of its own.

    What the FMU has no variables of comes from its game file. Raises VariableError for a change that the FMU
    would not take.
    """
    N, D = model.players, model.dimension
    values = model.start_values(changes)
    of_file = parameters_of(model.game)

    def array(stem: str, *shape: int) -> FloatArray:
        entries = np.zeros(shape)
        for index, variable in model.indexed(stem).items():
            entries[tuple(position - 1 for position in index)] = values[variable.name]
        return entries

    def of_players(name: str) -> OfPlayers:
        if name in values:
            return float(values[name])
        own = np.full(N, np.nan)
        for (i,), variable in model.indexed(name).items():
            own[i - 1] = values[variable.name]
        return own

    u_max = np.full((N, D), math.inf)
    for index, variable in model.indexed("u_max").items():
        u_max[tuple(position - 1 for position in index)] = values[variable.name]
    edges = array("a", N, N)
    gain = array("dynamics_gain", N)[:, np.newaxis, np.newaxis]
    return replace(
        of_file,
        k1=of_players("k1"),
        k2=of_players("k2"),
        k3=of_players("k3"),
        k4=of_players("k4"),
        delta=of_players("delta"),
        epsilon=of_players("epsilon"),
        W_max=of_players("W_max"),
        adjacency=edges if model.directed else edges + edges.T,
        cost_quadratic=array("cost_quadratic", N),
        cost_linear=array("cost_linear", N, D),
        cost_coupling=array("cost_coupling", N, N),
        x0=array("x0", N, D),
        v0=array("v0", N, D),
        z0=array("z0", N, D),
        y0=array("y0", N, N, D) if model.indexed("y0") else of_file.y0,
        dynamics_linear=gain * of_file.dynamics_linear,
        dynamics_square=gain * of_file.dynamics_square,
        disturbance_bound=np.abs(array("disturbance_bias", N, D))
        + np.abs(array("disturbance_amplitude", N, D)),
        u_max=u_max,
    )


def common(value: OfPlayers, name: str, what: str) -> float:
    """A gain or bound that is the same for all players. Raises GameError where players have their own."""
    if isinstance(value, float):
        return value
    raise GameError(f"{what} takes one {name} for all players, and those of this game have their own")


def _bound(disturbance: Table) -> FloatArray:
    """|bias| + |amplitude|, at least max_t |d_il(t)| of a player."""
    bias, amplitude = (np.abs(disturbance.get(key, 0.0)) for key in ("bias", "amplitude"))
    return np.asarray(bias + amplitude)
