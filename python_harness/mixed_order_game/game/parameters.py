"""A game's parameters as arrays: from the FMU's variables and, for the unknown dynamics, its game file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError
from ..fmu.model import Model, Value
from .definition import Expressions, initial_estimates, require_coefficients

FloatArray = NDArray[np.float64]
OfPlayers = float | FloatArray
"""One number for all players, or an array (N,) where they have their own."""

GAINS = ("k1", "k2", "k3", "k4", "beta", "delta", "epsilon")


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
    expressions: Expressions  # which costs, dynamics and disturbances these coefficients are not all of
    x_star: FloatArray | None  # (N, D), of the FMU; needed where costs have expressions

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


def game_parameters(model: Model, changes: Mapping[str, Value] | None = None) -> GameParameters:
    """Parameters of an FMU with changed start values in place of its own.

    An FMU with expose = "outputs" has no y0 variables; their values then come from its game file.
    Raises VariableError for a change that the FMU would not take.
    """
    N, D = model.players, model.dimension
    values = model.start_values(changes)

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

    edges = array("a", N, N)
    gain = array("dynamics_gain", N)[:, np.newaxis, np.newaxis]
    players = model.game["player"]
    return GameParameters(
        order=np.array(model.order),
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
        y0=array("y0", N, N, D) if model.indexed("y0") else _estimates(players, D),
        dynamics_linear=gain * _dynamics(players, "linear", D),
        dynamics_square=gain * _dynamics(players, "square", D),
        disturbance_bound=np.abs(array("disturbance_bias", N, D))
        + np.abs(array("disturbance_amplitude", N, D)),
        expressions=model.expressions,
        x_star=None,
    )


def common(value: OfPlayers, name: str, what: str) -> float:
    """A gain or bound that is the same for all players. Raises GameError where players have their own."""
    if isinstance(value, float):
        return value
    raise GameError(f"{what} takes one {name} for all players, and those of this game have their own")


def _dynamics(players: Sequence[Mapping[str, Any]], kind: str, dimension: int) -> FloatArray:
    """(N, N, D) from the pairs [j, coefficients] of the game file; one number stands for D equal ones."""
    coefficients = np.zeros((len(players), len(players), dimension))
    for i, player in enumerate(players):
        for j, entries in player.get("dynamics", {}).get(kind, []):
            coefficients[i, j - 1] = entries
    return coefficients


def _estimates(players: Sequence[Mapping[str, Any]], dimension: int) -> FloatArray:
    """y0 (N, N, D) of the game file."""
    estimates = np.zeros((len(players), len(players), dimension))
    for i in range(len(players)):
        for j, estimate in enumerate(initial_estimates(players, i, dimension)):
            estimates[i, j] = estimate
    return estimates
