"""Reader of the TOML game definition: one game as dense NumPy arrays.

The family is f_i = q_i |x_i|^2 + l_i . x_i + const_i + sum_j c_ij |x_i - x_j|^2,
g_i(x)_l = sum_j (G_ij,l x_jl + H_ij,l x_jl^2), d_il(t) = bias + amplitude sin(frequency t + phase).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
Table: TypeAlias = dict[str, Any]
OfPlayers: TypeAlias = Any  # one float for all players, or (N, 1) where they have their own

LARGEST_PLAYERS = 1000
LARGEST_DIMENSION = 100
LARGEST_NEURONS = 10_000
GAIN_NAMES = ("k1", "k2", "k3", "k4", "beta", "delta", "epsilon")


class GameError(ValueError):
    """A game file that breaks the definition; the text names the key and what was expected."""


@dataclass(frozen=True)
class Game:
    """One game and its initial state. N players, D coordinates, q neurons; indices are 0-based here.

    Times are in seconds, the gains k1 to k4 in 1/s; actions carry the game's own length unit.
    """

    title: str
    names: tuple[str, ...]  # (N,)
    dimension: int  # D
    order: NDArray[np.int_]  # (N,), 1 velocity-driven, 2 acceleration-driven
    robust: bool
    perturbed: bool
    k1: OfPlayers
    k2: OfPlayers
    k3: OfPlayers
    k4: OfPlayers
    beta: OfPlayers
    delta: OfPlayers
    epsilon: OfPlayers
    centers: FloatArray  # (q, N D) or (N, q, N D), the vectors mu_m; player-major: entry j D + l meets y_ijl
    width: OfPlayers  # rho
    W_max: OfPlayers
    W0: FloatArray  # (N, q, D)
    adjacency: FloatArray  # (N, N), a_ij, with which i hears j; a_ij = a_ji unless the graph is directed
    x0: FloatArray  # (N, D)
    v0: FloatArray  # (N, D), zero rows for order 1
    z0: FloatArray  # (N, D), zero rows for order 2
    y0: FloatArray  # (N, N, D), y0[i, j] is player i's first estimate of player j
    cost_quadratic: FloatArray  # (N,), q_i
    cost_linear: FloatArray  # (N, D), l_i
    cost_constant: FloatArray  # (N,)
    cost_coupling: FloatArray  # (N, N), c_ij
    dynamics_linear: FloatArray  # (N, N, D), G_ij,l
    dynamics_square: FloatArray  # (N, N, D), H_ij,l
    dynamics_gain: FloatArray  # (N,), scales g_i; 1 unless a tunable parameter changes it
    disturbance_amplitude: FloatArray  # (N, D)
    disturbance_frequency: FloatArray  # (N, D), rad/s
    disturbance_phase: FloatArray  # (N, D), rad
    disturbance_bias: FloatArray  # (N, D)
    u_max: FloatArray  # (N, D), infinite where the control is not bounded

    @property
    def players(self) -> int:
        """N."""
        return len(self.order)

    @property
    def neurons(self) -> int:
        """q."""
        return int(self.centers.shape[-2])

    @property
    def first_order(self) -> NDArray[np.bool_]:
        """(N,), true for the players of the paper's set N_f."""
        return np.equal(self.order, 1)


def read_game(path: Path | str) -> Game:
    """Read a game file. Raises GameError (or tomllib.TOMLDecodeError) if it breaks the definition."""
    with open(path, "rb") as file:
        return game_from_table(tomllib.load(file))


def game_from_table(table: Table) -> Game:
    """Build the game from a parsed TOML table. Raises GameError naming the offending key."""
    required = {"title", "dimension", "gains", "rbf", "graph", "player"}
    _check_keys(table, required, {"expose", "strategy"}, "the game")
    title = _text(table["title"], "title")
    if table.get("expose", "all") not in ("all", "outputs"):
        raise GameError(f"expose must be 'all' or 'outputs', not {table['expose']!r}")
    D = _integer(table["dimension"], 1, LARGEST_DIMENSION, "dimension")
    tables = _list(table["player"], "player")
    N = len(tables)
    if not 2 <= N <= LARGEST_PLAYERS:
        raise GameError(f"player: 2 to {LARGEST_PLAYERS} tables expected, not {N}")

    strategy = _table(table.get("strategy", {}), "strategy")
    _check_keys(strategy, set(), {"robust", "perturbed"}, "strategy")
    gains = _table(table["gains"], "gains")
    _check_keys(gains, set(GAIN_NAMES), set(), "gains")
    rbf = _table(table["rbf"], "rbf")
    _check_keys(rbf, {"centers", "width", "W_max"}, set(), "rbf")
    graph = _table(table["graph"], "graph")
    _check_keys(graph, {"edges"}, {"directed"}, "graph")
    directed = _boolean(graph.get("directed", False), "graph.directed")

    order = np.zeros(N, dtype=np.int_)
    names: list[str] = []
    state = {name: np.zeros((N, D)) for name in ("x0", "v0", "z0")}
    y0 = np.zeros((N, N, D))
    quadratic, constant, linear = np.zeros(N), np.zeros(N), np.zeros((N, D))
    coupling = np.zeros((N, N))
    dynamics = {name: np.zeros((N, N, D)) for name in ("linear", "square")}
    u_max = np.full((N, D), np.inf)
    disturbance = {name: np.zeros((N, D)) for name in ("amplitude", "frequency", "phase", "bias")}

    for i, entry in enumerate(tables):
        where = f"player {i + 1}"
        player = _table(entry, where)
        order[i] = _integer(player.get("order"), 1, 2, f"{where}: order")
        own_start = "z0" if order[i] == 1 else "v0"
        optional = {own_start, "gains", "rbf", "W0", "y0", "cost", "dynamics", "disturbance", "u_max"}
        _check_keys(player, {"name", "order", "x0"}, optional, where)
        names.append(_text(player["name"], f"{where}: name"))
        for key in ("x0", own_start):
            state[key][i] = _per_coordinate(player.get(key, 0.0), D, f"{where}: {key}")
        if "y0" in player:
            rows = _list(player["y0"], f"{where}: y0", N)
            y0[i] = [_per_coordinate(row, D, f"{where}: y0") for row in rows]

        cost = _table(player.get("cost", {}), f"{where}: cost")
        _check_keys(cost, set(), {"quadratic", "linear", "constant", "coupling"}, f"{where}: cost")
        quadratic[i] = _number(cost.get("quadratic", 0.0), f"{where}: cost.quadratic")
        constant[i] = _number(cost.get("constant", 0.0), f"{where}: cost.constant")
        linear[i] = _per_coordinate(cost.get("linear", 0.0), D, f"{where}: cost.linear")
        for j, value in _indexed(cost.get("coupling", []), N, f"{where}: cost.coupling"):
            coupling[i, j] = _number(value, f"{where}: cost.coupling")

        terms = _table(player.get("dynamics", {}), f"{where}: dynamics")
        _check_keys(terms, set(), set(dynamics), f"{where}: dynamics")
        for key, into in dynamics.items():
            for j, value in _indexed(terms.get(key, []), N, f"{where}: dynamics.{key}"):
                into[i, j] = _per_coordinate(value, D, f"{where}: dynamics.{key}")

        if "u_max" in player:
            u_max[i] = _per_coordinate(player["u_max"], D, f"{where}: u_max")

        wave = _table(player.get("disturbance", {}), f"{where}: disturbance")
        _check_keys(wave, set(), set(disturbance), f"{where}: disturbance")
        for key, wave_into in disturbance.items():
            wave_into[i] = _per_coordinate(wave.get(key, 0.0), D, f"{where}: disturbance.{key}")

    return Game(
        title=title,
        names=tuple(names),
        dimension=D,
        order=order,
        robust=_boolean(strategy.get("robust", True), "strategy.robust"),
        perturbed=_boolean(strategy.get("perturbed", True), "strategy.perturbed"),
        **_gains(gains, [_table(entry.get("gains", {}), "gains of a player") for entry in tables]),
        **_networks(rbf, [_table(entry.get("rbf", {}), "rbf of a player") for entry in tables], N * D),
        W0=np.array([_weights(entry.get("W0", 0.0), len(rbf["centers"]), D) for entry in tables]),
        adjacency=_adjacency(graph["edges"], N, directed),
        x0=state["x0"],
        v0=state["v0"],
        z0=state["z0"],
        y0=y0,
        cost_quadratic=quadratic,
        cost_linear=linear,
        cost_constant=constant,
        cost_coupling=coupling,
        dynamics_linear=dynamics["linear"],
        dynamics_square=dynamics["square"],
        dynamics_gain=np.ones(N),
        disturbance_amplitude=disturbance["amplitude"],
        disturbance_frequency=disturbance["frequency"],
        disturbance_phase=disturbance["phase"],
        disturbance_bias=disturbance["bias"],
        u_max=u_max,
    )


def _gains(common: Table, own: list[Table]) -> dict[str, OfPlayers]:
    """Each player's own gains before the common ones; floats where no player has any."""
    gains = {name: _positive(common[name], f"gains.{name}") for name in GAIN_NAMES}
    if not any(own):
        return gains
    for table in own:
        _check_keys(table, set(), set(GAIN_NAMES), "gains of a player")
    return {
        name: np.array([[_positive(table.get(name, value), f"gains.{name}")] for table in own])
        for name, value in gains.items()
    }


def _networks(common: Table, own: list[Table], length: int) -> dict[str, Any]:
    """Each player's own network before the common one; common arrays and floats where no player has any."""
    keys = {"centers", "width", "W_max"}

    def of(rbf: Table) -> tuple[FloatArray, float, float]:
        _check_keys(rbf, keys, set(), "rbf")
        return (
            _centers(rbf["centers"], length),
            _positive(rbf["width"], "rbf.width"),
            _positive(rbf["W_max"], "rbf.W_max"),
        )

    if not any(own):
        return dict(zip(("centers", "width", "W_max"), of(common), strict=True))
    centers, width, W_max = zip(*(of({**common, **table}) for table in own), strict=True)
    columns = (np.array(numbers)[:, np.newaxis] for numbers in (width, W_max))
    return dict(zip(("centers", "width", "W_max"), (np.array(centers), *columns), strict=True))


def _weights(value: object, neurons: int, D: int) -> FloatArray:
    """W0 (q, D): q numbers, each for all coordinates, or q lists of D; 0 when absent."""
    if value == 0.0:
        return np.zeros((neurons, D))
    return np.array([_per_coordinate(entry, D, "W0") for entry in _list(value, "W0", neurons)])


def _check_keys(table: Table, required: set[str], optional: set[str], where: str) -> None:
    missing = required - table.keys()
    unknown = table.keys() - required - optional
    if missing:
        raise GameError(f"{where}: missing {', '.join(sorted(missing))}")
    if unknown:
        raise GameError(f"{where}: unknown key {', '.join(sorted(unknown))}")


def _table(value: object, where: str) -> Table:
    if not isinstance(value, dict):
        raise GameError(f"{where}: a table expected, not {value!r}")
    return value


def _list(value: object, where: str, length: int | None = None) -> list[Any]:
    if not isinstance(value, list) or (length is not None and len(value) != length):
        raise GameError(f"{where}: a list{'' if length is None else f' of {length}'} expected")
    return value


def _text(value: object, where: str) -> str:
    if not isinstance(value, str):
        raise GameError(f"{where}: text expected, not {value!r}")
    return value


def _boolean(value: object, where: str) -> bool:
    if not isinstance(value, bool):
        raise GameError(f"{where}: true or false expected, not {value!r}")
    return value


def _integer(value: object, low: int, high: int, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise GameError(f"{where}: an integer from {low} to {high} expected, not {value!r}")
    return value


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise GameError(f"{where}: a finite number expected, not {value!r}")
    return float(value)


def _positive(value: object, where: str) -> float:
    number = _number(value, where)
    if number <= 0.0:
        raise GameError(f"{where}: a positive number expected, not {number}")
    return number


def _per_coordinate(value: object, D: int, where: str) -> FloatArray:
    """D numbers; one number stands for D equal ones."""
    if isinstance(value, list):
        return np.array([_number(entry, where) for entry in _list(value, where, D)])
    return np.full(D, _number(value, where))


def _indexed(value: object, N: int, where: str) -> list[tuple[int, Any]]:
    """Pairs [j, value] with j from 1 to N, each j once; returned 0-based."""
    pairs: list[tuple[int, Any]] = []
    for entry in _list(value, where):
        j, content = _list(entry, where, 2)
        pairs.append((_integer(j, 1, N, where) - 1, content))
    if len({j for j, _ in pairs}) != len(pairs):
        raise GameError(f"{where}: a player is named twice")
    return pairs


def _centers(value: object, length: int) -> FloatArray:
    """(q, N D): numbers stand for that number times the all-ones vector."""
    entries: Sequence[object] = _list(value, "rbf.centers")
    if not 1 <= len(entries) <= LARGEST_NEURONS:
        raise GameError(f"rbf.centers: 1 to {LARGEST_NEURONS} centres expected, not {len(entries)}")
    if all(isinstance(entry, list) for entry in entries):
        rows = [_list(entry, "rbf.centers", length) for entry in entries]
        return np.array([[_number(number, "rbf.centers") for number in row] for row in rows])
    return np.outer([_number(entry, "rbf.centers") for entry in entries], np.ones(length))


def _adjacency(value: object, N: int, directed: bool) -> FloatArray:
    """Of an edge from i to j, j hears i: a_ji; a_ij as well unless the graph is directed."""
    adjacency = np.zeros((N, N))
    for entry in _list(value, "graph.edges"):
        edge = _list(entry, "graph.edges")
        if len(edge) not in (2, 3):
            raise GameError(f"graph.edges: [i, j] or [i, j, weight] expected, not {edge!r}")
        i, j = (_integer(end, 1, N, "graph.edges") - 1 for end in edge[:2])
        if i == j or adjacency[j, i] != 0.0:
            raise GameError(f"graph.edges: {edge!r} is a loop or given twice")
        adjacency[j, i] = _positive(edge[2] if len(edge) == 3 else 1.0, "graph.edges")
        if not directed:
            adjacency[i, j] = adjacency[j, i]
    return adjacency
