"""The players' paths in the plane, with the communication graph between their starts."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..errors import PlotError
from .graph_figure import Edge, edges_of, is_directed
from .keys import colour_bar, unit_of
from .style import (
    COLUMN_WIDTH,
    PALETTE,
    TWO_COLUMNS,
    colours,
    legend_above,
    new_axes,
    paper_style,
    readable_on,
)

if TYPE_CHECKING:
    from .result import Result

FloatArray = NDArray[np.float64]

PLANE = 2
"""Coordinates of a game whose paths can be drawn."""

MOST_NAMED = 20
"""Most players whose numbers are written into their discs."""

EARLIER = "0.6"


def no_plane(dimension: int) -> str:
    """Why a game of another number of coordinates has no paths."""
    counted = "1 coordinate" if dimension == 1 else f"{dimension} coordinates"
    return f"paths are drawn in the plane: the game has {counted}, not {PLANE}"


def plot_plane(
    result: "Result",
    axes: Axes | None = None,
    *,
    edges: Iterable[Edge] | None = None,
    width: float = COLUMN_WIDTH,
) -> Axes:
    """Paths of the players in the plane (D = 2), with the communication graph between their starts.

    Crosses are the players' equilibria, in their colours, black where several meet; where costs change, those
    before the last ones are grey. Arrows show who is heard by whom where the graph is directed.
    edges: (i, j, weight), 1-based; by default those among the result's parameters, none if it has no
    parameters. width in inches. Raises PlotError unless D = 2, ResultError if x was not recorded.
    """
    if result.dimension != PLANE:
        raise PlotError(no_plane(result.dimension))
    x = result.x
    many = result.players > MOST_NAMED
    crowded = result.players > len(PALETTE) and width < TWO_COLUMNS
    size = 4.0 if many else 7.5 if crowded else 9.0
    with paper_style():
        axes = axes or new_axes(width, height=0.95 * width)
        _draw_edges(axes, x[0], edges_of(result) if edges is None else edges, directed=is_directed(result))
        for i, colour in enumerate(colours(result.players)):
            axes.plot(*x[:, i].T, color=colour, linewidth=0.5 if many else 1.0, label=str(i + 1), gid="path")
            axes.plot(*x[0, i], color=colour, marker="o", markersize=size, linestyle="none", zorder=3)
            if not many:
                axes.annotate(
                    str(i + 1),
                    x[0, i],
                    color=readable_on(colour),
                    fontsize=0.72 * size,
                    ha="center",
                    va="center",
                    zorder=4,
                )
        earlier = earlier_equilibria(result)
        axes.plot(*earlier.T, color=EARLIER, marker="x", markersize=5.0, linestyle="none", zorder=5)
        _draw_equilibria(axes, result.x_star)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("$x_{i1}$" + unit_of(result, "x"))
        axes.set_ylabel("$x_{i2}$" + unit_of(result, "x"))
        if result.players > len(PALETTE):
            colour_bar(axes, result.players)
        _explain(axes, earlier=len(earlier) > 0, columns=2 if width < TWO_COLUMNS else 5)
    return axes


def earlier_equilibria(result: "Result", players: int | None = None) -> FloatArray:
    """Equilibria of the first players, or of all, that costs changed on the way left behind, (K, D)."""
    points = np.round(result.equilibria[:, :players], 12)
    return np.unique(points[np.any(points != points[-1], axis=2)], axis=0)


def _draw_edges(axes: Axes, starts: FloatArray, edges: Iterable[Edge], *, directed: bool) -> None:
    """Lines between the starts (N, 2) as wide as the root of their weights."""
    for i, j, weight in edges:
        ends = starts[[i - 1, j - 1]]
        width = 0.8 * np.sqrt(weight)
        axes.plot(*ends.T, color="0.75", linewidth=width, zorder=1, gid="edge")
        if directed:
            middle = ends.mean(axis=0)
            arrow = {"arrowstyle": "->", "color": "0.6", "linewidth": width}
            axes.annotate("", middle + 0.01 * (ends[1] - ends[0]), middle, arrowprops=arrow, zorder=2)


def _draw_equilibria(axes: Axes, x_star: FloatArray) -> None:
    """A cross a point, with a white edge so that it shows on paths."""
    points, members = np.unique(np.round(x_star, 12), axis=0, return_inverse=True)
    palette = colours(len(x_star))
    for k, point in enumerate(points):
        (whose,) = np.nonzero(members.ravel() == k)
        axes.plot(
            *point,
            color=palette[whose[0]] if len(whose) == 1 else "black",
            marker="X",
            markersize=6.0,
            markeredgecolor="white",
            markeredgewidth=0.5,
            linestyle="none",
            zorder=6,
        )


def _explain(axes: Axes, *, earlier: bool, columns: int) -> None:
    keys = {
        "start of player $i$": Line2D([], [], color="0.3", marker="o", markersize=6.0, linestyle="none"),
        "path": Line2D([], [], color="0.3"),
        "communication": Line2D([], [], color="0.75", linewidth=0.8),
        "equilibrium": Line2D([], [], color="black", marker="X", markersize=5.0, linestyle="none"),
        "equilibrium before": Line2D([], [], color=EARLIER, marker="x", markersize=5.0, linestyle="none"),
    }
    if not earlier:
        del keys["equilibrium before"]
    if not any(line.get_gid() == "edge" for line in axes.lines):
        del keys["communication"]
    legend_above(axes, list(keys.values()), list(keys), columns=columns)
