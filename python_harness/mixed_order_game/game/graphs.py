"""Communication graphs: networkx generators, all connected labelled graphs, and the FMU's edges a[i,j]."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
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

EDGE = re.compile(r"(\d+)-(\d+)(?::([0-9.eE+-]+))?")


class GraphError(MixedOrderGameError):
    """A communication graph that is not one, or that a game cannot take."""


@dataclass(frozen=True)
class CommunicationGraph:
    """An undirected weighted graph of N players: edges (i, j, weight), i < j, 1-based, sorted."""

    players: int
    edges: tuple[tuple[int, int, float], ...]

    def __post_init__(self) -> None:
        pairs = [(i, j) for i, j, _ in self.edges]
        for i, j, weight in self.edges:
            if not 1 <= i < j <= self.players:
                raise GraphError(f"{i}-{j} is no edge between players 1 to {self.players}")
            if not (np.isfinite(weight) and weight > 0.0):
                raise GraphError(f"edge {i}-{j} has the weight {weight:g}, which is not positive")
        if sorted(set(pairs)) != pairs:
            raise GraphError("an edge is listed twice")

    @property
    def label(self) -> str:
        """Edges as text: 1-2 1-5 2-3:0.5; graph_of_text reads it."""
        return " ".join(f"{i}-{j}" + ("" if w == 1.0 else f":{w!r}") for i, j, w in self.edges)

    @cached_property
    def adjacency(self) -> NDArray[np.float64]:
        """a_ij, (N, N)."""
        matrix = np.zeros((self.players, self.players))
        for i, j, weight in self.edges:
            matrix[i - 1, j - 1] = matrix[j - 1, i - 1] = weight
        return matrix

    @cached_property
    def algebraic_connectivity(self) -> float:
        """Second smallest eigenvalue of the Laplacian; positive exactly if the graph is connected."""
        laplacian = np.diag(self.adjacency.sum(axis=1)) - self.adjacency
        return float(np.linalg.eigvalsh(laplacian)[1])

    def start_values(self, model: Model) -> dict[str, float]:
        """All edge weights a[i,j] of a game for this graph. Raises GraphError if the game cannot take it."""
        if self.players != model.players:
            raise GraphError(f"the graph has {self.players} players, the game has {model.players}")
        return edge_values(model, {(i, j): weight for i, j, weight in self.edges})


def edge_values(model: Model, weights: Mapping[tuple[int, ...], float]) -> dict[str, float]:
    """Start values of every a[i,j] of a game; 0 where weights, by 1-based (i, j) with i < j, has none.

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
    """A networkx graph, its nodes numbered 1 to N in their order; the attribute weight is 1 when absent."""
    number = {node: k for k, node in enumerate(graph.nodes, start=1)}
    edges = []
    for a, b, weight in graph.edges(data="weight", default=1.0):
        i, j = sorted((number[a], number[b]))
        edges.append((i, j, float(weight)))
    return CommunicationGraph(len(number), tuple(sorted(edges)))


def graph_of_model(model: Model) -> CommunicationGraph:
    """The graph of an FMU's start values."""
    return CommunicationGraph(model.players, model.edges)


def graph_of(adjacency: NDArray[np.float64]) -> CommunicationGraph:
    """The graph of a symmetric matrix of weights a_ij (N, N)."""
    rows, columns = np.nonzero(np.triu(adjacency, 1))
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return CommunicationGraph(len(adjacency), tuple((i + 1, j + 1, float(adjacency[i, j])) for i, j in pairs))


def graph_of_text(text: str, players: int) -> CommunicationGraph:
    """A graph from its edges: 1-2 2-3:0.5 (separated by blanks or commas, a weight after a colon)."""
    edges = []
    for part in re.split(r"[\s,]+", text.strip()):
        match = EDGE.fullmatch(part)
        if match is None:
            raise GraphError(f"{part!r} is not an edge: 2-3 or 2-3:0.5 expected")
        i, j = sorted((int(match[1]), int(match[2])))
        try:
            edges.append((i, j, float(match[3] or 1.0)))
        except ValueError:
            raise GraphError(f"{match[3]!r} is not a weight") from None
    return CommunicationGraph(players, tuple(sorted(edges)))


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


def _fixed(name: str) -> Generator:
    import networkx as nx

    function = getattr(nx, name)
    return lambda players, _arguments, _seed: function(players)


def _generators() -> dict[str, tuple[int, bool, Generator]]:
    """Name -> number of arguments, random or not, function of (players, arguments, seed)."""
    import networkx as nx

    return {
        "ring": (0, False, _fixed("cycle_graph")),
        "path": (0, False, _fixed("path_graph")),
        "complete": (0, False, _fixed("complete_graph")),
        "wheel": (0, False, _fixed("wheel_graph")),
        "star": (0, False, lambda n, _, __: nx.star_graph(n - 1)),
        "tree": (0, True, lambda n, _, seed: nx.random_labeled_tree(n, seed=seed)),
        "random": (1, True, lambda n, a, seed: nx.gnp_random_graph(n, a[0], seed=seed)),
        "regular": (1, True, lambda n, a, seed: nx.random_regular_graph(int(a[0]), n, seed=seed)),
        "small-world": (2, True, lambda n, a, seed: nx.watts_strogatz_graph(n, int(a[0]), a[1], seed=seed)),
        "scale-free": (1, True, lambda n, a, seed: nx.barabasi_albert_graph(n, int(a[0]), seed=seed)),
        "geometric": (1, True, lambda n, a, seed: nx.random_geometric_graph(n, a[0], seed=seed)),
    }


GRAPHS_HELP = (
    "all (every connected labelled graph), classes (one of every isomorphism class), ring, path, star, "
    "wheel, complete, tree, random:P, regular:DEGREE, small-world:K:P, scale-free:M, geometric:RADIUS, "
    "own (the game's), or edges such as 1-2,2-3:0.5; @COUNT after a random kind draws as many"
)


def graphs_of_text(
    text: str, players: int, *, seed: int = 0, own: CommunicationGraph | None = None
) -> list[CommunicationGraph]:
    """Graphs by name, as GRAPHS_HELP tells; own is the graph called own. Random ones are drawn connected.

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
    name, *argument_texts = kind.split(":")
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
    if len(arguments) != needed:
        raise GraphError(
            f"{name} takes {needed} number{'s' * (needed != 1)} after a colon, not {len(arguments)}"
        )
    if count < 1 or (count > 1 and not random):
        raise GraphError(f"{text!r}: the count is 1 for a kind that is not random, and positive for others")
    if not 2 <= players <= LARGEST_PLAYERS:  # noqa: PLR2004
        raise GraphError(f"graphs are made for 2 to {LARGEST_PLAYERS} players, not for {players}")
    return [_draw(text, players, generate, arguments, [seed, k], random=random) for k in range(count)]


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
        if nx.is_connected(graph):
            return from_networkx(graph)
    raise GraphError(f"{text} with {players} players gave no connected graph in {ATTEMPTS} attempts")
