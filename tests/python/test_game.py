"""A game as an object: nothing of its file is lost, and what is changed is what is built and run."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mixed_order_game as mog


def test_what_is_read_is_what_is_written(tmp_path: Path) -> None:
    game = mog.Game("five_vehicles")
    assert game.text() == mog.default_game().read_text(encoding="utf-8")
    assert mog.Game().text() == game.text()
    assert repr(game).endswith("5 players>")
    game["gains"]["k1"] = 12.0
    game.player(2)["x0"] = [1.0, -1.0]
    path = game.write(tmp_path / "changed.toml")
    written = path.read_text(encoding="utf-8")
    before = mog.default_game().read_text(encoding="utf-8")
    assert written.count("#") == before.count("#")  # the comments
    assert len(set(written.splitlines()) ^ set(before.splitlines())) == 4
    tables = tomllib.loads(written)
    assert (tables["gains"]["k1"], tables["player"][1]["x0"]) == (12.0, [1.0, -1.0])
    with pytest.raises(mog.ResultError, match="exists"):
        game.write(path)
    game.write(path, force=True)


def test_it_is_built_checked_and_run(tmp_path: Path) -> None:
    game = mog.Game("five_vehicles")
    other = game.copy()
    other["gains"]["k1"] = 12.0
    assert (game.model().gains["k1"], other.model().gains["k1"]) == (10.0, 12.0)
    same = mog.run("five_vehicles", start_values={"k1": 12.0}, stop_time=0.5)
    np.testing.assert_array_equal(other.run(stop_time=0.5).x, same.x)
    assert other.build(tmp_path / "other.fmu") == tmp_path / "other.fmu"
    assert other.check() == ()
    other["gains"]["k1"] = -1.0
    (problem,) = other.check()
    assert problem.sentence == "gains.k1 is -1, expected a positive number"
    assert other.text().splitlines()[problem.line - 1].startswith("k1")
    with pytest.raises(mog.GameError, match=r"gains\.k1 is -1"):
        other.run()


def test_costs_as_text_and_as_functions() -> None:
    import sympy

    game = mog.Game("five_vehicles")
    text = "(x[1,1] - 3)^2 + 2 * x[1,2]^2 + exp(-x[1,1] / 4) + 0.1 * x[1,1] * x[2,1]"

    def cost(x: Any) -> Any:
        return (x[1, 1] - 3) ** 2 + 2 * x[1, 2] ** 2 + sympy.exp(-x[1, 1] / 4) + 0.1 * x[1, 1] * x[2, 1]

    other = game.copy()
    game.set_cost(1, text)
    other.set_cost(1, cost)
    assert "**" not in other.text()
    first, second = (each.run(stop_time=1.0, outputs=["x", "x_star"]) for each in (game, other))
    np.testing.assert_allclose(second.x_star, first.x_star, rtol=1e-10)
    np.testing.assert_allclose(second.x, first.x, rtol=1e-4, atol=1e-6)
    with pytest.raises(mog.GameError, match="the function gamma has no text here"):
        other.set_cost(1, lambda x: sympy.gamma(x[1, 1]))


def test_what_is_not_there() -> None:
    game = mog.Game("five_vehicles")
    for wrong, told in (
        (lambda: mog.Game("none.toml"), "there is no game file none.toml"),
        (lambda: game["gain"], "the game has no gain; it has title"),
        (lambda: game.player(6), "there is no player 6: the game has 5"),
    ):
        with pytest.raises(mog.GameError, match=told):
            wrong()
    assert "equilibrium" not in game
    assert game.get("equilibrium", {}) == {}
    game["parameters"] = {"price": 1.0}
    del game["parameters"]
    assert "parameters" not in game
