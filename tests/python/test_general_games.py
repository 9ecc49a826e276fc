"""Games that nobody tuned the product to: trajectories and equilibria against Python functions, by SciPy.

The example games that have expressions, typed by hand, and random ones whose texts and functions are made
together.
"""

import tomllib
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mixed_order_game as mog
from mixed_order_game.fmu.build import build_fmu
from tests.games_by_hand import BY_HAND
from tests.oracle.general_loop import Functions, GeneralLoop, equilibrium
from tests.random_expressions import SMOOTH, random_game
from tests.switching_games import JUMPS, switching_game
from tests.switching_games import compare as compare_switching

GAMES = Path(__file__).resolve().parents[2] / "modelDescription" / "games"
# fmt: off
FUNCTIONS = [
    "abs", "sqrt", "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "asin", "acos", "atan",
    "atan2", "sinh", "cosh", "tanh", "erf", "hypot", "min", "max", "sign", "floor", "mod", "if",
    "sum", "prod", "square", "pulse", "noise",
]
# fmt: on
SIZES = [(2, 2), (3, 3), (4, 1), (5, 2), (6, 2), (8, 1), (12, 1), (2, 3), (3, 1), (4, 2)]
SEEDS = range(1, 21)


@pytest.fixture(autouse=True)
def archives_are_not_compressed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which takes longer than all else."""
    write: Callable[..., None] = zipfile.ZipFile.writestr

    def stored(archive: zipfile.ZipFile, entry: Any, data: bytes, **_: Any) -> None:
        write(archive, entry, data, compress_type=zipfile.ZIP_STORED)

    monkeypatch.setattr(zipfile.ZipFile, "writestr", stored)


def compare(game: Path, functions: Functions, stop_time: float, tmp_path: Path) -> None:
    loop = GeneralLoop(tomllib.loads(game.read_text(encoding="utf-8")), functions)
    all_of_it = loop.N < 100
    second = not loop.first.all()
    outputs = ["x", "cost", *(["v"] if second else []), *(["y"] if all_of_it else [])]
    fmu = build_fmu(game, tmp_path / "game.fmu")
    found = mog.run(fmu, stop_time=stop_time, step=stop_time / 20.0, tolerance=1e-8, outputs=outputs)
    x, p, y, _ = loop.unpack(loop.solve(found.time))
    assert np.abs(found.x - x).max() < 2e-5
    if second:
        assert np.abs((found.v - p)[:, ~loop.first]).max() < 2e-5
    if all_of_it:
        assert np.abs(found.y - y).max() < 2e-5
    assert np.abs(found.x_star - equilibrium(functions.costs, loop.x0)).max() < 1e-10
    costs = functions.costs(np.broadcast_to(loop.x0, (loop.N, loop.N, loop.D)))
    np.testing.assert_allclose([found.columns[f"cost[{i + 1}]"][0] for i in range(loop.N)], costs, rtol=1e-12)


@pytest.mark.parametrize("name", BY_HAND)
def test_examples_move_as_their_formulas_by_hand(name: str, tmp_path: Path) -> None:
    stop_time = 0.01 if name == "two_hundred_households" else 1.0
    compare(GAMES / f"{name}.toml", BY_HAND[name](), stop_time, tmp_path)


@pytest.mark.parametrize("seed", SEEDS)
def test_random_games_move_as_the_functions_made_with_them(seed: int, tmp_path: Path) -> None:
    made = random_game(seed, *SIZES[seed % len(SIZES)])
    game = tmp_path / "game.toml"
    game.write_text(made.text, encoding="utf-8")
    compare(game, made.functions, 1.0, tmp_path)


@pytest.mark.parametrize("seed", range(len(JUMPS)))
def test_random_games_that_switch_do_so_as_often_as_the_functions_made_with_them(
    seed: int, tmp_path: Path
) -> None:
    seen = compare_switching(switching_game(seed, 2 + seed % 3, 1 + seed % 2), tmp_path)
    assert seen.difference < 2e-5
    assert seen.events[0] == seen.events[1] > 0


def test_the_games_are_thirty_and_use_every_function() -> None:
    made = [random_game(seed, *SIZES[seed % len(SIZES)]) for seed in SEEDS]
    assert len(BY_HAND) + len(made) == 30
    assert {size[0] for size in SIZES} >= {2, 12}
    assert {size[1] for size in SIZES} == {1, 2, 3}
    assert set[str]().union(*(game.used for game in made)) == set(SMOOTH)
    texts = [(GAMES / f"{name}.toml").read_text(encoding="utf-8") for name in BY_HAND]
    texts += [game.text for game in made]
    texts += [switching_game(seed, 2, 1).text for seed in range(len(JUMPS))]
    assert [name for name in FUNCTIONS if not any(f"{name}(" in text for text in texts)] == []
