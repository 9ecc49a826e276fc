"""Random games with expressions: each piece is made as a text and as a NumPy function at once.

Pieces never pass through a parser: Python functions join texts on one side and functions on the other. Costs
are strongly convex in the own action, with what is drawn as a small part beside, so that there is one
equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import erf

from tests.oracle.general_loop import Functions
from tests.oracle.paper_equations import Numbers


@dataclass(frozen=True)
class Around:
    """What a piece is evaluated in.

    Values have one entry for each player on their last axis, in dynamics and disturbances after an axis of
    coordinates.
    """

    x: Numbers  # (..., N, N, D), what each player sees; in dynamics the true actions for all
    v: Numbers  # (N, D)
    t: float
    order: Numbers  # (N,)
    values: Mapping[str, Any]  # of the named parameters
    index: Mapping[str, Any]  # from 1 on; i: (N,), l: (D, 1), bound names: integers

    @property
    def N(self) -> int:
        return self.x.shape[-2]

    @property
    def D(self) -> int:
        return self.x.shape[-1]

    def bound(self, name: str, value: int) -> Around:
        return Around(self.x, self.v, self.t, self.order, self.values, {**self.index, name: value})


@dataclass(frozen=True)
class Piece:
    text: str
    of: Callable[[Around], Any]


Index = Piece  # an integer, or (N,) of them, from 1 on
I, L = Index("i", lambda a: a.index["i"]), Index("l", lambda a: a.index["l"])  # noqa: E741 - the language's names
NEXT = Index("mod(i, N) + 1", lambda a: a.index["i"] % a.N + 1)
SECOND = Index("min(i + 1, N)", lambda a: np.minimum(a.index["i"] + 1, a.N))
FIRST = Index("max(i - 1, 1)", lambda a: np.maximum(a.index["i"] - 1, 1))


def bound(name: str) -> Index:
    return Index(name, lambda a: a.index[name])


def number(value: float) -> Piece:
    return Piece(repr(value), lambda _: value)


def action(j: Index, coordinate: Index) -> Piece:
    def of(a: Around) -> Any:
        players = np.arange(a.N)
        return a.x[..., players, j.of(a) - 1, coordinate.of(a) - 1]

    return Piece(f"x[{j.text},{coordinate.text}]", of)


def velocity(j: Index, coordinate: Index) -> Piece:
    return Piece(
        f"v[{j.text},{coordinate.text}]",
        lambda a: a.v[j.of(a) - 1, coordinate.of(a) - 1],
    )


TIME = Piece("t", lambda a: a.t)


def parameter(name: str, *indices: Index) -> Piece:
    def of(a: Around) -> Any:
        return a.values[name][tuple(each.of(a) - 1 for each in indices)] if indices else a.values[name]

    return Piece(name + (f"[{','.join(each.text for each in indices)}]" if indices else ""), of)


def join(form: str, function: Callable[..., Any], *pieces: Piece) -> Piece:
    """A text with the pieces in brackets at {0}, {1}, and the function of their values."""
    text = form.format(*(f"({piece.text})" for piece in pieces))
    return Piece(text, lambda a: function(*(piece.of(a) for piece in pieces)))


def total(body: Piece, name: str, last: str, product: bool = False, only: str = "") -> Piece:
    """sum or prod over a bound name from 1 to N or D, of players other than i or of order 2 alone."""

    def of(a: Around) -> Any:
        result: Any = 1.0 if product else 0.0
        for value in range(1, (a.N if last == "N" else a.D) + 1):
            if only == "order" and a.order[value - 1] != 2:
                continue
            term = body.of(a.bound(name, value))
            if only == "others":
                term = np.where(a.index["i"] == value, 1.0 if product else 0.0, term)
            result = result * term if product else result + term
        return result

    condition = {"": "", "others": f" if {name} != i", "order": f" if order[{name}] == 2"}[only]
    return Piece(f"{'prod' if product else 'sum'}({body.text} for {name} in 1..{last}{condition})", of)


def _atan2(y: Numbers, x: Numbers) -> Numbers:
    y, x = np.asarray(y, dtype=complex), np.asarray(x, dtype=complex)
    slope = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return np.asarray(np.arctan2(y.real, x.real) + 1j * slope)


def _hypot(a: Numbers, b: Numbers) -> Numbers:
    return np.asarray(np.sqrt(a * a + b * b))


# Functions of one argument u and another one w, of any size, with values and slopes of about 1
SMOOTH: dict[str, tuple[str, Callable[[Any, Any], Any]]] = {
    "sqrt": ("sqrt(1.0 + {0}^2)", lambda u, _: np.sqrt(1.0 + u**2)),
    "exp": ("exp(0.5 * sin{0})", lambda u, _: np.exp(0.5 * np.sin(u))),
    "expm1": ("expm1(-0.1 * {0}^2)", lambda u, _: np.exp(-0.1 * u**2) - 1.0),
    "log": ("log(2.0 + {0}^2)", lambda u, _: np.log(2.0 + u**2)),
    "log1p": ("log1p({0}^2)", lambda u, _: np.log(1.0 + u**2)),
    "sin": ("sin{0}", lambda u, _: np.sin(u)),
    "cos": ("cos{0}", lambda u, _: np.cos(u)),
    "tan": ("tan(0.5 * tanh{0})", lambda u, _: np.tan(0.5 * np.tanh(u))),
    "asin": ("asin(0.6 * tanh{0})", lambda u, _: np.arcsin(0.6 * np.tanh(u))),
    "acos": ("acos(0.6 * sin{0})", lambda u, _: np.arccos(0.6 * np.sin(u))),
    "atan": ("atan{0}", lambda u, _: np.arctan(u)),
    "atan2": ("atan2({0}, 2.0 + {1}^2)", lambda u, w: _atan2(u, 2.0 + w**2)),
    "sinh": ("sinh(0.5 * cos{0})", lambda u, _: np.sinh(0.5 * np.cos(u))),
    "cosh": ("cosh(sin{0})", lambda u, _: np.cosh(np.sin(u))),
    "tanh": ("tanh{0}", lambda u, _: np.tanh(u)),
    "erf": ("erf{0}", lambda u, _: erf(u)),
    "hypot": ("hypot({0}, 1.0 + {1}^2)", lambda u, w: _hypot(u, 1.0 + w**2)),
    "power": ("(1.0 + {0}^2)^0.7", lambda u, _: (1.0 + u**2) ** 0.7),
    "power of powers": ("(2.0 + sin{0})^2^-1", lambda u, _: (2.0 + np.sin(u)) ** 0.5),
    "any power": ("(2.0 + sin{0})^tanh{1}", lambda u, w: (2.0 + np.sin(u)) ** np.tanh(w)),
    "quotient": ("-{0} / (2.0 + {1}^2) - 1.0", lambda u, w: -u / (2.0 + w**2) - 1.0),
    "cube": ("0.02 * {0}^3", lambda u, _: 0.02 * u**3),
}


@dataclass(frozen=True)
class RandomGame:
    text: str
    functions: Functions
    used: frozenset[str]  # names in SMOOTH


class _Draw:
    """Random choices for one game."""

    def __init__(self, seed: int, players: int, dimension: int) -> None:
        self.random = np.random.default_rng([seed, 77])
        self.N, self.D = players, dimension
        names = list(SMOOTH)
        self.next = seed * 7  # each function comes in its turn
        self.names = names
        self.used: set[str] = set()
        self.values: dict[str, Any] = {
            "gain": round(float(self.random.uniform(0.5, 1.5)), 3),
            "h": np.round(self.random.uniform(-1.5, 1.5, (players, dimension)), 3),
            "w": np.round(self.random.uniform(1.5, 2.5, players), 3),
            "R": np.round(
                self.random.uniform(-1, 1, (players, players))
                * (self.random.random((players, players)) < 0.6),
                3,
            ),
        }

    def coefficient(self, low: float, high: float) -> Piece:
        return number(round(float(self.random.uniform(low, high)), 3))

    def linear(self, leaves: list[Piece]) -> Piece:
        """A sum of some of the leaves."""
        chosen = self.random.choice(len(leaves), min(2, len(leaves)), replace=False)
        parts = [leaves[k] for k in chosen] * (2 if len(chosen) == 1 else 1)
        a, b = self.coefficient(0.3, 1.0), self.coefficient(-1.0, -0.3)
        return join("{0} * {1} + {2} * {3}", lambda p, x, q, y: p * x + q * y, a, parts[0], b, parts[1])

    def smooth(self, leaves: list[Piece], depth: int) -> Piece:
        """The next function, of what is drawn."""
        name = self.names[self.next % len(self.names)]
        self.next += 1
        self.used.add(name)
        arguments = [
            self.smooth(leaves, depth - 1) if depth > 0 else self.linear(leaves),
            self.linear(leaves),
        ]
        return join(*SMOOTH[name], *arguments)

    def cost(self) -> Piece:
        k = bound("k")
        distance = join(
            "{0}^2", lambda u: u**2, join("{0} - {1}", np.subtract, action(I, k), parameter("h", I, k))
        )
        own = join("{0} * {1}", np.multiply, parameter("w", I), total(distance, "k", "D"))
        j, first = bound("j"), Index("1", lambda _: 1)
        leaves = [action(I, first), action(NEXT, Index("D", lambda a: a.D)), action(FIRST, first)]
        body = join(
            "{0} * {1}", np.multiply, action(I, first), self.smooth([action(j, first), action(I, first)], 0)
        )
        crowd = join("0.1 * {0} / N", lambda u: 0.1 * u / self.N, total(body, "j", "N", only="others"))
        small = join("0.15 * {0} * {1}", lambda p, u: 0.15 * p * u, parameter("gain"), self.smooth(leaves, 1))
        return join("{0} + {1} + {2}", lambda a, b, c: a + b + c, own, crowd, small)

    def dynamics(self, has_velocity: bool) -> Piece:
        j = bound("j")
        leaves = [
            action(I, L),
            action(NEXT, L),
            action(SECOND, Index("max(l - 1, 1)", lambda a: np.maximum(a.index["l"] - 1, 1))),
        ]
        if has_velocity:
            leaves.append(velocity(I, L))
        weighted = join("{0} * {1}", np.multiply, parameter("R", I, j), self.smooth([action(j, L)], 0))
        parts = [
            join("0.5 * {0}", lambda u: 0.5 * u, self.smooth(leaves, 1)),
            join("0.4 * {0} / N", lambda u: 0.4 * u / self.N, total(weighted, "j", "N")),
            join(
                "0.05 * {0}",
                lambda u: 0.05 * u,
                total(join("cos{0}", np.cos, action(j, L)), "j", "N", product=True),
            ),
        ]
        if has_velocity:
            squares = join("tanh{0}", np.tanh, velocity(j, L))
            parts.append(join("0.2 * {0}", lambda u: 0.2 * u, total(squares, "j", "N", only="order")))
        chosen = Piece(
            f"if(i > 1, 0.3 * x[i - 1,l], {parts[0].text})",
            lambda a: np.where(
                a.index["i"] > 1,
                0.3 * a.x[..., np.arange(a.N), np.maximum(a.index["i"] - 1, 1) - 1, a.index["l"] - 1],
                parts[0].of(a),
            ),
        )
        return join(
            " + ".join(f"{{{k}}}" for k in range(len(parts) + 1)), lambda *all_: sum(all_), chosen, *parts
        )

    def disturbance(self) -> Piece:
        speed = self.coefficient(0.5, 3.0)
        phase = Piece(
            f"{speed.text} * t + 0.5 * i + l", lambda a: speed.of(a) * a.t + 0.5 * a.index["i"] + a.index["l"]
        )
        return join(
            "{0} + 0.5 * {1}", lambda p, q: p + 0.5 * q, self.smooth([phase], 0), self.smooth([phase], 1)
        )


def random_game(seed: int, players: int, dimension: int) -> RandomGame:
    """Deterministic in its arguments. Orders alternate or are all equal, by the seed."""
    draw = _Draw(seed, players, dimension)
    random = draw.random
    order = np.array([1 + (k + seed) % 2 if seed % 5 else 1 + seed // 5 % 2 for k in range(players)])
    cost = draw.cost()
    by_order = {each: draw.dynamics(each == 2) for each in (1, 2)}
    disturbance = draw.disturbance()
    x0 = np.round(random.uniform(-1.0, 1.0, (players, dimension)), 3)
    q = 3 + seed % 3
    lines = [
        f'title = "Random game {seed}"',
        f"dimension = {dimension}",
        "[gains]",
        "k1 = 6.0",
        "k2 = 0.8",
        "k3 = 8.0",
        "k4 = 7.0",
        "beta = 3.0",
        "delta = 1.2",
        "epsilon = 0.1",
        "[rbf]",
        f"centers = {np.round(np.linspace(-1.0, 1.0, q), 3).tolist()}",
        f"width = {round(1.5 * (players * dimension) ** 0.5, 3)}",
        "W_max = 500.0",
        "[graph]",
        f"edges = {[[k, k % players + 1, 1.0 + 0.25 * (k % 3)] for k in range(1, players + (players > 2))]}",
        "[parameters]",
        f"gain = {draw.values['gain']}",
        f"h = {draw.values['h'].tolist()}",
        f"w = {draw.values['w'].tolist()}",
        f"R = {{ value = {draw.values['R'].tolist()}, fixed = true }}",
        "[defaults]",
        'z0 = "x0"',
        'y0 = "x0"',
        f'cost = {{ expression = "{cost.text}" }}',
        f'disturbance = {{ expression = "{disturbance.text}" }}',
    ]
    for k in range(players):
        lines += [
            "[[player]]",
            f'name = "player {k + 1}"',
            f"order = {order[k]}",
            f"x0 = {x0[k].tolist()}",
            f'dynamics = {{ expression = "{by_order[int(order[k])].text}" }}',
        ]

    def around(x: Numbers, v: Numbers, t: float, **index: Any) -> Around:
        return Around(x, v, t, order, draw.values, {"i": np.arange(1, players + 1), **index})

    nothing = np.zeros((players, dimension))

    def costs(x: Numbers) -> Numbers:
        return np.asarray(cost.of(around(x, nothing, 0.0)))

    def per_coordinate(piece: Piece, x: Numbers, v: Numbers, t: float) -> Numbers:
        seen = np.broadcast_to(x, (players, players, dimension))
        values = piece.of(around(seen, v, t, l=np.arange(1, dimension + 1)[:, np.newaxis]))
        return np.broadcast_to(np.real(values), (dimension, players)).T

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        first, second = (per_coordinate(by_order[each], x, v, 0.0) for each in (1, 2))
        return np.where(order[:, np.newaxis] == 1, first, second)

    def disturbances(t: float) -> Numbers:
        return per_coordinate(disturbance, nothing, nothing, t)

    return RandomGame("\n".join(lines) + "\n", Functions(costs, dynamics, disturbances), frozenset(draw.used))
