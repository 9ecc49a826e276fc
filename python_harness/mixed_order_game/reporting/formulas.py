"""The game in mathematics: costs, unknown dynamics and disturbances of its players, as LaTeX.

f_i = q_i |x_i|^2 + l_i . x_i + const_i + sum_j c_ij |x_i - x_j|^2, g_i(x)_l = sum_j (G_ij,l x_jl +
H_ij,l x_jl^2), d_il(t) = bias + amplitude sin(frequency t + phase), each with its expression added.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from ..fmu.model import Model
from .expression_latex import latex_of

Table = Mapping[str, Any]

LOOP = (
    ("plant, order 1", r"\dot x_i = u_i + g_i(x) + d_i(t)"),
    ("plant, order 2", r"\dot x_i = v_i,\quad \dot v_i = u_i + g_i(x) + d_i(t)"),
    ("reference, order 1", r"\dot z_i = -k_2 \nabla_i f_i(y_i)"),
    ("shared with neighbours", r"\bar x_i = z_i\ \text{(order 1)},\quad \bar x_i = x_i\ \text{(order 2)}"),
    (
        "estimates",
        r"\dot y_{ij} = -k_3 \Bigl(\sum_k a_{ik} (y_{ij} - y_{kj}) + a_{ij} (y_{ij} - \bar x_j)\Bigr)",
    ),
    (
        "seeking error",
        r"e_i = x_i - z_i\ \text{(order 1)},\quad e_i = v_i + k_2 \nabla_i f_i(y_i)\ \text{(order 2)}",
    ),
    ("control, order 1", r"u_i = -k_1 e_i - W_i^{\top} S_i(y_i) - \varphi_i"),
    ("control, order 2", r"u_i = -k_4 e_i - W_i^{\top} S_i(y_i) - \varphi_i"),
    ("robust term", r"\varphi_i = \delta \tanh(K \delta e_i / \varepsilon),\quad K = e^{-(K+1)}"),
    ("adaptation", r"\dot w = \beta S_i(y_i)\, e_{il},\quad \text{projected onto}\ w^{\top} w \le W_{\max}"),
)
"""What every game has in common: the loop of the paper, line by line."""


VELOCITY = re.compile(r"\bv\s*\[")
"""A velocity in an expression."""

BOUNDED = r"u_{il}\ \text{within}\ [-u_{\max,il},\ u_{\max,il}]"


@dataclass(frozen=True)
class Formula:
    """One line: of whom, and LaTeX."""

    whose: str
    latex: str


def loop(model: Model | None) -> list[tuple[str, str]]:
    """The lines of the loop, and whose controls are bounded."""
    if model is None:
        return list(LOOP)
    lines = [(name, line.replace("g_i(x)", f"g_i({_actions_and_velocities(model)})")) for name, line in LOOP]
    bounded = [i for i in range(model.players) if "u_max" in _player(model, i)]
    if bounded:
        lines.append((f"bounded control, {_whose(bounded, model.players)}", BOUNDED))
    return lines


def costs(model: Model) -> list[Formula]:
    """What every player minimizes."""

    def row(i: int, me: str) -> str:
        return _cost(_player(model, i).get("cost", {}), me, model.dimension)

    return _written(model, lambda me: f"f_{{{me}}}(x)", row)


def dynamics(model: Model) -> list[Formula]:
    """Unknown dynamics of the players that have some."""
    return _by_coordinate(model, "g", _actions_and_velocities(model), _dynamics)


def disturbances(model: Model) -> list[Formula]:
    """Disturbances of the players that have some."""
    return _by_coordinate(model, "d", "t", _disturbance)


def _actions_and_velocities(model: Model) -> str:
    """What the unknown dynamics of a game depend on."""
    texts = [
        _text_of(_player(model, i).get("dynamics", {}), k) or ""
        for i in range(model.players)
        for k in range(model.dimension)
    ]
    return "x, v" if any(VELOCITY.search(text) for text in texts) else "x"


def _player(model: Model, i: int) -> Table:
    player: Table = model.game["player"][i]
    return player


def _written(model: Model, left: Callable[[str], str], row: Callable[[int, str], str]) -> list[Formula]:
    """A line for players whose formulas are alike once i stands for their numbers.

    left(name of the number), row(0-based number, name of it).
    """
    alike: dict[str, list[int]] = {}
    for i in range(model.players):
        alike.setdefault(row(i, "i"), []).append(i)
    lines = []
    for general, players in alike.items():
        if not general:
            continue
        if len(players) == 1:
            number = str(players[0] + 1)
            lines.append(Formula(number, f"{left(number)} = {row(players[0], number)}"))
        else:
            lines.append(Formula(_named(players, model.players), f"{left('i')} = {general}"))
    return lines


def _whose(players: Sequence[int], count: int) -> str:
    named = _named(players, count)
    return named if len(players) == count else f"player{'s' * (len(players) > 1)} {named}"


def _named(players: Sequence[int], count: int) -> str:
    """0-based players as 1 to 3, 5, 6; all players."""
    if len(players) == count:
        return "all players"
    runs: list[list[int]] = []
    for i in players:
        if runs and i == runs[-1][-1] + 1:
            runs[-1].append(i)
        else:
            runs.append([i])
    return ", ".join(
        f"{run[0] + 1} to {run[-1] + 1}" if len(run) > 2 else ", ".join(str(i + 1) for i in run)  # noqa: PLR2004
        for run in runs
    )


def _by_coordinate(
    model: Model, letter: str, of: str, right: Callable[[Table, int, str, str, int], str]
) -> list[Formula]:
    """Lines for all coordinates at once where they are alike, else for each of them.

    right(player, its 0-based number, name of that, name of the coordinate, 0-based coordinate).
    """
    D = model.dimension

    def row(k: int, coordinate: str, i: int, me: str) -> str:
        return right(_player(model, i), i, me, coordinate, k)

    def left(coordinate: str, me: str) -> str:
        return f"{letter}_{{{me}{coordinate and f',{coordinate}'}}}({of})"

    if D == 1:
        return _written(model, partial(left, ""), partial(row, 0, ""))
    alike = [len({row(k, "l", i, "i") for k in range(D)}) == 1 for i in range(model.players)]
    lines = _written(model, partial(left, "l"), lambda i, me: row(0, "l", i, me) if alike[i] else "")
    for k in range(D):
        one = partial(row, k, str(k + 1))

        def apart(i: int, me: str, one: Callable[[int, str], str] = one) -> str:
            return "" if alike[i] else one(i, me)

        lines += _written(model, partial(left, str(k + 1)), apart)
    return sorted(
        lines, key=lambda line: int(line.whose.split()[0].strip(",")) if line.whose[0].isdigit() else 0
    )


def _cost(cost: Table, me: str, dimension: int) -> str:
    own = [
        (float(cost.get("quadratic", 0.0)), _square(f"x_{{{me}}}", dimension)),
        *(
            (value, f"x_{{{me}{_comma(str(k), dimension)}}}")
            for k, value in enumerate(_entries(cost.get("linear", 0.0), dimension), start=1)
        ),
        (float(cost.get("constant", 0.0)), ""),
    ]
    coupling = [
        (float(weight), _square(f"x_{{{me}}} - x_{{{j}}}", dimension))
        for j, weight in cost.get("coupling", [])
    ]
    return _joined([*own, *coupling], cost.get("expression"), {"i": me})


def _dynamics(player: Table, i: int, me: str, coordinate: str, k: int) -> str:
    part = player.get("dynamics", {})
    comma = coordinate and f",{coordinate}"
    terms = [
        (_entries(entries, k + 1)[k], f"x_{{{me if j == i + 1 else j}{comma}}}{power}")
        for key, power in (("linear", ""), ("square", "^2"))
        for j, entries in part.get(key, [])
    ]
    return _joined(terms, _text_of(part, k), {"i": me, "l": coordinate or "l"})


def _disturbance(player: Table, _i: int, me: str, coordinate: str, k: int) -> str:
    part = player.get("disturbance", {})
    amplitude, frequency, phase, bias = (
        _entries(part.get(key, 0.0), k + 1)[k] for key in ("amplitude", "frequency", "phase", "bias")
    )
    angle = _joined([(frequency, "t"), (phase, "")], None, {})
    terms = [(bias, ""), (amplitude if angle else 0.0, rf"\sin\left({angle}\right)")]
    return _joined(terms, _text_of(part, k), {"i": me, "l": coordinate or "l"})


def _square(of: str, dimension: int) -> str:
    """|of|^2; of a number its square."""
    if dimension > 1:
        return rf"\lVert {of} \rVert^2"
    return f"({of})^2" if " " in of else f"{of}^2"


def _entries(value: Any, dimension: int) -> list[float]:
    """D numbers; one number stands for D equal ones."""
    return [float(each) for each in value] if isinstance(value, list) else [float(value)] * dimension


def _text_of(part: Table, k: int) -> str | None:
    text: str | list[str] | None = part.get("expression")
    return text[k] if isinstance(text, list) else text


def _comma(coordinate: str, dimension: int) -> str:
    return f",{coordinate}" if dimension > 1 else ""


def _joined(terms: Sequence[tuple[float, str]], expression: str | None, values: Mapping[str, str]) -> str:
    """A sum of coefficients times factors but those of 0, and of an expression; empty if nothing is left."""
    text = ""
    for value, factor in terms:
        if value == 0.0:
            continue
        size = "" if factor and abs(value) == 1.0 else f"{abs(value):.6g}"
        sign = ("- " if text else "-") if value < 0.0 else ("+ " if text else "")
        text += f"{' ' if text else ''}{sign}{size}{' ' if size and factor else ''}{factor}"
    if expression is None:
        return text
    added = latex_of(expression, values)
    return added if not text else f"{text} {'' if added.startswith('-') else '+ '}{added}"
