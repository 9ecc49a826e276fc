"""Directional derivatives of the example games with expressions, against differences of formulas by hand."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import mixed_order_game as mog
from mixed_order_game.fmu.build import build_fmu
from tests.games_by_hand import BY_HAND, fewer_households, two_hundred_households
from tests.oracle.general_loop import GeneralLoop

GAMES = Path(__file__).resolve().parents[2] / "modelDescription" / "games"
STEP = 4e-6
COLUMNS = 25  # of the states, drawn


@pytest.mark.parametrize(
    "name", sorted(set(BY_HAND) - {"two_hundred_households"})
)  # which shows no estimates
def test_rates_change_along_states_as_those_by_hand(name: str) -> None:
    text = (GAMES / f"{name}.toml").read_text(encoding="utf-8")
    compare(name, GeneralLoop(tomllib.loads(text), BY_HAND[name]()))


def test_those_of_the_first_forty_households_as_well(tmp_path: Path) -> None:
    text = fewer_households(40)
    game = tmp_path / "game.toml"
    game.write_text(text, encoding="utf-8")
    fmu = build_fmu(game, tmp_path / "game.fmu")
    compare(fmu, GeneralLoop(tomllib.loads(text), two_hundred_households(40)))


def compare(model: str | Path, loop: GeneralLoop) -> None:
    random = np.random.default_rng(3)
    state = loop.initial_state()
    x, p, y, W = loop.unpack(state)
    for each in (x, p, y):
        np.add(each, random.uniform(-0.05, 0.05, each.shape), out=each)  # away from where all estimates agree
    state = np.concatenate([x.ravel(), p.ravel(), y.ravel(), W.ravel()])
    names, start = [], {}
    for letter, values in (("x", x), ("p", p), ("y", y), ("W", W)):
        for index, value in np.ndenumerate(values):
            stem = ("z" if loop.first[index[0]] else "v") if letter == "p" else letter
            entry = f"[{','.join(str(k + 1) for k in index)}]"
            names.append(stem + entry)
            if letter != "W":
                start[f"{stem}0{entry}"] = float(value)
    chosen = np.sort(random.choice(len(names), COLUMNS, replace=False))
    with mog.Simulator(model) as simulator:
        found = simulator.jacobian(names, start, along=[[names[k]] for k in chosen])
    for column, k in enumerate(chosen):
        step = np.zeros_like(state)
        step[k] = STEP * max(1.0, abs(state[k]))

        def difference(h: float, step: np.ndarray = step) -> np.ndarray:
            return (loop.rate(0.0, state + h * step) - loop.rate(0.0, state - h * step)) / (
                2.0 * h * step.max()
            )

        by_hand = (4.0 * difference(0.5) - difference(1.0)) / 3.0  # of order four: tanh is steep in its layer
        rounding = 10.0 * np.finfo(float).eps * np.abs(loop.rate(0.0, state)).max() / step[k]
        near = rounding + 1e-8 * max(1.0, np.abs(by_hand).max())
        np.testing.assert_allclose(found[:, column], by_hand, rtol=0.0, atol=near, err_msg=names[k])
