"""u_max: the control that reaches the plant lies within its bound, against the oracle extended by it."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from latex2mathml.converter import convert

import mixed_order_game as mog
from mixed_order_game import GameError, Simulator, build_fmu, check_game
from mixed_order_game.game.parameters import game_parameters
from mixed_order_game.reporting.formulas import BOUNDED, LOOP, loop
from mixed_order_game.studies.claims.control_bounds import control_bounds
from mixed_order_game.studies.designs import Range
from tests.oracle.game import read_game
from tests.oracle.simulate import simulate

GAME = """
title = "Three players with bounded controls"
dimension = 2
[gains]
k1 = 10.0
k2 = 1.0
k3 = 40.0
k4 = 20.0
beta = 20.0
delta = 6.0
epsilon = 0.5
[rbf]
centers = [-1.0, 0.0, 1.0]
width = 4.0
W_max = 30.0
[graph]
edges = [[1, 2], [2, 3, 0.5]]
[[player]]
name = "as strong as it likes"
order = 1
x0 = [2.0, -1.0]
cost = { quadratic = 1.0, linear = [1.0, 0.0], coupling = [[2, 0.5]] }
disturbance = { amplitude = 3.0, frequency = 2.0 }
[[player]]
name = "weaker along one coordinate"
order = 2
u_max = [9.0, 14.0]
x0 = [-2.0, 3.0]
v0 = [1.0, 0.0]
cost = { quadratic = 1.5, linear = [0.0, -1.0] }
dynamics = { linear = [[1, 0.5]] }
disturbance = { amplitude = [2.0, 4.0], frequency = 3.0 }
[[player]]
name = "weak"
order = 1
u_max = 7.0
x0 = [3.0, 1.0]
cost = { quadratic = 2.0, coupling = [[1, 0.3]] }
disturbance = { amplitude = 5.0, frequency = 4.0, bias = 1.0 }
"""


@pytest.fixture(scope="module")
def game(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bounded") / "game.toml"
    path.write_text(GAME)
    return path


@pytest.fixture(scope="module")
def bounded(game: Path) -> Path:
    return build_fmu(game, game.with_suffix(".fmu"))


def test_against_the_oracle(game: Path, bounded: Path) -> None:
    """Also where bounds change in the run, and how often a control comes to its bound or leaves it."""
    times = np.linspace(0.0, 2.0, 101)
    weaker = np.array([[np.inf, np.inf], [1.5, 14.0], [7.0, 7.0]])
    expected = simulate(read_game(game), times, rtol=1e-9, breakpoints=[(1.0, {"u_max": weaker})])
    with Simulator(bounded) as simulator:
        result = simulator.run(stop_time=2.0, step=0.02, tolerance=1e-8, changes={1.0: {"u_max[2,1]": 1.5}})
    np.testing.assert_allclose(result.x, expected.x, atol=1e-5)
    np.testing.assert_allclose(result.u[1:], expected.u[1:], atol=1e-3)
    assert np.abs(result.u[:, 0]).max() > 14.0
    assert np.abs(result.u[:50, 1]).max(axis=0).tolist() == [9.0, 14.0]
    assert np.abs(result.u[51:, 1, 0]).max() == 1.5
    assert expected.bound_passages > 10
    assert result["solver_events"][-1] == expected.bound_passages + expected.switch_count


def test_the_bound_is_a_variable_where_it_is_stated(bounded: Path) -> None:
    model = mog.read_model(bounded)
    assert sorted(model.indexed("u_max")) == [(2, 1), (2, 2), (3, 1), (3, 2)]
    assert not mog.read_model().indexed("u_max")
    assert {each.variability for each in model.indexed("u_max").values()} == {"tunable"}


@pytest.mark.parametrize(
    ("line", "instead", "told"),
    [
        ("u_max = 7.0", "u_max = 0.0", "u_max"),
        ("u_max = 7.0", "u_max = [7.0, -1.0]", "u_max"),
        ("u_max = 7.0", "u_max = [7.0]", "u_max"),
        (
            "u_max = 7.0\nx0 = [3.0, 1.0]\ncost = { quadratic = 2.0, coupling = [[1, 0.3]] }\n"
            "disturbance = { amplitude = 5.0, frequency = 4.0, bias = 1.0 }",
            'u_max = 7.0\nplant = "external"\ncost = { quadratic = 2.0, coupling = [[1, 0.3]] }',
            "no u_max of player 3, whose plant is external",
        ),
    ],
)
def test_what_is_no_bound(tmp_path: Path, line: str, instead: str, told: str) -> None:
    path = tmp_path / "game.toml"
    path.write_text(GAME.replace(line, instead))
    with pytest.raises(GameError, match=told):
        build_fmu(path, tmp_path / "game.fmu")
    assert any("u_max" in str(problem) for problem in check_game(path))


def test_validation_tells_what_the_bounds_do(bounded: Path) -> None:
    notes = "\n".join(mog.validate(bounded, limit=30.0).notes)
    assert "The theorems know no such bound" in notes
    assert "controls are at their bounds, of player " in notes
    assert "of player 2 until " in notes
    assert "of player 3 until " in notes
    assert "of player 1" not in notes
    assert "control of player 3 may have to reach 6" not in notes  # 1 + 5 = 6 is within 7


def test_each_player_beyond_its_bound_is_told_of_once() -> None:
    game = mog.Game(tomllib.loads(GAME))
    game.player(3)["u_max"] = [2.0, 3.0]
    beyond = (
        "To stay at x* the control of player 3 may have to reach 6, beyond its bound 2; then the loop "
        "linearized at x* without bounds is not the one that acts."
    )
    assert _told_of_player_3(game) == [beyond]
    game.player(3)["disturbance"] = {"bias": 1.0, "expression": "5 * sin(4 * t)"}
    game.player(2)["dynamics"] = {"expression": "sin(x[1,l])"}
    assert _told_of_player_3(game) == [beyond]


def _told_of_player_3(game: mog.Game) -> list[str]:
    model = game.model()
    return [note for note in control_bounds(None, game_parameters(model), model.path) if "player 3" in note]


@pytest.mark.parametrize("expression", [False, True])
def test_the_analysis_tells_what_the_theorems_do_not_know(expression: bool) -> None:
    game = mog.Game(tomllib.loads(GAME))
    if expression:
        game.player(1)["cost"] = {"expression": "x[1,1]^2 + x[1,2]^2 + x[1,1]"}
    found = mog.analyse(game, simulation=False)
    first = found.hypotheses[0]
    assert (first.name, first.holds) == ("Controls without bounds", False)
    assert first.figures.startswith("u_max of player 2, 3")
    assert not any(each.complete for each in found.demonstrations)
    assert any(
        each.startswith("Controls are bounded by u_max, which the theorems") for each in found.verdicts
    )


def test_reports_and_tuning_tell_of_bounds(bounded: Path) -> None:
    assert loop(mog.read_model(bounded))[-1][0] == "bounded control, players 2, 3"
    assert "merror" not in convert(BOUNDED)
    assert len(loop(mog.read_model())) == len(loop(None)) == len(LOOP)
    weak = mog.tune(bounded, 1.0, gains=["k2"], ranges={"k2": Range(0.9, 1.1)}, band=2.0)
    assert "the least u_max is 7: where one is at its bound" in " ".join(weak.notes)
