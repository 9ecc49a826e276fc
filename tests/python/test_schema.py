"""The JSON Schema of game files: every game passes, each malformed one fails, as the judge says."""

import copy
import json
import math
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from typer.testing import CliRunner

from mixed_order_game.cli.app import app
from mixed_order_game.game.check import check_game
from mixed_order_game.game.new import Recipe, new_game
from mixed_order_game.game.schema import game_schema, schema_path

ROOT = Path(__file__).resolve().parents[2]
GAMES = sorted(
    [*(ROOT / "modelDescription/games").glob("*.toml"), *(ROOT / "tests/reference/games").glob("*.toml")]
)
Edit = Callable[[dict[str, Any]], object]


def put(value: object, *path: str | int) -> Edit:
    """Set one entry."""

    def edit(game: Any) -> None:
        *parents, last = path
        for step in parents:
            game = game[step]
        game[last] = value

    return edit


def drop(*path: str | int) -> Edit:
    """Remove one entry."""

    def edit(game: Any) -> None:
        *parents, last = path
        for step in parents:
            game = game[step]
        del game[last]

    return edit


MALFORMED: dict[str, Edit] = {
    **{f"no {key}": drop(key) for key in ("title", "dimension", "gains", "rbf", "graph", "player")},
    **{f"no gain {key}": drop("gains", key) for key in ("k1", "k2", "k3", "k4", "beta", "delta", "epsilon")},
    **{f"no rbf {key}": drop("rbf", key) for key in ("centers", "width", "W_max")},
    **{f"no player {key}": drop("player", 1, key) for key in ("name", "order", "x0")},
    "no edges": drop("graph", "edges"),
    "title is a number": put(1, "title"),
    "title of two lines": put("a\nb", "title"),
    "dimension 0": put(0, "dimension"),
    "dimension 101": put(101, "dimension"),
    "dimension is real": put(2.5, "dimension"),
    "dimension is true": put(True, "dimension"),
    "expose some": put("some", "expose"),
    "expose is true": put(True, "expose"),
    "strategy is a list": put([], "strategy"),
    "robust is text": put("yes", "strategy", "robust"),
    "unknown strategy": put(True, "strategy", "strong"),
    "k1 is zero": put(0.0, "gains", "k1"),
    "k2 is negative": put(-1, "gains", "k2"),
    "k3 is text": put("50", "gains", "k3"),
    "beta is negative": put(-0.1, "gains", "beta"),
    "delta is a list": put([1.0], "gains", "delta"),
    "epsilon is zero": put(0, "gains", "epsilon"),
    "unknown gain": put(1.0, "gains", "k5"),
    "no centers": put([], "rbf", "centers"),
    "centers is a number": put(1.0, "rbf", "centers"),
    "center is text": put("a", "rbf", "centers", 1),
    "numbers, then a list": put([1.0, 2.0], "rbf", "centers", 1),
    "a list, then numbers": put([1.0] * 10, "rbf", "centers", 0),
    "width is zero": put(0.0, "rbf", "width"),
    "W_max is negative": put(-1.0, "rbf", "W_max"),
    "unknown rbf": put(1.0, "rbf", "rho"),
    "edges is a table": put({}, "graph", "edges"),
    "edge of one": put([1], "graph", "edges", 0),
    "edge of four": put([1, 2, 1.0, 1.0], "graph", "edges", 0),
    "edge of player 0": put([0, 1], "graph", "edges", 0),
    "edge of reals": put([1.5, 2], "graph", "edges", 0),
    "edge of weight 0": put([1, 2, 0.0], "graph", "edges", 0),
    "edge to player 1001": put([1, 1001], "graph", "edges", 0),
    "unknown graph": put([], "graph", "vertices"),
    "one player": lambda game: game["player"].__delitem__(slice(1, None)),
    "players is a table": put({}, "player"),
    "player is a number": put(1, "player", 0),
    "name is empty": put("", "player", 0, "name"),
    "name is a number": put(1, "player", 0, "name"),
    "order 3": put(3, "player", 0, "order"),
    "order is text": put("first", "player", 0, "order"),
    "gains of a player is a number": put(1.0, "player", 0, "gains"),
    "k2 of a player is zero": put({"k2": 0.0}, "player", 0, "gains"),
    "unknown gain of a player": put({"k5": 1.0}, "player", 0, "gains"),
    "k4 of order 1": put({"k4": 1.0}, "player", 0, "gains"),
    "k1 of order 2": put({"k1": 1.0}, "player", 4, "gains"),
    "rbf of a player is a list": put([], "player", 0, "rbf"),
    "width of a player is zero": put({"width": 0.0}, "player", 0, "rbf"),
    "W0 is a number": put(1.0, "player", 0, "W0"),
    "W0 of text": put(["a"] * 11, "player", 0, "W0"),
    "directed is a number": put(1, "graph", "directed"),
    "x0 is text": put("0", "player", 0, "x0"),
    "x0 is empty": put([], "player", 0, "x0"),
    "x0 of text": put([1.0, "a"], "player", 0, "x0"),
    "v0 of order 1": put(0.0, "player", 0, "v0"),
    "z0 of order 2": put(0.0, "player", 4, "z0"),
    "y0 is text": put("a", "player", 0, "y0"),
    "y0 of text": put([[0.0, "a"]] * 5, "player", 0, "y0"),
    "cost is a number": put(1.0, "player", 0, "cost"),
    "unknown cost": put(1.0, "player", 0, "cost", "cubic"),
    "quadratic is a list": put([1.0], "player", 0, "cost", "quadratic"),
    "coupling is a number": put(1.0, "player", 0, "cost", "coupling"),
    "coupling of one": put([[2]], "player", 0, "cost", "coupling"),
    "coupling of three": put([[2, 1.0, 1.0]], "player", 0, "cost", "coupling"),
    "coupling of text": put([[2, "a"]], "player", 0, "cost", "coupling"),
    "coupling to player 0": put([[0, 1.0]], "player", 0, "cost", "coupling"),
    "dynamics is a list": put([], "player", 0, "dynamics"),
    "unknown dynamics": put([], "player", 0, "dynamics", "cubic"),
    "term without coefficients": put([[1]], "player", 0, "dynamics", "linear"),
    "term of text": put([[1, "a"]], "player", 0, "dynamics", "square"),
    "disturbance is text": put("loud", "player", 0, "disturbance"),
    "unknown disturbance": put(1.0, "player", 0, "disturbance", "colour"),
    "amplitude is text": put("a", "player", 0, "disturbance", "amplitude"),
    "z0 is x1": put("x1", "player", 0, "z0"),
    "cost expression is a number": put(1.0, "player", 0, "cost", "expression"),
    "cost expression is a list": put(["x[1,1]"], "player", 0, "cost", "expression"),
    "dynamics expression is a number": put(1.0, "player", 0, "dynamics", "expression"),
    "dynamics expression of numbers": put([1.0, 2.0], "player", 0, "dynamics", "expression"),
    "disturbance expression is true": put(True, "player", 0, "disturbance", "expression"),
    "defaults is a list": put([], "defaults"),
    "default of a name": put({"name": "a"}, "defaults"),
    "unknown default": put({"colour": 1}, "defaults"),
    "parameters is a list": put([], "parameters"),
    "parameter is text": put({"a": "1"}, "parameters"),
    "parameter is an empty list": put({"a": []}, "parameters"),
    "parameter of rows and numbers": put({"a": [[1.0], 2.0]}, "parameters"),
    "parameter without a value": put({"a": {"min": 0.0}}, "parameters"),
    "unknown key of a parameter": put({"a": {"value": 1.0, "least": 0.0}}, "parameters"),
    "min is text": put({"a": {"value": 1.0, "min": "0"}}, "parameters"),
    "fixed is a number": put({"a": {"value": 1.0, "fixed": 1}}, "parameters"),
    "unit is a number": put({"a": {"value": 1.0, "unit": 1}}, "parameters"),
    "parameter of a variable's name": put({"x": 1.0}, "parameters"),
    "parameter of a function's name": put({"hypot": 1.0}, "parameters"),
    "parameter of two words": put({"two words": 1.0}, "parameters"),
    "equilibrium is a number": put(1.0, "equilibrium"),
    "unknown equilibrium": put({"start": [1.0]}, "equilibrium"),
    "guess is a number": put({"guess": 1.0}, "equilibrium"),
    "unknown key": put(1, "colour"),
    "unknown key of a player": put(1, "player", 0, "colour"),
}

OF_KNOWN_SIZE: dict[str, Edit] = {
    "x0 of three": put([1.0, 2.0, 3.0], "player", 0, "x0"),
    "y0 of four": put([[0.0, 0.0]] * 4, "player", 0, "y0"),
    "edge to player 6": put([1, 6], "graph", "edges", 0),
    "coupling to player 6": put([[6, 1.0]], "player", 0, "cost", "coupling"),
    "amplitude of one": put([1.0], "player", 0, "disturbance", "amplitude"),
    "y0 of three numbers": put([0.0] * 3, "player", 0, "y0"),
    "dynamics expression of three": put(["0"] * 3, "player", 0, "dynamics", "expression"),
    "guess of four": put({"guess": [0.0] * 4}, "equilibrium"),
    "vector centers of nine": put([[0.0] * 9] * 11, "rbf", "centers"),
}


def example() -> dict[str, Any]:
    return tomllib.loads((ROOT / "modelDescription/games/five_vehicles.toml").read_text(encoding="utf-8"))


def toml(value: object, *, top: bool = True) -> str:
    """TOML text: nested tables inline."""
    if isinstance(value, dict):
        if top:
            return "".join(f"{json.dumps(key)} = {toml(each, top=False)}\n" for key, each in value.items())
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v, top=False)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(toml(each, top=False) for each in value) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    return json.dumps(value)


def test_is_a_schema_of_2020_12_and_is_shipped() -> None:
    schema = json.loads(schema_path().read_text(encoding="utf-8"))
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator.check_schema(game_schema(players=5, dimension=2))
    assert schema == game_schema() == game_schema(players=1, dimension=0)


@pytest.mark.parametrize("path", GAMES, ids=lambda path: path.stem)
def test_every_game_passes(path: Path) -> None:
    game = tomllib.loads(path.read_text(encoding="utf-8"))
    jsonschema.validate(game, game_schema())
    jsonschema.validate(game, game_schema(players=len(game["player"]), dimension=game["dimension"]))


ACCEPTED: dict[str, Edit] = {
    "y0 of coordinates": put([1.0, 2.0], "player", 0, "y0"),
    "y0 = x0": put("x0", "player", 0, "y0"),
    "z0 = x0": put("x0", "player", 0, "z0"),
    "expressions": put({"linear": 1.0, "quadratic": 1.0, "expression": "x[i,1]^4"}, "player", 0, "cost"),
    "expressions by coordinate": put({"expression": ["x[1,1]", "x[1,2]"]}, "player", 0, "dynamics"),
    "expression with l": put({"expression": "sin(l * t)"}, "player", 0, "disturbance"),
    "parameters": put(
        {
            "A": 1,
            "b": [1.0, 2],
            "C": [[1.0], [2.0]],
            "d_2": {"value": 1.0, "max": 2, "unit": "m", "fixed": True},
        },
        "parameters",
    ),
    "gains of a player": put({"k1": 12.0, "beta": 0.0}, "player", 0, "gains"),
    "rbf of a player": put({"W_max": 3.0, "centers": [0.0] * 11}, "player", 0, "rbf"),
    "W0": put([0.1, [0.2, 0.3], *[0.0] * 9], "player", 0, "W0"),
    "directed": put({"directed": True, "edges": [[1, 2], [2, 3], [3, 4], [4, 5], [5, 1, 0.5]]}, "graph"),
    "default gains": put({"gains": {"k1": 12.0, "k4": 30.0}}, "defaults"),
    "guess": put({"guess": [1.0, [2.0, 3.0], 4.0, 5.0, 6.0]}, "equilibrium"),
    "defaults": put({"order": 2, "v0": 1.0, "z0": 1.0, "y0": "x0"}, "defaults"),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_what_the_judge_accepts_passes(name: str, tmp_path: Path) -> None:
    game = copy.deepcopy(example())
    ACCEPTED[name](game)
    path = tmp_path / "game.toml"
    path.write_text(toml(game), encoding="utf-8")
    assert check_game(path) == ()
    jsonschema.validate(game, game_schema())
    jsonschema.validate(game, game_schema(players=5, dimension=2))


@pytest.mark.parametrize("key", ["order", "x0"])
def test_a_player_needs_no_key_that_the_defaults_have(key: str) -> None:
    game = copy.deepcopy(example())
    game["defaults"] = {key: game["player"][1].pop(key)}
    jsonschema.validate(game, game_schema())


@pytest.mark.parametrize("graph", ["ring", "star"])
def test_new_games_pass(graph: str) -> None:
    jsonschema.validate(tomllib.loads(new_game(Recipe(5, 3, graph=graph))), game_schema())


@pytest.mark.parametrize("name", [*MALFORMED, *OF_KNOWN_SIZE])
def test_malformed_games_fail_as_the_judge_says(name: str, tmp_path: Path) -> None:
    game = copy.deepcopy(example())
    (MALFORMED | OF_KNOWN_SIZE)[name](game)
    schema = game_schema() if name in MALFORMED else game_schema(players=5, dimension=2)
    assert not jsonschema.Draft202012Validator(schema).is_valid(game)
    path = tmp_path / "game.toml"
    path.write_text(toml(game), encoding="utf-8")
    assert check_game(path) != ()


def test_every_part_that_can_fail_says_what_it_expects() -> None:
    def parts(each: object, path: str = "") -> list[str]:
        if isinstance(each, list):
            return [found for k, item in enumerate(each) for found in parts(item, f"{path}/{k}")]
        if not isinstance(each, dict):
            return []
        silent = (
            [path]
            if "type" in each and "x-expected" not in each and not path.endswith(("/if", "/contains"))
            else []
        )
        return silent + [found for key, item in each.items() for found in parts(item, f"{path}/{key}")]

    assert parts(game_schema()) == [""]  # the file itself is a table by being TOML


def taplo() -> str | None:
    return shutil.which("taplo", path=str(Path(sys.executable).parent)) or shutil.which("taplo")


@pytest.mark.skipif(
    taplo() is None, reason="taplo, the editors' TOML toolkit, has no package for this platform"
)
def test_editors_read_it(tmp_path: Path) -> None:
    """taplo is what Even Better TOML and other editors run."""
    program = taplo()
    assert program is not None
    (tmp_path / "game.schema.json").write_bytes(schema_path().read_bytes())
    good, bad = tmp_path / "good.toml", tmp_path / "bad.toml"
    text = new_game(Recipe(3, 2, schema="./game.schema.json"))
    good.write_text(text)
    bad.write_text(re.sub(r"^k1 = .*$", 'k1 = "ten"', text, flags=re.MULTILINE))

    def lint(path: Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [program, "lint", str(path)], capture_output=True, text=True, cwd=tmp_path, check=False
        )

    assert lint(good).returncode == 0, lint(good).stderr
    refused = lint(bad)
    assert refused.returncode != 0
    assert "k1" in refused.stderr


def test_command(tmp_path: Path) -> None:
    printed = CliRunner().invoke(app, ["schema"])
    assert printed.exit_code == 0
    assert json.loads(printed.stdout) == game_schema()
    output = tmp_path / "game.schema.json"
    written = CliRunner().invoke(app, ["schema", "--output", str(output)])
    assert (written.exit_code, written.stdout) == (0, f"{output}\n")
    assert output.read_bytes() == schema_path().read_bytes()
    (tmp_path / "file").write_text("")
    failed = CliRunner().invoke(app, ["schema", "--output", str(tmp_path / "file" / "schema.json")])
    assert failed.exit_code == 1
    assert failed.stderr.startswith("mog: cannot write")
    assert "mog schema" in CliRunner(env={"COLUMNS": "200"}).invoke(app, ["schema", "--help"]).stdout
