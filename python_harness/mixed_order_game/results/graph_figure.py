"""The communication graph of a run or a game, and its figure."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..errors import PlotError
from ..names import indices_of, parse_name
from .style import COLUMN_WIDTH, colours, legend_above, new_axes, paper_style, readable_on

if TYPE_CHECKING:
    from .result import Result

Edge = tuple[int, int, float]
"""Players counted from 1, and the weight; from the first to the second where the graph is directed."""

SECOND_ORDER = 2
LARGEST_CIRCLE = 12
"""Most players that stand on a circle; more are placed so that edges are short."""

FULL_WIDTH = 60
"""Edges up to which they are drawn in full width."""

MOST_NAMED = 60
"""Most players whose numbers are written."""


def plot_graph(
    edges: Sequence[Edge],
    order: Sequence[int],
    axes: Axes | None = None,
    *,
    directed: bool = False,
    width: float = COLUMN_WIDTH,
) -> Axes:
    """Communication graph: discs for players of order 1, squares for order 2, lines as wide as their weights.

    edges: 1-based. order: (N,). Arrows lead from who is heard to who hears where the graph is directed. width
    in inches.
    """
    places = _places(len(order), edges)
    largest = max((weight for _, _, weight in edges), default=1.0)
    thin = min(1.0, FULL_WIDTH / max(len(edges), 1))
    size = float(np.clip(36.0 / np.sqrt(len(order)), 2.5, 14.0)) * min(1.0, width / COLUMN_WIDTH)
    with paper_style():
        axes = axes or new_axes(width, height=0.85 * width)
        for i, j, weight in edges:
            axes.annotate(
                "",
                places[j - 1],
                places[i - 1],
                arrowprops={
                    "arrowstyle": "-|>" if directed else "-",
                    "connectionstyle": "arc3,rad=0.12" if directed else "arc3",
                    "color": "0.55",
                    "alpha": 0.4 + 0.6 * thin,
                    "linewidth": (0.3 + 0.9 * weight / largest) * np.sqrt(thin),
                    "shrinkA": 0.5 * size,
                    "shrinkB": 0.5 * size,
                },
                zorder=1,
            )
        for i, colour in enumerate(colours(len(order))):
            second = order[i] == SECOND_ORDER
            axes.plot(
                *places[i],
                color=colour,
                marker="s" if second else "o",
                markersize=size,
                linestyle="none",
                zorder=2,
            )
            if len(order) <= MOST_NAMED:
                axes.annotate(
                    str(i + 1),
                    places[i],
                    color=readable_on(colour),
                    fontsize=0.55 * size,
                    ha="center",
                    va="center",
                    zorder=3,
                )
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.margins(0.12)
        _explain(axes, order)
    return axes


def graph_of_result(result: "Result", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """The communication graph among a result's parameters. Raises PlotError if it holds none."""
    edges = edges_of(result)
    if not edges:
        raise PlotError("the result holds no communication graph: a CSV file has no parameters")
    second = {i for i, _ in indices_of(result.columns, "v")} | {
        i for i, _ in indices_of(result.parameters, "v0")
    }
    order = [SECOND_ORDER if i in second else 1 for i in range(1, result.players + 1)]
    return plot_graph(edges, order, axes, directed=is_directed(result), width=width)


def _places(players: int, edges: Iterable[Edge]) -> NDArray[np.float64]:
    """Where the players stand, (N, 2): clockwise from the top, or where edges are short."""
    if players <= LARGEST_CIRCLE:
        angles = 0.5 * np.pi - 2.0 * np.pi * np.arange(players) / players
        return np.column_stack([np.cos(angles), np.sin(angles)])
    import networkx as nx

    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(1, players + 1))
    graph.add_edges_from((i, j) for i, j, _ in edges)
    places = nx.kamada_kawai_layout(graph)
    return np.array([places[i] for i in range(1, players + 1)])


def _explain(axes: Axes, order: Sequence[int]) -> None:
    """The legend, if players of both orders are there."""
    if len(set(order)) > 1:
        handles = [Line2D([], [], color="0.3", marker=marker, linestyle="none") for marker in "os"]
        legend_above(axes, handles, ["order 1", "order 2"], columns=2)


def edges_of(result: "Result") -> list[Edge]:
    """Communication graph among a result's parameters, 1-based, positive weights: (i, j, weight) with i < j.

    Of a directed graph (from, to, weight), see is_directed.
    """
    directed = is_directed(result)
    edges = []
    for name, value in result.parameters.items():
        stem, index = parse_name(name)
        if stem == "a" and value > 0.0:
            i, j = (index[1], index[0]) if directed else (index[0], index[1])
            edges.append((i, j, float(value)))
    return edges


def is_directed(result: "Result") -> bool:
    """Whether the communication graph among a result's parameters is directed: it has a[i,j] with i > j."""
    parsed = map(parse_name, result.parameters)
    return any(stem == "a" and index[0] > index[1] for stem, index in parsed)
