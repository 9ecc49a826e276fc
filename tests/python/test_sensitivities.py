"""Derivatives of a run by its parameters against those of the matrix exponential, and what is refused."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mixed_order_game as mog
from tests.oracle.equilibrium import nash_equilibrium
from tests.oracle.game import Game, read_game
from tests.oracle.linear_loop import exact_solution

FIVE_VEHICLES = Path(__file__).resolve().parents[2] / "modelDescription/games/five_vehicles.toml"
LINEAR = {"robust": False, "perturbed": False}


def moved(game: Game, part: str, index: tuple[int, ...], by: float) -> Game:
    value = np.array(getattr(game, part), dtype=float)
    value[index] += by
    if part == "adjacency":
        value[index[::-1]] = value[index]
    changed: Any = {part: value if index else float(value)}
    return replace(game, **changed)


def differences(of: Callable[[Game], Any], game: Game, part: str, index: tuple[int, ...]) -> Any:
    """Of the exact solution, so that they have nine digits."""
    h = 1e-5
    return (of(moved(game, part, index, h)) - of(moved(game, part, index, -h))) / (2.0 * h)


def test_they_are_those_of_the_matrix_exponential() -> None:
    parts: dict[str, tuple[str, tuple[int, ...]]] = {
        "k1": ("k1", ()),
        "k2": ("k2", ()),
        "k3": ("k3", ()),
        "k4": ("k4", ()),
        "a[1,2]": ("adjacency", (0, 1)),
        "x0[2,1]": ("x0", (1, 0)),
        "cost_linear[4,2]": ("cost_linear", (3, 1)),
        "cost_quadratic[3]": ("cost_quadratic", (2,)),
    }
    game = read_game(FIVE_VEHICLES)
    start = {**LINEAR, "a[1,3]": 0.5}
    game.adjacency[0, 2] = game.adjacency[2, 0] = 0.5
    found = mog.sensitivities(
        start_values=start, parameters=list(parts), stop_time=1.0, step=0.25, tolerance=1e-9
    )
    assert list(found.derivatives) == list(parts)

    def actions(game: Game) -> Any:
        later = exact_solution(game, found.time[1:])[:, : game.x0.size]
        return np.concatenate([game.x0[np.newaxis], later.reshape(-1, *game.x0.shape)])

    np.testing.assert_allclose(found.x, actions(game), atol=1e-7)
    for name, (part, index) in parts.items():
        expected = differences(actions, game, part, index)
        np.testing.assert_allclose(found[name], expected, atol=1e-6 * np.abs(expected).max(), err_msg=name)
        np.testing.assert_allclose(
            found.x_star_derivatives[name], differences(nash_equilibrium, game, part, index), atol=1e-9
        )
        errors = differences(
            lambda game: np.linalg.norm(actions(game) - nash_equilibrium(game), axis=(1, 2)),
            game,
            part,
            index,
        )
        np.testing.assert_allclose(
            found.nash_error_derivative(name), errors, atol=1e-6 * np.abs(errors).max()
        )


def test_the_run_is_that_of_the_fmu() -> None:
    found = mog.sensitivities(parameters=["k2"], start_values={"k1": 12.0}, start_time=3.0, stop_time=4.0)
    result = mog.run(start_values={"k1": 12.0}, start_time=3.0, stop_time=4.0)
    np.testing.assert_array_equal(found.time, result.time)
    np.testing.assert_array_equal(found.x, result.x)
    np.testing.assert_allclose(found.nash_error, result.nash_error, rtol=1e-14)
    assert found.parameters["k1"] == 12.0


def test_names_and_units() -> None:
    found = mog.sensitivities(parameters=["x0", "k1", "disturbance_frequency[2,1]"], stop_time=0.1)
    assert list(found.derivatives)[:2] == ["x0[1,1]", "x0[1,2]"]
    assert len(found.derivatives) == 12
    assert found["x0[2,1]"][0].tolist() == [[0.0, 0.0], [1.0, 0.0], *[[0.0, 0.0]] * 3]
    assert found.units["k1"] == "s"
    assert found.units["disturbance_frequency[2,1]"] == "1/(rad/s)"
    with pytest.raises(mog.VariableError, match=r"no derivative by k2; there are those by x0\[1,1\]"):
        found["k2"]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"parameters": ["k11"]}, "there is no variable k11; did you mean"),
        ({"parameters": ["robust"]}, "robust is a Boolean parameter, expected a Real parameter"),
        ({"parameters": ["x[1,1]"]}, r"x\[1,1\] is a Real output, expected a Real parameter"),
        ({"parameters": []}, "parameters are missing: expected at least one name"),
        ({"parameters": "k1"}, "parameters = 'k1' is no list of names"),
        (
            {"parameters": ["judge_from"]},
            r'parameters\[1\] is "judge_from", expected a Real parameter on which',
        ),
        ({"tolerance": 2.0}, "tolerance = 2 is not between 0 and 1"),
        ({"stop_time": -1.0}, "stop_time = -1 s is not after start_time = 0 s"),
        ({"start_values": {"k1": -1.0}}, "k1 is -1, expected"),
        ({"start_values": {"a": 0.0}}, "the weights a.* leave the players in separate groups"),
        ({"game": "switching_cooling", "parameters": ["price"]}, "expected no parameter of expressions"),
    ],
)
def test_what_is_refused(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(mog.MixedOrderGameError, match=message):
        mog.sensitivities(**{"parameters": ["k1"], "stop_time": 1.0, **asked})
