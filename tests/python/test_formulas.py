"""Games in mathematics: brackets where they are needed, a player's number where formulas differ."""

import re
from pathlib import Path

import pytest
from latex2mathml.converter import convert

from mixed_order_game import Game, Recipe, new_game, read_model
from mixed_order_game.reporting.expression_latex import latex_of
from mixed_order_game.reporting.formulas import LOOP, costs, disturbances, dynamics, loop

GAMES = Path(__file__).resolve().parents[2] / "modelDescription" / "games"


@pytest.mark.parametrize(
    ("text", "latex"),
    [
        ("a + b * c", r"a + b\,c"),
        ("(a + b) * c", r"\left(a + b\right)\,c"),
        ("a - (b - c)", r"a - \left(b - c\right)"),
        ("-x[i]^2", r"-x_{i}^{2}"),
        ("(-x[i])^2", r"\left(-x_{i}\right)^{2}"),
        ("2^-1", "2^{-1}"),
        ("a^b^c", "a^{b^{c}}"),
        ("a / b / c", r"\frac{\frac{a}{b}}{c}"),
        ("-0.3 * v[2] * 2", r"-0.3\,v_{2} \cdot 2"),
        ("a * -b", r"a\,\left(-b\right)"),
        ("price * lambda", r"\mathrm{price}\,\lambda"),
        ("peak_load", r"\mathrm{peak\_load}"),
        ("1e-7 * t", r"1 \cdot 10^{-7}\,t"),
        ("sum(x[j] for j in 1..N-1 if j != i)", r"\sum_{j=1,\ j \ne i}^{N - 1} x_{j}"),
        ("2 * sum(x[j] + 1 for j in 1..N)", r"2\,\left(\sum_{j=1}^{N} \left(x_{j} + 1\right)\right)"),
        ("a - prod(x[k] for k in 1..2)", r"a - \prod_{k=1}^{2} x_{k}"),
        ("if(x[1] > 3, 1, 0) + 1", r"\begin{cases}1 & x_{1} > 3 \\ 0 & \text{otherwise}\end{cases} + 1"),
        ("if(not (a < b and c < d), 1, 2)",
         r"\begin{cases}1 & \lnot \left(a < b \land c < d\right) \\ 2 & \text{otherwise}\end{cases}"),
        ("sqrt(a) + abs(b) + atan(c)", r"\sqrt{a} + \left|b\right| + \arctan\left(c\right)"),
        ("x[mod(i, N) + 1,l]", r"x_{i \bmod N + 1,l}"),
    ],
)  # fmt: skip
def test_expressions(text: str, latex: str) -> None:
    assert latex_of(text) == latex
    assert convert(latex).startswith("<math")


def test_a_bound_name_hides_the_player() -> None:
    assert latex_of("x[i] + sum(x[i] for i in 1..i)", {"i": "2"}) == r"x_{2} + \sum_{i=1}^{2} x_{i}"


@pytest.mark.parametrize("text", ["a +", "a $ b", "[a]", "x.y", "a = b"])
def test_what_is_no_expression_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expression"):
        latex_of(text)


@pytest.mark.parametrize("game", sorted(path.stem for path in GAMES.glob("*.toml")))
def test_every_player_of_every_game_has_a_cost_and_all_is_typeset(game: str) -> None:
    model = read_model(game)
    named = [line.whose for line in costs(model)]
    assert named == ["all players"] or named == [str(i) for i in range(1, model.players + 1)]
    for line in [*costs(model), *dynamics(model), *disturbances(model)]:
        assert "merror" not in convert(line.latex)


def test_the_paper_s_example() -> None:
    model = read_model("five_vehicles")
    assert costs(model)[1].latex == (
        r"f_{2}(x) = 2 \lVert x_{2} \rVert^2 + 2 x_{2,1} + 2 x_{2,2} + 2 + \lVert x_{2} - x_{3} \rVert^2"
    )
    lines = [(line.whose, line.latex) for line in dynamics(model)]
    assert lines[:4] == [
        ("1", "g_{1,l}(x) = x_{2,l}"),
        ("2", "g_{2,1}(x) = x_{3,1} + x_{2,1}^2"),
        ("2", "g_{2,2}(x) = x_{2,2}"),
        ("3", "g_{3,l}(x) = 3 x_{3,l}"),
    ]
    assert [line.latex for line in disturbances(model)][4] == r"d_{5,l}(t) = 5 \sin\left(5 t\right)"


def test_players_whose_formulas_are_alike_share_a_line() -> None:
    game = Game("five_vehicles")
    for number in (1, 2, 3, 5):
        game.player(number)["cost"] = {"quadratic": 1.0, "expression": "sum(x[i,k]^4 for k in 1..D)"}
    game.player(4)["cost"] = {"quadratic": 1.0, "expression": "2 * x[i,1]^2"}
    lines = [(line.whose, line.latex) for line in costs(game.model())]
    assert lines == [
        ("1 to 3, 5", r"f_{i}(x) = \lVert x_{i} \rVert^2 + \sum_{k=1}^{D} x_{i,k}^{4}"),
        ("4", r"f_{4}(x) = \lVert x_{4} \rVert^2 + 2\,x_{4,1}^{2}"),
    ]
    for number in (1, 2, 4):
        game.player(number)["dynamics"] = {"expression": "sin(x[i,l])"}
    assert [line.whose for line in dynamics(game.model())] == ["1, 2, 4", "3", "5"]


def test_dynamics_name_the_velocities_that_they_depend_on() -> None:
    model = read_model("underwater_vehicles")
    assert dynamics(model)[-1].latex.startswith(r"g_{4,l}(x, v) = ")
    assert loop(model)[0][1] == r"\dot x_i = u_i + g_i(x, v) + d_i(t)"
    assert loop(read_model("five_vehicles")) == list(LOOP)


def test_numbers_of_two_digits_are_one_index(tmp_path: Path) -> None:
    game = tmp_path / "twelve.toml"
    game.write_text(new_game(Recipe(players=12)), encoding="utf-8")
    model = read_model(game)
    assert costs(model)[11].latex.startswith("f_{12}(x) = ")
    for line in [*costs(model), *dynamics(model), *disturbances(model)]:
        assert not re.search(r"_\d\d", line.latex)


def test_the_loop_is_typeset() -> None:
    assert all("merror" not in convert(latex) for _, latex in LOOP)
