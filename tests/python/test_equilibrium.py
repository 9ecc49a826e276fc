"""What is said of x*: on the shipped games, and on games whose equilibria are known by hand."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import mixed_order_game as mog
from mixed_order_game.cli.app import app
from mixed_order_game.fmu.build import build_fmu, shipped_games
from mixed_order_game.game.equilibrium import Equilibrium, Kind, judge_equilibrium
from mixed_order_game.game.parameters import game_parameters
from mixed_order_game.studies.claims.equilibrium import nash_equilibrium_exists
from mixed_order_game.studies.claims.verdict import Verdict

GAME = """
title = "Two players"
dimension = 1
[gains]
k1 = 10.0
k2 = 1.0
k3 = 20.0
k4 = 20.0
beta = 1.0
delta = 1.0
epsilon = 0.1
[rbf]
centers = [0.0]
width = 2.0
W_max = 10.0
[graph]
edges = [[1, 2]]
[defaults]
order = 1
x0 = 1.0
%s
cost = { expression = "%s" }
[[player]]
name = "a"
[[player]]
name = "b"
"""

# where every own cost is proved convex everywhere; elsewhere the largest distance within which it can be
EVERYWHERE = {
    "cournot_two_markets", "energy_consumption", "energy_peak_price", "five_vehicles", "mobile_sensors",
    "opinion_formation", "power_control", "rivalling_pairs", "switching_cooling",
    "underwater_vehicles",
}  # fmt: skip
AT_MOST = {
    "source_seeking": 2.5,  # r, beyond which the field curves downwards
    "rate_allocation": 12.0,  # the capacity, beyond which charges are negative
}


def judged(game: Path | str) -> Equilibrium:
    found = judge_equilibrium(game)
    assert found is not None
    return found


def written(folder: Path, cost: str, more: str = 'z0 = "x0"\ny0 = "x0"') -> Path:
    path = folder / "game.toml"
    path.write_text(GAME % (more, cost), encoding="utf-8")
    return path


def check(path: Path) -> Result:
    return CliRunner(env={"NO_COLOR": "1"}).invoke(app, ["check", str(path)])


@pytest.mark.parametrize("name", sorted(shipped_games()))
def test_shipped_games_have_one_equilibrium(name: str) -> None:
    found = judged(name)
    assert found.kind is (Kind.NASH if name in EVERYWHERE else Kind.LOCAL)
    assert found.warnings == ()
    assert found.monotonicity > 0.0
    assert 0.1 < found.convex_within.min()
    assert found.convex_within.min() < AT_MOST.get(name, np.inf) or name in EVERYWHERE


def test_a_game_with_two_equilibria(tmp_path: Path) -> None:
    # each alone has minima at -1 and 1, and the coupling leaves four equilibria
    path = written(tmp_path, "(x[i]^2 - 1)^2 + 0.1 * x[1] * x[2]")
    found = judged(path)
    assert found.kind is Kind.LOCAL
    assert found.others
    for x in found.others:
        gradient = 4.0 * x * (x**2 - 1.0) + 0.1 * x[::-1]
        assert np.abs(gradient).max() < 1e-9
    done = check(path)
    assert done.exit_code == 0
    assert done.stdout.startswith(f"{path} is valid; x* is a local Nash equilibrium: no player gains")
    assert f"{path}: warning: Other starts lead to" in done.stderr


def test_no_strong_monotonicity(tmp_path: Path) -> None:
    # P' = [[2, 3], [3, 2]]: m = -1
    found = judged(written(tmp_path, "x[i]^2 + 3 * x[1] * x[2] + x[i]"))
    assert found.monotonicity == pytest.approx(-1.0)
    assert found.kind is Kind.NASH
    (warning,) = found.warnings
    assert "not strongly monotone, as the theorems suppose: m = -1" in warning  # at x* as everywhere


def test_an_open_second_order_condition(tmp_path: Path) -> None:
    # x* = 0 is no minimum along the own action: x^3 falls below it
    text = (GAME % ('z0 = "x0"\ny0 = "x0"', "x[i]^3 + x[1] * x[2]")).replace(
        "[defaults]", "[equilibrium]\nguess = [0.0, 0.0]\n[defaults]"
    )
    path = tmp_path / "open.toml"
    path.write_text(text, encoding="utf-8")
    found = judged(path)
    assert found.kind is Kind.OPEN
    assert "The second-order condition is open" in check(path).stderr
    fmu = build_fmu(path, tmp_path / "open.fmu")
    claim = nash_equilibrium_exists(game_parameters(mog.read_model(fmu)), fmu)
    assert claim.verdict is Verdict.NOT_SETTLED
    assert claim.reason.startswith("The second-order condition is open")


def test_a_concave_cost_is_an_error_that_names_the_player(tmp_path: Path) -> None:
    path = written(tmp_path, "if(i == 2, -1, 1) * (x[i] - 1)^2 + 0.1 * x[1] * x[2]")
    done = check(path)
    assert done.exit_code == 1
    assert "player[2].cost is concave in the player's own action" in done.stderr
    with pytest.raises(mog.GameError, match=r"player\[2\].cost is concave"):
        judged(path)


def test_estimates_that_begin_where_a_cost_is_undefined(tmp_path: Path) -> None:
    path = written(tmp_path, "x[i] - log(x[i]) + 0.1 * x[1] * x[2]", "")
    found = judged(path)
    assert found.undefined_at_start == (1, 2)
    assert "cost is not finite at its first estimates" in found.warnings[0]
    fmu = build_fmu(path, tmp_path / "game.fmu")
    with pytest.raises(mog.MixedOrderGameError, match=r"expected y0\[1,j,l\] at which .* z0"):
        mog.run(fmu, stop_time=0.1)
    assert judged(written(tmp_path, "x[i] - log(x[i]) + 0.1 * x[1] * x[2]")).warnings == ()


def test_a_search_that_begins_where_a_cost_is_undefined(tmp_path: Path) -> None:
    told = "player[1].cost is not finite where the search for the Nash equilibrium begins"
    assert told in check(written(tmp_path, "x[i] - log(x[i] - 20)", "")).stderr


def test_gradients_that_vanish_where_costs_are_undefined_are_no_equilibrium(tmp_path: Path) -> None:
    # 0.2 - 1 / (1 + x_i) + 0.1 x_j vanishes at x_i = x_j = -4.7, too, where log(1 + x_i) is none
    found = judged(written(tmp_path, "0.2 * x[i] - log(1 + x[i]) + 0.1 * x[1] * x[2]"))
    assert found.x_star.min() > -1.0
    assert all(x.min() > -1.0 for x in found.others)


def test_an_fmu_is_judged_by_its_own_file(tmp_path: Path) -> None:
    path = written(tmp_path, "cosh(x[i] - i) + 0.1 * x[1] * x[2]")
    fmu = build_fmu(path, tmp_path / "game.fmu")
    path.unlink()
    assert judged(fmu).kind is Kind.NASH
    claim = nash_equilibrium_exists(game_parameters(mog.read_model(fmu)), fmu)
    assert claim.verdict is Verdict.HOLDS
    assert claim.reason.startswith("x* is a Nash equilibrium: every cost is convex")
