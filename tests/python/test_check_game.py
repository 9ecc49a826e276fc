"""`mog check`: every problem with its line, the host tool's own sentence among them."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from mixed_order_game import GameError, default_game
from mixed_order_game.cli.app import app
from mixed_order_game.fmu.build import build_fmu
from mixed_order_game.game.check import _place, check_game
from mixed_order_game.game.host_tool import ask
from mixed_order_game.game.new import Recipe, new_game
from mixed_order_game.theory.analysis import analyse
from mixed_order_game.theory.game import read_game
from mixed_order_game.theory.spectrum import nash_equilibrium

MANY = """\
title = "bad"
dimension = 2
colour = "red"
[gains]
k1 = -1
k2 = "x"
k3 = inf
beta = 1
delta = nan
epsilon = 0.1
[rbf]
centers = []
width = 0
W_max = 5
[graph]
edges = [[1, 2, 0], [1], [2, 7],
  [1, "a"]]
[[player]]
name = ""
order = 2
x0 = [1, 2, 3]
z0 = 1
cost = { quadratik = 1, coupling = [[2, 1.0],
   [2, "k"]] }
[[player]]
order = 1.0
[player.dynamics]
linear = 4
"""

TOLD = [
    (3, '"colour" is an unknown key of the game definition, expected one of '),
    (4, "gains.k4 is missing, expected a positive number"),
    (5, "gains.k1 is -1, expected a positive number"),
    (6, 'gains.k2 is "x", expected a positive number'),
    (7, "gains.k3 is inf, expected a positive number"),
    (9, "gains.delta is nan, expected a number that is not negative"),
    (12, "rbf.centers is [], expected a list of 1 to 10000 centers"),
    (13, "rbf.width is 0, expected a positive number"),
    (16, "graph.edges[1][3] is 0, expected a positive number"),
    (16, "graph.edges[2] is [1], expected an edge [i, j] or [i, j, weight]"),
    (16, "graph.edges[3][2] is 7, expected an integer from 1 to 2"),
    (17, 'graph.edges[4][2] is "a", expected an integer from 1 to 2'),
    (19, 'player[1].name is "", expected a name that is not empty'),
    (21, "player[1].x0 is [1, 2, 3], expected a list of 2 numbers or one number that stands for all of them"),
    (22, "player[1].z0 is 1, expected no z0 for a player of order 2, which has v0"),
    (23, '"quadratik" is an unknown key of player[1].cost, the closest known key is quadratic'),
    (24, 'player[1].cost.coupling[2][2] is "k", expected a finite number'),
    (25, "player[2].name is missing, expected text"),
    (25, "player[2].x0 is missing, expected a list of 2 numbers or one number that stands for all of them"),
    (26, "player[2].order is 1, expected an integer from 1 to 2"),
    (28, "player[2].dynamics.linear is 4, expected a list of pairs [j, coefficients]"),
]


def mog(*arguments: object) -> Result:
    return CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, [str(each) for each in arguments])


def written(folder: Path, text: str) -> Path:
    path = folder / "game.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_problem_with_its_line(tmp_path: Path) -> None:
    problems = check_game(written(tmp_path, MANY))
    for line, sentence in TOLD:
        assert [each for each in problems if each.line == line and each.sentence.startswith(sentence)], (
            sentence
        )
    assert len(problems) == len(TOLD)


def edited(old: str, new: str) -> str:
    text = default_game().read_text(encoding="utf-8")
    assert text.count(old) >= 1
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("k1 = 10.0", "k1 = 0.0", "gains.k1 is 0, expected a positive number"),
        ("[4, 5], [5, 1]]", "[4, 5], [5, 4]]", "each edge once"),
        ("[3, 4], [4, 5], [5, 1]]", "[3, 4]]", "separate groups {1, 2, 3, 4}, {5}"),
        ('name = "vehicle 2"', 'name = "vehicle 1"', 'player[2].name is "vehicle 1"'),
        ("coupling = [[2, 1.0]]", "coupling = [[1, 1.0]]", "no coupling of player 1 with itself"),
        ("coupling = [[2, 1.0]]", "coupling = [[2, 1.0], [2, 1.0]]", "player 2 comes twice"),
        ("order = 1", "order = 1\n\n\norde = 2", '"orde" is an unknown key of player[1]'),
        ("W_max = 500.0", "W_max = -500.0  # bound", "rbf.W_max is -500"),
        ("dimension = 2", "dimension = 2\nparameters.rho = 1.0", "parameters.rho has the name of a variable"),
    ],
)
def test_the_line_is_that_of_the_edit(old: str, new: str, told: str, tmp_path: Path) -> None:
    text = edited(old, new)
    problems = check_game(written(tmp_path, text))
    assert len(problems) == 1
    assert told in problems[0].sentence
    marker = new.rsplit("\n", 1)[-1]
    assert marker in text.splitlines()[problems[0].line - 1]


OF_EXPRESSIONS = """
[parameters]
slope = 0.1
# the next is no word
"two words" = 1.0
[defaults]
cost = { expression = '''
  (x[i,1] - 1)^2
    + foo''' }
"""


def test_expressions_are_told_by_their_own_lines(tmp_path: Path) -> None:
    text = default_game().read_text(encoding="utf-8") + OF_EXPRESSIONS
    (named,) = check_game(written(tmp_path, text))
    assert named.sentence.startswith("parameters.two words is 1, expected a name of letters, digits and _")
    assert text.splitlines()[named.line - 1] == '"two words" = 1.0'
    text = re.sub(r"^cost = \{ q.*$\n", "", text, flags=re.MULTILINE).replace('"two words"', "words")
    (unknown,) = check_game(written(tmp_path, text))
    assert unknown.column == 7
    assert unknown.sentence.startswith('defaults.cost.expression: "foo" is no name here')  # no place twice
    assert text.splitlines()[unknown.line - 1].strip().startswith("+ foo")


def test_says_what_building_says(tmp_path: Path) -> None:
    path = written(tmp_path, edited("k1 = 10.0", "k1 = 0.0"))
    (problem,) = check_game(path)
    with pytest.raises(GameError, match=re.escape(problem.sentence)):
        build_fmu(path, tmp_path / "game.fmu")


@pytest.mark.parametrize(
    ("content", "line", "told"),
    [
        (b'title = "a"\nfoo = = 3\n', 2, "is not TOML"),
        (b'title = "a"\n\n[gains\nk1 = 1\n', 3, "is not TOML"),
        (b"\xff\xfe", 1, "is UTF-16 text"),
        (b"", 1, "is missing"),
        (b"a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r = 1\n", 1, "more than 16 dots"),
        (b'title = "a"\ntitle = "b"\n', 2, "is not TOML"),
    ],
)
def test_files_that_are_hardly_games(content: bytes, line: int, told: str, tmp_path: Path) -> None:
    path = tmp_path / "game.toml"
    path.write_bytes(content)
    problem = next(each for each in check_game(path) if told in each.sentence)
    assert problem.line == line


def test_no_unique_equilibrium(tmp_path: Path) -> None:
    text = new_game(Recipe(2, 1))
    flat = re.sub(r"^cost = .*$", "cost = { linear = 1.0 }", text, flags=re.MULTILINE)
    (problem,) = check_game(written(tmp_path, flat))
    assert "no unique Nash equilibrium" in problem.sentence


def test_a_cost_that_is_concave_in_the_own_action(tmp_path: Path) -> None:
    text = new_game(Recipe(2, 1))
    costs = iter(
        [
            "cost = { quadratic = 0.3, coupling = [[2, 2.0]] }",
            "cost = { quadratic = 0.3, coupling = [[1, -2.0]] }",
        ]
    )
    path = written(tmp_path, re.sub(r"^cost = .*$", lambda _: next(costs), text, flags=re.MULTILINE))
    (problem,) = check_game(path)
    told = "player[2].cost is concave in the player's own action (second derivative -3.4"
    assert problem.sentence.startswith(told)
    assert path.read_text(encoding="utf-8").splitlines()[problem.line - 1].endswith("[[1, -2.0]] }")
    with pytest.raises(GameError, match=re.escape(told)):
        build_fmu(path, tmp_path / "game.fmu")
    with pytest.raises(GameError, match=re.escape(told)):
        analyse(path, simulation=False)


def test_costs_in_different_units(tmp_path: Path) -> None:
    text = new_game(Recipe(2, 1))
    units = iter([1e-7, 1e7])

    def cost(_: re.Match[str]) -> str:
        unit = next(units)
        other = 2 if unit < 1.0 else 1
        return f"cost = {{ quadratic = {unit}, linear = {unit}, coupling = [[{other}, {unit}]] }}"

    path = written(tmp_path, re.sub(r"^cost = .*$", cost, text, flags=re.MULTILINE))
    assert check_game(path) == ()
    np.testing.assert_allclose(nash_equilibrium(read_game(path).parameters), -0.5, rtol=1e-14)


def test_places(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        'title = "x"\n'  # 1
        'a."b c".d = 1\n'  # 2
        "[gains]\n"  # 3
        "k1 = 1.0\n"  # 4
        "[[player]]\n"  # 5
        'name = """two\nlines"""\n'  # 6, 7
        "cost = { quadratic = 1, coupling = [[2, 1.0], # note\n"  # 8
        "  [3,\n"  # 9
        "  2.0]] }\n"  # 10
        "[[player]]\n"  # 11
        "# only a comment\n"  # 12
        "[player.cost]\n"  # 13
        "linear.x = 4\n",  # 14
    )
    places = {
        (): (1, 1),
        ("title",): (1, 1),
        ("a", "b c", "d"): (2, 9),
        ("a", "b c"): (2, 3),
        ("gains",): (3, 2),
        ("gains", "k1"): (4, 1),
        ("gains", "k2"): (3, 2),
        ("player",): (5, 3),
        ("player", 0): (5, 1),
        ("player", 0, "name"): (6, 1),
        ("player", 0, "cost", "quadratic"): (8, 10),
        ("player", 0, "cost", "coupling", 0, 1): (8, 41),
        ("player", 0, "cost", "coupling", 1): (9, 3),
        ("player", 0, "cost", "coupling", 1, 1): (10, 3),
        ("player", 1): (11, 1),
        ("player", 1, "order"): (11, 1),
        ("player", 1, "cost"): (13, 9),
        ("player", 1, "cost", "linear", "x"): (14, 8),
        ("nothing", "at", 7, "all"): (1, 1),
    }
    found = ask("--check", path)["places"]
    assert {entry: _place(entry, found) for entry in places} == places


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_damage_is_told_on_a_line_that_exists(data: st.DataObject, tmp_path: Path) -> None:
    text = new_game(Recipe(3, 2))
    begin = data.draw(st.integers(0, len(text) - 1))
    length = data.draw(st.integers(1, 40))
    damage = data.draw(st.text(max_size=6))
    damaged = text[:begin] + damage + text[begin + length :]
    path = tmp_path / "game.toml"
    path.write_bytes(damaged.encode("utf-8", errors="surrogatepass"))
    for problem in check_game(path):
        assert 1 <= problem.line <= damaged.count("\n") + 1
        assert problem.sentence
        assert "\n" not in problem.sentence


def test_command(tmp_path: Path) -> None:
    good = mog("check", default_game())
    assert (good.exit_code, good.stdout) == (0, f"{default_game()} is valid\n")
    path = written(tmp_path, MANY)
    bad = mog("check", default_game(), path)
    assert bad.exit_code == 1
    lines = bad.stderr.splitlines()
    assert lines[1] == f"{path}:4:2: gains.k4 is missing, expected a positive number"
    assert len(lines) == len(TOLD)
    missing = mog("check", tmp_path / "none.toml")
    assert (missing.exit_code, missing.stderr) == (
        1,
        f"mog: there is no game file {tmp_path / 'none.toml'}\n",
    )
    several = mog("check", tmp_path / "none.toml", default_game(), tmp_path, "five_vehicles")
    assert several.exit_code == 1
    assert several.stdout == f"{default_game()} is valid\nfive_vehicles is valid\n"
    assert several.stderr.count("mog: ") == 2
    assert mog("check").exit_code == 2
    assert mog("check", "--nonsense").exit_code == 2
    assert "mog check" in mog("check", "--help").stdout.split("Example")[1]
