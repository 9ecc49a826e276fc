"""Writes the random games of tests/reference/games: `python -m tests.oracle.make_games`.

Fixed seeds, values rounded to two decimals, strongly monotone costs, gains that stabilise the linear loop.
N, D, q and the number of first-order players differ within each game where they can, so that a swapped index
cannot pass. The files are the record; this program only says where their numbers come from.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .equilibrium import strong_monotonicity_constant
from .game import GAIN_NAMES, read_game
from .linear_loop import spectral_abscissa

GAMES = Path(__file__).resolve().parents[1] / "reference" / "games"
LEAST_RATE = 0.5  # 1/s, slowest rate accepted of the linear loop


@dataclass(frozen=True)
class Recipe:
    """What a random game is made from."""

    title: str
    seed: int
    dimension: int
    orders: tuple[int, ...]
    neurons: int
    gains: dict[str, float]
    W_max: float
    width: float
    largest_start: float = 2.0  # |x(0)| per entry
    largest_disturbance: float = 1.5
    largest_square: float = 0.0  # |H_ij,l|
    starts: bool = True  # random v0, z0, y0 instead of 0
    weighted: bool = False
    vector_centers: bool = False
    short_forms: bool = False  # one number for D equal ones, absent entries
    strategy: dict[str, bool] = field(default_factory=dict)


def gains(*values: float) -> dict[str, float]:
    """The [gains] table, in the order of GAIN_NAMES."""
    return dict(zip(GAIN_NAMES, values, strict=True))


RECIPES = {
    "four_first_order": Recipe(
        "Four velocity-driven players", 11, 2, (1, 1, 1, 1), 7, gains(8.0, 1.2, 30.0, 25.0, 20.0, 3.0, 0.05),
        W_max=3.5, width=3.0, largest_square=0.1,
    ),
    "three_second_order": Recipe(
        "Three acceleration-driven players", 12, 2, (2, 2, 2), 5,
        gains(9.0, 0.8, 40.0, 30.0, 30.0, 2.5, 0.04), W_max=1.0, width=2.5,
        largest_square=0.1, short_forms=True,
    ),
    "interleaved_orders": Recipe(
        "Orders 2, 1, 2, 2, 1, 1", 13, 2, (2, 1, 2, 2, 1, 1), 9, gains(7.0, 0.9, 45.0, 40.0, 25.0, 2.0, 0.03),
        W_max=0.7, width=4.0, largest_square=0.1,
    ),
    "weighted_graph": Recipe(
        "Seven scalar players on a weighted graph", 14, 1, (2, 2, 1, 2, 1, 2, 2), 4,
        gains(12.0, 0.7, 60.0, 35.0, 15.0, 1.5, 0.02), W_max=30.0, width=3.5, weighted=True,
    ),
    "small_weight_bound": Recipe(
        "Weight columns that keep meeting a small bound", 15, 2, (1, 1, 2, 1, 1), 8,
        gains(8.0, 1.0, 40.0, 30.0, 40.0, 1.0, 0.05), W_max=0.4, width=4.0,
        largest_disturbance=4.0, weighted=True,
    ),
    "two_scalar_players": Recipe(
        "The smallest mixed game", 16, 1, (1, 2), 3, gains(6.0, 1.5, 20.0, 15.0, 10.0, 2.0, 0.1),
        W_max=1.5, width=2.0, largest_square=0.15, short_forms=True,
    ),
    "eight_players_in_space": Recipe(
        "Eight players in three dimensions", 17, 3, (2, 1, 2, 2, 2, 1, 2, 2), 10,
        gains(9.0, 0.6, 70.0, 45.0, 20.0, 1.2, 0.03), W_max=0.6, width=6.0, largest_start=1.5,
    ),
    "twelve_scalar_players": Recipe(
        "Twelve scalar players", 18, 1, (1, 2, 1, 1, 2, 1, 2, 2, 1, 1, 2, 1), 6,
        gains(11.0, 0.8, 80.0, 50.0, 18.0, 1.4, 0.02), W_max=1.2, width=4.5, weighted=True,
    ),
    "vector_centers": Recipe(
        "RBF centres off the diagonal", 19, 2, (1, 2, 1, 1), 6, gains(10.0, 1.1, 35.0, 28.0, 22.0, 1.8, 0.04),
        W_max=1.8, width=2.8, largest_square=0.05, vector_centers=True,
    ),
    "robust_unperturbed": Recipe(
        "Robust strategy without anything to reject", 20, 1, (1, 2, 1), 5,
        gains(9.0, 0.9, 30.0, 26.0, 24.0, 2.2, 0.05), W_max=15.0, width=3.2, strategy={"perturbed": False},
    ),
}  # fmt: skip


def main() -> None:
    """Write every random game and print its sizes, monotonicity constant and slowest linear rate."""
    for name, recipe in RECIPES.items():
        path = GAMES / f"{name}.toml"
        path.write_text(game_text(recipe), encoding="utf-8")
        game = read_game(path)
        monotonicity = strong_monotonicity_constant(game)
        rate = -spectral_abscissa(replace(game, robust=False, perturbed=False))
        if monotonicity <= 0.0 or rate < LEAST_RATE:
            raise SystemExit(f"{name}: monotonicity {monotonicity:.3f}, slowest rate {rate:.3f} 1/s")
        print(
            f"{name}: N {game.players}, D {game.dimension}, q {game.neurons}, first-order "
            f"{game.first_order.sum()}, monotonicity {monotonicity:.3f}, slowest rate {rate:.3f} 1/s"
        )


def game_text(recipe: Recipe) -> str:
    """The TOML text of a recipe."""
    random = np.random.default_rng(recipe.seed)
    N, D, q = len(recipe.orders), recipe.dimension, recipe.neurons
    lines = [
        f"# Comparison game, random with seed {recipe.seed}.",
        f'title = "{recipe.title}"',
        f"dimension = {D}",
        "",
    ]
    if recipe.strategy:
        lines += ["[strategy]", *(f"{key} = {str(on).lower()}" for key, on in recipe.strategy.items()), ""]
    lines += ["[gains]", *(f"{key} = {value}" for key, value in recipe.gains.items()), ""]
    if recipe.vector_centers:
        rows = [_text(row) for row in random.uniform(-1.5, 1.5, (q, N * D))]
        centers = "[\n    " + ",\n    ".join(rows) + ",\n]"
    else:
        centers = _text(np.linspace(-2.0, 2.2, q))
    lines += ["[rbf]", f"centers = {centers}", f"width = {recipe.width}", f"W_max = {recipe.W_max}", ""]
    lines += ["[graph]", f"edges = [{', '.join(_edges(random, N, recipe.weighted))}]"]
    for i, order in enumerate(recipe.orders):
        lines += ["", "[[player]]", *_player(recipe, random, i, order)]
    return "\n".join(lines) + "\n"


def _edges(random: np.random.Generator, N: int, weighted: bool) -> Iterable[str]:
    """A random spanning tree and about half as many edges more."""
    label = random.permutation(N) + 1
    pairs = {tuple(sorted((int(label[j]), int(label[random.integers(j)])))) for j in range(1, N)}
    for _ in range(N // 2):
        i, j = random.choice(N, 2, replace=False) + 1
        pairs.add(tuple(sorted((int(i), int(j)))))
    for i, j in sorted(pairs):
        weight = f", {_text(random.uniform(0.6, 2.0))}" if weighted else ""
        yield f"[{i}, {j}{weight}]"


def _player(recipe: Recipe, random: np.random.Generator, i: int, order: int) -> list[str]:
    N, D = len(recipe.orders), recipe.dimension
    short = recipe.short_forms and i == 0
    others = [j for j in range(N) if j != i]

    def entries(low: float, high: float) -> str:
        return _text(random.uniform(low, high)) if short else _text(random.uniform(low, high, D))

    lines = [f'name = "player {i + 1}"', f"order = {order}"]
    lines.append(f"x0 = {entries(-recipe.largest_start, recipe.largest_start)}")
    if recipe.starts:
        lines.append(f"{'z0' if order == 1 else 'v0'} = {entries(-1.0, 1.0)}")
        lines.append(f"y0 = [{', '.join(_text(random.uniform(-1.0, 1.0, D)) for _ in range(N))}]")
    coupled = sorted(random.choice(others, min(2, len(others)), replace=False).tolist())
    coupling = ", ".join(f"[{j + 1}, {_text(random.uniform(0.1, 0.6))}]" for j in coupled)
    quadratic, constant = _text(random.uniform(1.0, 3.0)), _text(random.uniform(-1.0, 1.0))
    lines.append(
        f"cost = {{ quadratic = {quadratic}, linear = {entries(-2.0, 2.0)}, constant = {constant}, "
        f"coupling = [{coupling}] }}"
    )
    if not (recipe.short_forms and i == N - 1):
        driving = sorted({i, int(random.choice(others))})
        linear = ", ".join(f"[{j + 1}, {entries(-1.0, 1.0)}]" for j in driving)
        bend = recipe.largest_square
        square = f"[{driving[0] + 1}, {entries(-bend, bend)}]" if bend else ""
        lines.append(f"dynamics = {{ linear = [{linear}], square = [{square}] }}")
    amplitude = entries(0.3 * recipe.largest_disturbance, recipe.largest_disturbance)
    lines.append(
        f"disturbance = {{ amplitude = {amplitude}, frequency = {entries(0.5, 4.0)}, "
        f"phase = {entries(-3.0, 3.0)}, bias = {entries(-0.5, 0.5)} }}"
    )
    return lines


def _text(value: Any) -> str:
    """A number or a list of numbers, two decimals."""
    if np.ndim(value) == 0:
        return f"{float(value) + 0.0:.2f}"
    return f"[{', '.join(_text(entry) for entry in value)}]"


if __name__ == "__main__":
    main()
