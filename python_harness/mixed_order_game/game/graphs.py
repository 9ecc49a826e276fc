"""Communication graphs: networkx generators, all connected labelled graphs, and the FMU's edges a[i,j]."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MixedOrderGameError
from ..fmu.model import Model

LARGEST_ALL = 6
"""Most players of which all connected labelled graphs are listed: 26704 graphs; seven have 1866256."""

LARGEST_CLASSES = 7
"""Most players of which the graphs up to isomorphism are listed, as in networkx's atlas."""

LARGEST_PLAYERS = 1000
ATTEMPTS = 1000
"""Random graphs drawn until one is connected."""

EDGE = re.compile(r"(\d+)([->])(\d+)(?::([0-9.eE+-]+))?")
DIRECTED = "directed:"


class GraphError(MixedOrderGameError, ValueError):
    """A communication graph that is not one, or that a game cannot take."""


@dataclass(frozen=True)
class CommunicationGraph:
    """A weighted graph of N players: sorted edges (i, j, weight), 1-based, i < j; from i to j if directed."""

    players: int
    edges: tuple[tuple[int, int, float], ...]
    directed: bool = False

    def __post_init__(self) -> None:
        pairs = [(i, j) for i, j, _ in self.edges]
        for i, j, weight in self.edges:
            if i == j or not 1 <= min(i, j) <= max(i, j) <= self.players or (i > j and not self.directed):
                raise GraphError(f"{i}-{j} is no edge between players 1 to {self.players}")
            if not (np.isfinite(weight) and weight > 0.0):
                raise GraphError(f"edge {i}-{j} has the weight {weight:g}, which is not positive")
        if sorted(set(pairs)) != pairs:
            raise GraphError("an edge is listed twice")

    @property
    def label(self) -> str:
        """Edges as text: 1-2 1-5 2-3:0.5, directed 1>2 2>1; graph_of_text reads it."""
        sign = ">" if self.directed else "-"
        return " ".join(f"{i}{sign}{j}" + ("" if w == 1.0 else f":{w!r}") for i, j, w in self.edges)

    @cached_property
    def adjacency(self) -> NDArray[np.float64]:
        """a_ij, (N, N): the weight with which i hears j."""
        matrix = np.zeros((self.players, self.players))
        for i, j, weight in self.edges:
            matrix[j - 1, i - 1] = weight
            if not self.directed:
                matrix[i - 1, j - 1] = weight
        return matrix

    @cached_property
    def algebraic_connectivity(self) -> float:
        """Second smallest eigenvalue of the Laplacian, by real parts if the graph is directed.

        Positive exactly if the graph is connected; if directed, if some player reaches all others.
        """
        laplacian = np.diag(self.adjacency.sum(axis=1)) - self.adjacency
        if self.directed:
            return float(np.sort(np.linalg.eigvals(laplacian).real)[1])
        return float(np.linalg.eigvalsh(laplacian)[1])

    @property
    def connected(self) -> bool:
        """Whether every player is reached from every other one."""
        reached = np.linalg.matrix_power((self.adjacency > 0.0) + np.eye(self.players), self.players - 1)
        return bool(np.all(reached > 0.0))

    def start_values(self, model: Model) -> dict[str, float]:
        """All edge weights a[i,j] of a game for this graph. Raises GraphError if the game cannot take it."""
        if self.players != model.players:
            raise GraphError(f"the graph has {self.players} players, the game has {model.players}")
        if self.directed and not model.directed:
            raise GraphError("the graph is directed, and that of the game is not")
        weights: dict[tuple[int, ...], float] = {(i, j): weight for i, j, weight in self.edges}
        if model.directed:
            heard: dict[tuple[int, ...], float] = {(j, i): weight for (i, j), weight in weights.items()}
            weights = heard if self.directed else weights | heard
        return edge_values(model, weights)


def edge_values(model: Model, weights: Mapping[tuple[int, ...], float]) -> dict[str, float]:
    """Start values of every a[i,j] of a game; 0 where weights, by the 1-based indices of a, has none.

    Raises GraphError for an edge that is not a variable of the FMU.
    """
    variables = model.indexed("a")
    for i, j in weights:
        if (i, j) not in variables:
            raise GraphError(
                f"the FMU has no edge a[{i},{j}]: its game exposes only the edges of its own graph"
            )
    return {variable.name: float(weights.get(pair, 0.0)) for pair, variable in variables.items()}


def from_networkx(graph: Any) -> CommunicationGraph:
    """A networkx graph, its nodes numbered 1 to N in their order; the attribute weight is 1 when absent.

    A DiGraph gives a directed one: the target of an edge hears its source.
    """
    number = {node: k for k, node in enumerate(graph.nodes, start=1)}
    edges = []
    for a, b, weight in graph.edges(data="weight", default=1.0):
        i, j = (number[a], number[b]) if graph.is_directed() else sorted((number[a], number[b]))
        edges.append((i, j, float(weight)))
    return CommunicationGraph(len(number), tuple(sorted(edges)), graph.is_directed())


def graph_of_model(model: Model) -> CommunicationGraph:
    """The graph of an FMU's start values."""
    return CommunicationGraph(model.players, model.edges, model.directed)


def graph_of(adjacency: NDArray[np.float64]) -> CommunicationGraph:
    """The graph of a matrix of weights a_ij (N, N), directed unless it is symmetric."""
    directed = not np.array_equal(adjacency, adjacency.T)
    heard = adjacency.T if directed else np.triu(adjacency, 1)  # from, to
    rows, columns = np.nonzero(heard)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    edges = tuple((i + 1, j + 1, float(heard[i, j])) for i, j in pairs)
    return CommunicationGraph(len(adjacency), edges, directed)


def graph_of_text(text: str, players: int) -> CommunicationGraph:
    """A graph from its edges: 1-2 2-3:0.5 (separated by blanks or commas, a weight after a colon).

    1>2 is an edge by which 2 hears 1; then all edges are directed.
    """
    edges = []
    directed = ">" in text
    for part in re.split(r"[\s,]+", text.strip()):
        match = EDGE.fullmatch(part)
        if match is None or (match[2] == ">") != directed:
            expected = "2>3 or 2>3:0.5" if directed else "2-3 or 2-3:0.5"
            raise GraphError(f"{part!r} is not an edge: {expected} expected")
        ends = int(match[1]), int(match[3])
        i, j = ends if directed else sorted(ends)
        try:
            edges.append((i, j, float(match[4] or 1.0)))
        except ValueError:
            raise GraphError(f"{match[4]!r} is not a weight") from None
    return CommunicationGraph(players, tuple(sorted(edges)), directed)


def all_connected(players: int) -> Iterator[CommunicationGraph]:
    """Every connected labelled graph with weights 1, from few edges to many: 728 of them for five players."""
    if not 2 <= players <= LARGEST_ALL:  # noqa: PLR2004 - a graph has two players
        raise GraphError(f"all graphs are listed for 2 to {LARGEST_ALL} players, not for {players}")
    pairs = list(combinations(range(players), 2))
    for count in range(players - 1, len(pairs) + 1):
        for chosen in combinations(pairs, count):
            if _connected(players, chosen):
                yield CommunicationGraph(players, tuple((i + 1, j + 1, 1.0) for i, j in chosen))


def connected_classes(players: int) -> Iterator[CommunicationGraph]:
    """One connected graph of every isomorphism class, from networkx's atlas: 21 of them for five players."""
    import networkx as nx

    if not 2 <= players <= LARGEST_CLASSES:  # noqa: PLR2004
        raise GraphError(
            f"classes of graphs are listed for 2 to {LARGEST_CLASSES} players, not for {players}"
        )
    for graph in nx.graph_atlas_g():
        if len(graph) == players and nx.is_connected(graph):
            yield from_networkx(graph)


def _connected(players: int, edges: Iterable[tuple[int, int]]) -> bool:
    parts = [1 << i for i in range(players)]
    for i, j in edges:
        joined = parts[i] | parts[j]
        for k in range(players):
            if joined >> k & 1:
                parts[k] = joined
    return parts[0] == (1 << players) - 1


Generator = Callable[[int, list[float], int], Any]

ARGUMENTS: dict[str, tuple[str, Callable[[float], bool]]] = {
    "P": ("a probability from 0 to 1", lambda value: 0.0 <= value <= 1.0),
    "DEGREE": ("a whole number", float.is_integer),
    "K": ("a whole number", float.is_integer),
    "M": ("a whole number", float.is_integer),
    "RADIUS": ("a positive distance", lambda value: 0.0 < value < np.inf),
}
"""The numbers that kinds of graphs take, named as in graph_kinds: what is expected, and whether one is it."""


def _fixed(name: str) -> Generator:
    import networkx as nx

    function = getattr(nx, name)
    return lambda players, _arguments, _seed: function(players)


def _generators() -> dict[str, tuple[tuple[str, ...], bool, Generator]]:
    """Name -> names of its arguments, random or not, function of (players, arguments, seed)."""
    import networkx as nx

    return {
        "ring": ((), False, _fixed("cycle_graph")),
        "path": ((), False, _fixed("path_graph")),
        "complete": ((), False, _fixed("complete_graph")),
        "wheel": ((), False, _fixed("wheel_graph")),
        "star": ((), False, lambda n, _, __: nx.star_graph(n - 1)),
        "tree": ((), True, lambda n, _, seed: nx.random_labeled_tree(n, seed=seed)),
        "random": (("P",), True, lambda n, a, seed: nx.gnp_random_graph(n, a[0], seed=seed)),
        "regular": (("DEGREE",), True, lambda n, a, seed: nx.random_regular_graph(int(a[0]), n, seed=seed)),
        "small-world": (
            ("K", "P"),
            True,
            lambda n, a, seed: nx.watts_strogatz_graph(n, int(a[0]), a[1], seed=seed),
        ),
        "scale-free": (("M",), True, lambda n, a, seed: nx.barabasi_albert_graph(n, int(a[0]), seed=seed)),
        "geometric": (("RADIUS",), True, lambda n, a, seed: nx.random_geometric_graph(n, a[0], seed=seed)),
        "directed:ring": ((), False, lambda n, _, __: nx.cycle_graph(n, create_using=nx.DiGraph)),
        "directed:random": (
            ("P",),
            True,
            lambda n, a, seed: nx.gnp_random_graph(n, a[0], seed=seed, directed=True),
        ),
    }


def graphs_of_text(
    text: str, players: int, *, seed: int = 0, own: CommunicationGraph | None = None
) -> list[CommunicationGraph]:
    """Graphs by name, as graph_kinds tells; own is the graph called own. Random ones are drawn connected.

    Raises GraphError for a name or argument that makes no sense.
    """
    text = text.strip().lower()
    if text[:1].isdigit():
        return [graph_of_text(text, players)]
    if text == "all":
        return list(all_connected(players))
    if text == "classes":
        return list(connected_classes(players))
    if text == "own" and own is not None:
        return [own]
    kind, _, count_text = text.partition("@")
    directed = DIRECTED if kind.startswith(DIRECTED) else ""
    name, *argument_texts = kind.removeprefix(DIRECTED).split(":")
    name = directed + name
    generators = _generators()
    if name not in generators:
        raise GraphError(
            f"there is no kind of graph {name!r}: it is one of all, classes, {', '.join(generators)}"
        )
    needed, random, generate = generators[name]
    try:
        arguments = [float(argument) for argument in argument_texts]
        count = int(count_text) if count_text else 1
    except ValueError:
        raise GraphError(f"{text!r} is not a kind of graph with numbers after : and @") from None
    _judge_arguments(name, needed, arguments)
    if count < 1 or (count > 1 and not random):
        raise GraphError(f"{text!r}: the count is 1 for a kind that is not random, and positive for others")
    if not 2 <= players <= LARGEST_PLAYERS:  # noqa: PLR2004
        raise GraphError(f"graphs are made for 2 to {LARGEST_PLAYERS} players, not for {players}")
    return [_draw(text, players, generate, arguments, [seed, k], random=random) for k in range(count)]


def _judge_arguments(name: str, needed: Sequence[str], values: Sequence[float]) -> None:
    if len(values) != len(needed):
        plural = "s" * (len(needed) != 1)
        raise GraphError(f"{name} takes {len(needed)} number{plural} after a colon, not {len(values)}")
    for argument, value in zip(needed, values, strict=True):
        expected, suits = ARGUMENTS[argument]
        if not suits(value):
            raise GraphError(f"{argument} of {name} is {value:g}, expected {expected}")


def _draw(
    text: str, players: int, generate: Generator, arguments: list[float], seeds: list[int], *, random: bool
) -> CommunicationGraph:
    import networkx as nx

    sequence = np.random.default_rng(seeds)
    for _ in range(ATTEMPTS if random else 1):
        try:
            graph = generate(players, arguments, int(sequence.integers(2**31)))
        except (nx.NetworkXError, ValueError) as error:
            raise GraphError(f"{text} with {players} players: {error}") from error
        if nx.is_strongly_connected(graph) if graph.is_directed() else nx.is_connected(graph):
            return from_networkx(graph)
    raise GraphError(f"{text} with {players} players gave no connected graph in {ATTEMPTS} attempts")
