"""What tells lines apart: a legend for few players, a colour bar for many, labels at the ends of lines."""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from .style import LINE_STYLES, MAP, MAP_END, PALETTE, TWO_COLUMNS, colours, legend_above, width_of

if TYPE_CHECKING:
    from .result import Result

LABEL_SIZE, POINTS = 7.0, 72.0
"""Height of the font of such labels in points, and points of an inch."""

LABEL_HEIGHT = 1.15
"""Least distance of two labels at the ends of lines, in heights of their font."""

MOST_COLUMNS, MOST_COLUMNS_OF_A_PAGE = 5, 12


def player_key(
    axes: Axes,
    players: Sequence[int],
    result: "Result",
    references: Sequence[tuple[Line2D, str]] = (),
    *,
    dimension: int | None = None,
    letter: str = "i",
) -> None:
    """Colour for the player, style for the coordinate, above the axes so that it covers no curve.

    players: 0-based; none if the lines have labels of their own; more than the palette has are told by a
    colour bar. dimension: coordinates that are told
    apart, default the game's. letter: the player's in the paper.
    """
    D = result.dimension if dimension is None else dimension
    handles: list[Line2D] = []
    labels: list[str] = []
    palette = colours(result.players)
    if result.players <= len(PALETTE):
        for i in players:
            handles.append(Line2D([], [], color=palette[i]))
            labels.append(f"${letter}={i + 1}$")
    elif players:
        colour_bar(axes, result.players, letter)
    for coordinate in range(min(D, len(LINE_STYLES)) if D > 1 else 0):
        handles.append(Line2D([], [], color="0.3", linestyle=LINE_STYLES[coordinate]))
        labels.append(f"$l={coordinate + 1}$")
    for handle, label in references:
        handles.append(handle)
        labels.append(label)
    if handles:
        columns = MOST_COLUMNS if width_of(axes) < TWO_COLUMNS else MOST_COLUMNS_OF_A_PAGE
        legend_above(axes, handles, labels, columns=columns)


def colour_bar(axes: Axes, players: int, letter: str = "i") -> None:
    """The colours of many players beside the axes."""
    figure = axes.get_figure(root=True)
    if figure is None:
        return
    shades = MAP.resampled(256)
    norm = Normalize(1, 1 + (players - 1) / MAP_END)
    bar = figure.colorbar(
        ScalarMappable(norm, shades), ax=axes, label=f"player ${letter}$", pad=0.02, aspect=30
    )
    bar.ax.set_ylim(1, players)
    steps = MaxNLocator(nbins=6, integer=True, steps=[1, 2, 5, 10]).tick_values(1, players)
    bar.set_ticks([1.0, *(step for step in steps if 1.0 < step <= players)])
    bar.outline.set_linewidth(0.4)


def label_ends(axes: Axes, lines: Sequence[Line2D], labels: Sequence[str], *, farthest: float = 1.0) -> bool:
    """Write labels to the right of the lines' last points, in their colours, moved apart where they meet.

    Nothing is written, and False returned, if one had to move by more than farthest, a part of the axes.
    """
    figure = axes.get_figure(root=True)
    if figure is None:
        return False
    to_axes = axes.transData + axes.transAxes.inverted()
    ends = [float(to_axes.transform(line_end(line))[1]) for line in lines]
    height = axes.get_position().height * figure.get_size_inches()[1] * POINTS
    places = spread(ends, LABEL_HEIGHT * LABEL_SIZE / height)
    if max(abs(place - end) for place, end in zip(places, ends, strict=True)) > farthest:
        return False
    for line, label, place in zip(lines, labels, places, strict=True):
        axes.annotate(
            label,
            (1.015, place),
            xycoords="axes fraction",
            color=line.get_color(),
            fontsize=LABEL_SIZE,
            va="center",
            annotation_clip=False,
        )
    return True


def line_end(line: Line2D) -> tuple[float, float]:
    """The last point of a line."""
    x, y = line.get_data()
    return float(np.asarray(x)[-1]), float(np.asarray(y)[-1])


def spread(places: Sequence[float], apart: float) -> list[float]:
    """The places moved as little as keeps them so far apart, in their order, about where they were."""
    order = np.argsort(places, kind="stable")
    # of p_k - k apart the nearest sequence that does not fall: averages of neighbours that do (isotonic)
    blocks: list[tuple[float, int]] = []
    for rank, k in enumerate(order):
        blocks.append((float(places[k]) - rank * apart, 1))
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            (low, few), (high, more) = blocks[-2:]
            blocks[-2:] = [((low * few + high * more) / (few + more), few + more)]
    level = [mean for mean, count in blocks for _ in range(count)]
    moved = [0.0] * len(places)
    for rank, k in enumerate(order):
        moved[k] = level[rank] + rank * apart
    return moved


def unit_of(result: "Result", stem: str, otherwise: str = "") -> str:
    """The unit of a signal in brackets; nothing for a dimensionless one."""
    unit = result.unit(stem) or otherwise
    raised = re.sub(r"(?<=[A-Za-z])(\d)", r"$^\1$", unit)
    return f" ({raised})" if unit not in ("", "1") else ""
