"""Writes a new game file: commented, valid at once, with gains that stabilise its unperturbed loop.

Every player has a target of its own and keeps near its neighbours on the communication graph,
f_i = q_i |x_i - s_i|^2 + sum_j c_ij |x_i - x_j|^2 with c_ij = c_ji, so that P is strongly monotone with
m >= 2 min q_i: a unique Nash equilibrium, whatever is drawn.
"""

import io
import json
import math
import textwrap
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import GameError
from .gains import Choice, choose_gains
from .graphs import CommunicationGraph, graphs_of_text
from .parameters import parameters_of

SMALLEST_PLAYERS = 2
LARGEST_PLAYERS = 1000
LARGEST_DIMENSION = 100
NEURONS = 9
CONNECTED = 1e-9
"""Algebraic connectivity above which a graph is connected."""

LINE = 110

PLACEHOLDER = Choice(1.0, 1.0, 1.0, 1.0, 1.0, None)


@dataclass(frozen=True)
class Recipe:
    """What a new game is made from."""

    players: int
    dimension: int = 2
    orders: str = "mixed"  # "mixed", "first", "second" or a list such as "1,1,2"
    graph: str = "ring"  # one graph, named as graph_kinds tells
    seed: int = 0
    title: str | None = None
    schema: str | None = None  # path or URL for the editor's #:schema line


def new_game(recipe: Recipe) -> str:
    """Write a game that is valid at once, with comments and gains that suit its graph.

    Parameters
    ----------
    recipe
        Players, dimension, orders, graph, seed, title, schema.

    Returns
    -------
    str
        The text of a game file.

    Raises
    ------
    GameError
        For a recipe that makes no game.

    Examples
    --------
    >>> text = mog.new_game(mog.Recipe(players=3, dimension=1, graph="path"))
    >>> text.count("[[player]]")
    3
    """
    N, D = recipe.players, recipe.dimension
    if not SMALLEST_PLAYERS <= N <= LARGEST_PLAYERS:
        raise GameError(f"the number of players is {N}, expected 2 to {LARGEST_PLAYERS}")
    if not 1 <= D <= LARGEST_DIMENSION:
        raise GameError(f"the dimension is {D}, expected 1 to {LARGEST_DIMENSION}")
    if recipe.seed < 0:
        raise GameError(f"the seed is {recipe.seed}, expected a number that is not negative")
    if not ((recipe.title or "") + (recipe.schema or "")).isprintable():
        raise GameError("the title and the schema must be text without control characters")
    orders = _orders(recipe)
    graph = _graph(recipe)
    draft = tomllib.loads(_text(recipe, orders, graph, PLACEHOLDER))
    choice = choose_gains(parameters_of(draft))
    return _text(recipe, orders, graph, choice)


def _orders(recipe: Recipe) -> list[int]:
    N = recipe.players
    word = recipe.orders.strip().lower()
    if word in ("first", "second"):
        return [1 if word == "first" else 2] * N
    if word == "mixed":
        half = [1] * ((N + 1) // 2) + [2] * (N // 2)
        return [int(order) for order in np.random.default_rng([recipe.seed, 1]).permutation(half)]
    try:
        orders = [int(each) for each in recipe.orders.split(",")]
    except ValueError:
        orders = []
    if len(orders) != N or not set(orders) <= {1, 2}:
        raise GameError(
            f"orders is {recipe.orders!r}, expected mixed, first, second or {N} numbers 1 or 2 such as 1,2"
        )
    return orders


def _graph(recipe: Recipe) -> CommunicationGraph:
    graphs = graphs_of_text(recipe.graph, recipe.players, seed=recipe.seed)
    if len(graphs) != 1:
        raise GameError(f"{recipe.graph!r} means {len(graphs)} graphs, expected one")
    if not (graphs[0].connected if graphs[0].directed else graphs[0].algebraic_connectivity > CONNECTED):
        raise GameError(f"the graph {recipe.graph!r} does not connect all {recipe.players} players")
    return graphs[0]


def _text(recipe: Recipe, orders: Sequence[int], graph: CommunicationGraph, choice: Choice) -> str:
    N, D = recipe.players, recipe.dimension
    edges = sorted({(min(i, j), max(i, j)) for i, j, _ in graph.edges})
    random = np.random.default_rng([recipe.seed, 2])
    target = random.uniform(-5.0, 5.0, (N, D)).round(2)
    quadratic = random.uniform(1.0, 2.0, N).round(2)
    coupling = dict(zip(edges, random.uniform(0.1, 0.5, len(edges)).round(2).tolist(), strict=True))
    neighbours: dict[int, dict[int, float]] = {i: {} for i in range(1, N + 1)}
    for (i, j), weight in coupling.items():
        neighbours[i][j] = neighbours[j][i] = weight

    file = io.StringIO()
    if recipe.schema:
        print(f"#:schema {recipe.schema}\n", file=file)
    print(_head(recipe, choice), file=file)
    print(_gains(choice), file=file)
    print(_network(N * D), file=file)
    print("\n[graph]", file=file)
    if graph.directed:
        print("# Who hears whom: to hears from, by edges [from, to] or [from, to, weight].", file=file)
        print("directed = true", file=file)
    else:
        print("# Who exchanges estimates with whom: undirected edges [i, j] or [i, j, weight].", file=file)
    print(
        _wrapped(
            "edges = [", [f"[{i}, {j}]" if w == 1.0 else f"[{i}, {j}, {w!r}]" for i, j, w in graph.edges], "]"
        ),
        file=file,
    )
    for i in range(1, N + 1):
        player = _Player(i, orders[i - 1], D, random)
        lines = player.lines(target[i - 1], float(quadratic[i - 1]), neighbours[i])
        if i == 1:
            lines = _explained(lines)
        print("\n[[player]]", *lines, sep="\n", file=file)
    return file.getvalue()


def _head(recipe: Recipe, choice: Choice) -> str:
    N, D = recipe.players, recipe.dimension
    title = recipe.title or f"{N} players on a {recipe.graph} graph"
    made = (
        f"mog new --players {N} --dimension {D} --orders {recipe.orders} --graph {recipe.graph} "
        f"--seed {recipe.seed}"
    )
    known = (
        "the linear loop was too large to be checked"
        if choice.abscissa is None
        else f"the unperturbed loop decays like exp({choice.abscissa:.3g} t)"
    )
    comment = _comment(
        f"A game made by: {made}",
        "Player i has a target s_i of its own and keeps near its neighbours on the communication graph, "
        "f_i = q_i |x_i - s_i|^2 + sum_j c_ij |x_i - x_j|^2. All numbers are random; change them freely. "
        f"The gains suit these costs and this graph: {known}.",
        "Check the file after a change: mog check FILE. Make an FMU: mog build FILE. Run it: mog run FILE.",
    )
    return (
        f"{comment}\n"
        f"title = {json.dumps(title, ensure_ascii=False)}\n"
        f"dimension = {D}  # D, coordinates of an action"
    )


def _gains(choice: Choice) -> str:
    entries = (
        ("k1", choice.k1, "1/s, pulls x_i to z_i (order 1)"),
        ("k2", choice.k2, "step of the pseudo-gradient; speed of seeking"),
        ("k3", choice.k3, "1/s, consensus of the estimates; large against k2, larger on sparse graphs"),
        ("k4", choice.k4, "1/s, pulls v_i to -k2 grad_i f_i (order 2)"),
        ("beta", 20.0, "adaptation of the weights"),
        ("delta", choice.delta, "size of the robust term; must exceed the perturbations"),
        ("epsilon", 0.01, "width of the robust term's boundary layer"),
    )
    lines = [f"{name} = {value}".ljust(16) + f"  # {meaning}" for name, value, meaning in entries]
    return "\n[gains]\n" + "\n".join(lines)


def _network(actions: int) -> str:
    centers = np.linspace(-5.0, 5.0, NEURONS).round(2).tolist()
    width = round(3.0 * math.sqrt(actions), 2)
    return (
        "\n[rbf]\n"
        f"# q neurons; a number c stands for the vector (c, ..., c) of length N D = {actions}. "
        "Cover the actions that occur.\n"
        f"centers = {centers}\n"
        f"width = {width}\n"
        "W_max = 20.0  # bound of w'w for each weight column"
    )


@dataclass(frozen=True)
class _Player:
    number: int
    order: int
    dimension: int
    random: np.random.Generator

    def lines(self, target: Any, quadratic: float, neighbours: dict[int, float]) -> list[str]:
        start = self._draw(-8.0, 8.0)
        others = sorted(neighbours)
        near = ", ".join(f"[{j}, {neighbours[j]}]" for j in others)
        linear = [round(-2.0 * quadratic * each, 4) + 0.0 for each in target.tolist()]
        constant = round(quadratic * float(target @ target), 4)
        driver = int(self.random.choice(others))
        rest = f"linear = {linear}, constant = {constant}, coupling = [{near}]"
        own, other = self._draw(-0.5, 0.5), self._draw(-0.2, 0.2)
        amplitude, frequency, phase = self._draw(0.5, 1.5), self._draw(0.5, 2.5), self._draw(-3.0, 3.0)
        return [
            f'name = "player {self.number}"',
            f"order = {self.order}",
            f"x0 = {start}",
            *([f"z0 = {start}"] if self.order == 1 else []),
            f"cost = {{ quadratic = {quadratic}, {rest} }}",
            f"dynamics = {{ linear = [[{self.number}, {own}], [{driver}, {other}]] }}",
            f"disturbance = {{ amplitude = {amplitude}, frequency = {frequency}, phase = {phase} }}",
        ]

    def _draw(self, low: float, high: float) -> list[float]:
        return [each + 0.0 for each in self.random.uniform(low, high, self.dimension).round(2).tolist()]


def _explained(lines: Iterable[str]) -> list[str]:
    """The first player's lines, each with a comment above it."""
    meanings = {
        "name": 'A player may have gains, rbf and W0 of its own, u_max (bound of |u|), plant = "external"',
        "order": "1: velocity-driven, x_i' = u_i + g_i(x) + d_i(t); 2: acceleration-driven, v_i' = the same",
        "x0": "Initial action. Optional: z0 (order 1), v0 (order 2), y0. One number stands for D equal ones.",
        "cost": "f_i = quadratic |x_i|^2 + linear . x_i + constant + sum of c_ij |x_i - x_j|^2, [j, c_ij]",
        "dynamics": "g_i(x)_l = sum of G_l x_jl, [j, G] in linear, and of H_l x_jl^2, [j, H] in square",
        "disturbance": "d_il(t) = bias + amplitude sin(frequency t + phase)",
    }
    explained = []
    for line in lines:
        meaning = meanings.get(line.split(" ")[0])
        explained += [*([f"# {meaning}"] if meaning else []), line]
    return explained


def _comment(*paragraphs: str) -> str:
    lines: list[str] = []
    for paragraph in paragraphs:
        lines += textwrap.wrap(
            paragraph,
            width=LINE,
            initial_indent="# ",
            subsequent_indent="# ",
            break_long_words=False,
            break_on_hyphens=False,
        )
    return "\n".join(lines)


def _wrapped(begin: str, items: Sequence[str], end: str) -> str:
    """A list in one line if it fits, else in as few as it needs."""
    one = begin + ", ".join(items) + end
    if len(one) <= LINE:
        return one
    lines = [begin]
    row = "   "
    for item in items:
        if len(row) + len(item) + 2 > LINE:
            lines.append(row)
            row = "   "
        row += f" {item},"
    return "\n".join([*lines, row, end])
