"""Random games for judging the judge: sound ones, on which no claim is false, and unsound ones.

Sound: strongly monotone, the unperturbed loop decays (by its eigenvalues), and delta exceeds what acts on
each player at the equilibrium. Unsound in one of the ways that UNSOUND names.
"""

import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np

from mixed_order_game.errors import GameError
from mixed_order_game.game.gains import choose_gains
from mixed_order_game.game.parameters import GameParameters, parameters_of
from mixed_order_game.theory.spectrum import (
    linear_loop,
    monotonicity_constant,
    nash_equilibrium,
    spectral_abscissa,
)

Tables = dict[str, Any]

GAINS = ("k1", "k2", "k3", "k4")


def sound_game(seed: int) -> str:
    """Text of a game whose gains were chosen for it, or drawn and found stable."""
    random = np.random.default_rng([seed, 1])
    while True:
        tables = _draft(random)
        game = parameters_of(tables)
        if not monotonicity_constant(game) > 0.2:
            continue
        if random.uniform() < 0.6:
            try:
                chosen = choose_gains(game)
            except GameError:
                continue
            gains = {name: float(getattr(chosen, name)) for name in GAINS}
        else:
            gains = dict(
                zip(GAINS, _decades(random, (3.0, 0.3, 10.0, 5.0), (50.0, 3.0, 500.0, 200.0)), strict=True)
            )
        tables["gains"] |= gains
        tables["gains"]["delta"] = _rounded(random.uniform(1.3, 5.0) * _push(game) + 0.1)
        if _abscissa(tables) < -0.1:
            return _text(tables)


def concave_cost(seed: int) -> str:
    """Gradients vanish at one point, where one player's cost has a maximum: no equilibrium."""
    random = np.random.default_rng([seed, 2])
    tables = tomllib.loads(sound_game(seed))
    player = tables["player"][int(random.integers(len(tables["player"])))]
    player["cost"]["quadratic"] = -_rounded(
        sum(max(weight, 0.0) for _, weight in player["cost"]["coupling"]) + random.uniform(0.1, 2.0)
    )
    return _text(tables)


def unstable_loop(seed: int) -> str:
    """Consensus or tracking too slow for the gradients: the unperturbed loop grows."""
    random = np.random.default_rng([seed, 3])
    while True:
        tables = tomllib.loads(sound_game(int(random.integers(1_000_000))))
        weakened = random.permutation(["k1", "k3", "k4"])[: random.integers(1, 4)]
        for _ in range(40):
            for name in weakened:
                tables["gains"][name] = _rounded(tables["gains"][name] / 2.0)
            if _abscissa(tables) > 0.02:
                return _text(tables)


def small_delta(seed: int) -> str:
    """The robust term is smaller than the disturbances, which no network can learn: they depend on time."""
    random = np.random.default_rng([seed, 4])
    tables = tomllib.loads(sound_game(seed))
    delta = tables["gains"]["delta"]
    for player in tables["player"]:
        player["disturbance"] |= {"amplitude": _rounded(random.uniform(2.0, 4.0) * delta), "frequency": 3.0}
    tables["gains"]["beta"] = 1.0
    return _text(tables)


def runaway(seed: int) -> str:
    """Unknown dynamics that outgrow k1, k4 and the bounded robust term and network."""
    tables = tomllib.loads(sound_game(seed))
    gains = tables["gains"]
    for i, player in enumerate(tables["player"], start=1):
        push = 3.0 * gains["k1"] if player["order"] == 1 else 3.0 * gains["k4"] * gains["k2"] * 20.0
        player["dynamics"] = {"linear": [[i, _rounded(push)]]}
        player["x0"] = 8.0
    return _text(tables)


UNSOUND: dict[str, Callable[[int], str]] = {
    "concave_cost": concave_cost,
    "unstable_loop": unstable_loop,
    "small_delta": small_delta,
    "runaway": runaway,
}


def _draft(random: np.random.Generator) -> Tables:
    N, D = int(random.integers(2, 8)), int(random.integers(1, 3))
    edges = [[i + 1, int(random.integers(i)) + 1] for i in range(1, N)]  # a tree
    for _ in range(int(random.integers(0, N))):
        i, j = sorted(random.choice(N, 2, replace=False) + 1)
        if [j, i] not in edges and [i, j] not in edges:
            edges.append([int(j), int(i)])
    weighted = [[*edge, _rounded(random.uniform(0.5, 2.0))] for edge in edges]
    beta, epsilon, W_max = _decades(random, (1.0, 1e-3, 5.0), (300.0, 0.1, 500.0))
    centers = np.linspace(-4.0, 4.0, int(random.integers(1, 8))).round(3).tolist()
    return {
        "title": "Random",
        "dimension": D,
        "gains": {**dict.fromkeys(GAINS, 1.0), "beta": beta, "delta": 1.0, "epsilon": epsilon},
        "rbf": {
            "centers": centers,
            "width": _rounded(random.uniform(1.0, 4.0) * np.sqrt(N * D)),
            "W_max": W_max,
        },
        "graph": {"edges": weighted},
        "player": [_player(random, i, N, D) for i in range(1, N + 1)],
    }


def _player(random: np.random.Generator, i: int, N: int, D: int) -> Tables:
    others = [
        int(j) for j in random.permutation([j for j in range(1, N + 1) if j != i])[: random.integers(0, 3)]
    ]
    order = int(random.integers(1, 3))
    start = _numbers(random.uniform(-8.0, 8.0, D))
    square = [[i, _rounded(random.uniform(-0.05, 0.05))]] if random.uniform() < 0.3 else []
    return {
        "name": f"p{i}",
        "order": order,
        "x0": start,
        **({"z0": start} if order == 1 and random.uniform() < 0.5 else {}),
        "cost": {
            "quadratic": _rounded(random.uniform(0.5, 3.0)),
            "linear": _numbers(random.uniform(-5.0, 5.0, D)),
            "coupling": [[j, _rounded(random.uniform(-0.2, 0.8))] for j in others],
        },
        "dynamics": {
            "linear": [[j, _numbers(random.uniform(-0.8, 0.8, D))] for j in [i, *others[:1]]],
            "square": square,
        },
        "disturbance": {
            "amplitude": _numbers(random.uniform(0.0, 2.0, D) * (random.uniform() < 0.8)),
            "frequency": _numbers(10.0 ** random.uniform(-0.5, 0.8, D)),
            "phase": _numbers(random.uniform(-3.0, 3.0, D)),
            "bias": _numbers(random.uniform(-1.0, 1.0, D) * (random.uniform() < 0.4)),
        },
    }


def _abscissa(tables: Tables) -> float:
    return spectral_abscissa(linear_loop(parameters_of(tables)))


def _push(game: GameParameters) -> float:
    """Largest |g_il(x*)| + |d_il|."""
    return float((np.abs(game.unknown_dynamics(nash_equilibrium(game))) + game.disturbance_bound).max())


def _decades(random: np.random.Generator, low: tuple[float, ...], high: tuple[float, ...]) -> list[float]:
    return _numbers(np.exp(random.uniform(np.log(low), np.log(high))))


def _numbers(values: Any) -> list[float]:
    return [_rounded(value) for value in values]


def _rounded(value: Any) -> float:
    return float(f"{value:.3g}")


def _text(tables: Tables) -> str:
    """TOML of these tables."""

    def value(item: Any) -> str:
        if isinstance(item, dict):
            return "{ " + ", ".join(f"{key} = {value(each)}" for key, each in item.items()) + " }"
        if isinstance(item, list):
            return "[" + ", ".join(map(value, item)) + "]"
        return f'"{item}"' if isinstance(item, str) else repr(item)

    lines = [f"{key} = {value(tables[key])}" for key in ("title", "dimension")]
    for section in ("gains", "rbf", "graph"):
        lines += [f"[{section}]", *(f"{key} = {value(each)}" for key, each in tables[section].items())]
    for player in tables["player"]:
        lines += ["[[player]]", *(f"{key} = {value(each)}" for key, each in player.items())]
    return "\n".join(lines) + "\n"
