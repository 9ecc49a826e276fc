"""Players that talk once a period: our master against exact propagation, and the study."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import mixed_order_game as mog
from mixed_order_game.cli.app import app
from mixed_order_game.errors import ExperimentError, GameError, ModelError
from mixed_order_game.fmu.coupled import Coupled
from mixed_order_game.fmu.run import samples
from mixed_order_game.game.parameters import game_parameters
from mixed_order_game.theory.sampled import longest_period, period_map
from mixed_order_game.theory.spectrum import initial_deviation, linear_loop

TWO = [[1, 2], [3, 4, 5]]
ALL = [[1, 2, 3, 4, 5]]


@pytest.mark.parametrize(("groups", "directed"), [(None, False), (TWO, True)])
def test_parts_move_as_the_exact_map_of_a_period(
    groups: list[list[int]] | None, directed: bool, tmp_path: Path
) -> None:
    """Without robust part and perturbation the loop is linear: s(k h) = P^k s(0)."""
    game = mog.Game("five_vehicles")
    game.player(2)["gains"] = {"k2": 0.7, "k3": 40.0}
    if directed:
        game["graph"] = {"directed": True, "edges": [[1, 2], [2, 3], [3, 4], [4, 5], [5, 1], [1, 4, 0.5]]}
    path = game.write(tmp_path / "game.toml")
    parameters = game_parameters(mog.read_model(path))
    period = 0.08
    with Coupled(path, groups) as coupled:
        plain = {"robust": False, "perturbed": False}
        x = coupled.run(samples(0.0, 0.8, period), start_values=plain, tolerance=1e-9)
        step = period_map(parameters, coupled.groups, period)
    state = initial_deviation(parameters)
    x_star = mog.run(path, stop_time=0.1).x_star
    for k in range(len(x)):
        np.testing.assert_allclose(x[k] - x_star, state[:5], atol=2e-6, err_msg=str(k))
        state = step @ state


def test_parts_share_the_code_of_one_library() -> None:
    with Coupled("five_vehicles") as coupled:
        assert len({part._slave.dll._handle for part in coupled._parts}) == 1


def test_the_longest_period_is_where_the_map_turns_unstable() -> None:
    parameters = game_parameters(mog.read_model("five_vehicles"))
    apart = [[number] for number in range(1, 6)]
    limit = longest_period(parameters, apart)
    assert limit == pytest.approx(0.1618, abs=1e-4)

    def radius(period: float) -> float:
        return float(np.abs(np.linalg.eigvals(period_map(parameters, apart, period))).max())

    assert radius(0.999 * limit) < 1.0 < radius(1.001 * limit)
    assert longest_period(parameters, TWO) > limit
    assert longest_period(parameters, ALL) == np.inf
    exact = np.linalg.eigvals(linear_loop(parameters))
    assert np.sort(np.exp(0.05 * exact.real)) == pytest.approx(
        np.sort(np.abs(np.linalg.eigvals(period_map(parameters, ALL, 0.05)))), abs=1e-9
    )


def test_the_longest_period_goes_with_the_loops_own_times_and_is_zero_where_that_is_unstable() -> None:
    parameters = game_parameters(mog.read_model("five_vehicles"))
    apart = [[number] for number in range(1, 6)]
    unstable = replace(parameters, k1=5.0, k3=5.0, k4=5.0)
    assert np.linalg.eigvals(linear_loop(unstable)).real.max() > 0.0
    assert longest_period(unstable, apart) == 0.0
    # of players of order 1 alone, all rates of the loop are in proportion to the gains
    first = replace(parameters, order=np.ones(5, dtype=int), k1=10.0)
    faster = replace(first, k1=1e4, k2=1e3, k3=5e4)
    assert longest_period(faster, apart) == pytest.approx(1e-3 * longest_period(first, apart), rel=1e-3)


def test_the_study_tells_which_period_is_survived(tmp_path: Path) -> None:
    figure = tmp_path / "periods.svg"
    options = ["periods", "--period", "0.05", "--period", "0.12", "--period", "0.3", "--json", "--search"]
    options += ["--stop-time", "10"]
    done = CliRunner().invoke(app, [*options, "--figure", str(figure)])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert [run["verdict"] for run in found["runs"]] == ["settles", "shrinks", "grows"]
    assert found["whole_error"] < found["runs"][0]["final_error"] < 2.0 * found["whole_error"]
    assert 0.13 < found["survived"][0] < found["survived"][1] < 0.155
    assert found["unperturbed_limit"] == pytest.approx(0.1618, abs=1e-4)
    assert figure.read_text(encoding="utf-8").count("grows") > 0
    together = mog.periods(
        "five_vehicles", [0.2], groups=TWO, stop_time=4.0, start_values={"k2": 1.5}, search=True
    )
    assert "0.2 s is survived: search among longer ones." in together.notes
    grown = replace(together, runs=(replace(together[0.2], verdict="grows"),))
    assert "0.2 s is not survived: search among shorter ones." in grown.notes
    hopeless = replace(grown, unperturbed_limit=0.0).notes
    assert "0.2 s is not survived." in hopeless
    assert "Without robust part and perturbation the loop is unstable, however short the period." in hopeless
    assert together[0.2].verdict == "shrinks"
    assert "0.2 s shrinks" in repr(together)
    assert "difference from the whole game" in together._repr_html_()


def test_what_cannot_be_coupled_is_refused() -> None:
    with pytest.raises(ExperimentError, match="0 s is not positive"):
        mog.periods("five_vehicles", [0.0])
    with pytest.raises(ExperimentError, match="period 5 s is longer than a fifth of the run of 20 s"):
        mog.periods("five_vehicles", [5.0])
    with pytest.raises(GameError, match="each player from 1 to 5 in one of them"):
        mog.periods("five_vehicles", groups=[[1, 2], [2, 3, 4, 5]])
    game = mog.Game("five_vehicles")
    player = game.player(1)
    for key in ("x0", "dynamics", "disturbance"):
        player.pop(key, None)
    player["plant"] = "external"
    with pytest.raises(ModelError, match="waits for the plant of player 1"):
        mog.periods(game)
