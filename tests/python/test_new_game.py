"""`mog new`: files that are valid at once, whose gains suit their graph; equal recipes give equal files."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from mixed_order_game import GameError, build_fmu, read_model, run
from mixed_order_game.cli.app import app
from mixed_order_game.game.check import check_game
from mixed_order_game.game.graphs import GraphError
from mixed_order_game.game.new import Recipe, new_game
from mixed_order_game.game.parameters import game_parameters
from mixed_order_game.theory.spectrum import linear_loop, monotonicity_constant, spectral_abscissa

GRAPHS = ["ring", "path", "star", "wheel", "complete", "tree", "random:0.5", "regular:2", "small-world:2:0.3"]


def mog(*arguments: object) -> Result:
    return CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, [str(each) for each in arguments])


@pytest.mark.parametrize("graph", [*GRAPHS, "1-2,2-3:0.5,3-4,4-5,5-6,6-7"])
@pytest.mark.parametrize("orders", ["mixed", "first", "second"])
def test_valid_and_stable_for_every_graph_and_order(graph: str, orders: str, tmp_path: Path) -> None:
    path = tmp_path / "game.toml"
    path.write_text(new_game(Recipe(7, 2, orders, graph, seed=3)))
    assert check_game(path) == ()
    model = read_model(build_fmu(path, tmp_path / "game.fmu"))
    game = game_parameters(model)
    assert spectral_abscissa(linear_loop(game)) <= -0.5 * game.k2 * monotonicity_constant(game)
    assert {"mixed": {1, 2}, "first": {1}, "second": {2}}[orders] == set(model.order)


@pytest.mark.parametrize(("players", "dimension"), [(2, 1), (3, 4), (4, 1), (40, 2)])
def test_sizes(players: int, dimension: int, tmp_path: Path) -> None:
    path = tmp_path / "game.toml"
    path.write_text(new_game(Recipe(players, dimension, graph="path", seed=11)))
    assert check_game(path) == ()
    model = read_model(build_fmu(path, tmp_path / "game.fmu"))
    assert (model.players, model.dimension) == (players, dimension)
    result = run(model.path, stop_time=10.0, outputs=["x"])
    assert result.largest_error(8.0) < 0.02


@pytest.mark.parametrize("seed", range(6))
def test_any_seed_converges(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "game.toml"
    path.write_text(new_game(Recipe(5, 2, graph="random:0.5", seed=seed)))
    result = run(build_fmu(path, tmp_path / "game.fmu"), stop_time=12.0, outputs=["x"])
    assert result.largest_error(10.0) < 0.02


def test_equal_recipes_give_equal_texts_and_seeds_differ() -> None:
    recipe = Recipe(6, 2, graph="tree", seed=5)
    assert new_game(recipe) == new_game(recipe)
    assert new_game(recipe) != new_game(Recipe(6, 2, graph="tree", seed=6))


def test_every_key_is_explained() -> None:
    text = new_game(Recipe(3, 1))
    for word in ("k1", "k2", "k3", "k4", "beta", "delta", "epsilon", "W_max"):
        line = next(line for line in text.splitlines() if line.startswith(f"{word} ="))
        assert "  # " in line
    for key in ("order", "x0", "cost", "dynamics", "disturbance", "edges", "centers"):
        lines = text.splitlines()
        position = next(k for k, line in enumerate(lines) if line.startswith(f"{key} ="))
        assert lines[position - 1].startswith("# ")
    assert max(map(len, text.splitlines())) <= 150


def test_costs_pull_to_targets_and_neighbours() -> None:
    game = tomllib.loads(new_game(Recipe(4, 2, graph="star", seed=8)))
    for i, player in enumerate(game["player"], start=1):
        neighbours = {j for edge in game["graph"]["edges"] for j in edge[:2] if i in edge[:2]} - {i}
        assert {j for j, _ in player["cost"]["coupling"]} == neighbours
        target = -0.5 * np.array(player["cost"]["linear"]) / player["cost"]["quadratic"]
        assert player["cost"]["constant"] == pytest.approx(
            player["cost"]["quadratic"] * target @ target, abs=1e-3
        )


def test_title_and_schema(tmp_path: Path) -> None:
    text = new_game(Recipe(2, 1, title='A "quoted" title \\ Überlänge', schema="./game.schema.json"))
    assert text.startswith("#:schema ./game.schema.json\n")
    assert tomllib.loads(text)["title"] == 'A "quoted" title \\ Überlänge'
    path = tmp_path / "game.toml"
    path.write_text(text, encoding="utf-8")
    assert check_game(path) == ()


@pytest.mark.parametrize(
    ("recipe", "told"),
    [
        (Recipe(1), "the number of players is 1, expected 2 to 1000"),
        (Recipe(1001), "the number of players is 1001"),
        (Recipe(3, 0), "the dimension is 0"),
        (Recipe(3, orders="1,2"), "orders is '1,2'"),
        (Recipe(3, orders="1,2,3"), "orders is '1,2,3'"),
        (Recipe(3, orders="fast"), "orders is 'fast'"),
        (Recipe(3, seed=-1), "the seed is -1"),
        (Recipe(3, title="two\nlines"), "control characters"),
        (Recipe(4, graph="1-2,3-4"), "does not connect all 4 players"),
        (Recipe(4, graph="all"), "means 38 graphs"),
    ],
)
def test_recipes_that_make_no_sense(recipe: Recipe, told: str) -> None:
    with pytest.raises(GameError, match=told):
        new_game(recipe)


def test_graphs_that_make_no_sense() -> None:
    for graph in ("nonsense", "regular:3", "random:0.0", "1-9"):
        with pytest.raises(GraphError):
            new_game(Recipe(5, graph=graph))


def test_command(tmp_path: Path) -> None:
    path = tmp_path / "game.toml"
    done = mog("new", path, "-n", 4, "-d", 1, "--orders", "1,2,2,1", "--graph", "path", "--seed", 2)
    assert (done.exit_code, done.stdout) == (0, f"{path}\n")
    assert path.read_text() == new_game(Recipe(4, 1, "1,2,2,1", "path", 2))
    again = mog("new", path)
    assert again.exit_code == 1
    assert again.stderr.startswith(f"mog: {path} exists: name another file or add --force")
    assert mog("new", path, "--force").exit_code == 0
    wrong = mog("new", tmp_path / "game.txt")
    assert wrong.exit_code == 2
    assert "must end in .toml" in wrong.stderr
    assert mog("new", tmp_path / "b.toml", "--players", "many").exit_code == 2
    nonsense = mog("new", tmp_path / "b.toml", "--graph", "nonsense")
    assert nonsense.exit_code == 1
    assert nonsense.stderr.count("\n") == 1
    assert not (tmp_path / "b.toml").exists()
    assert "mog new" in mog("new", "--help").stdout.split("Example")[1]
