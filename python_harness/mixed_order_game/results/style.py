"""How figures for papers look: widths, colours, line styles, fonts, legends."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Literal, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

COLUMN_WIDTH = 3.5
"""Width of a column of a two-column paper, in inches."""

PAGE_WIDTH = 7.16
"""Width of the whole page, in inches."""

TWO_COLUMNS = 5.0
"""Width in inches from which a legend is one line."""

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
LINE_STYLES: tuple[Literal["-", "--", ":", "-."], ...] = ("-", "--", ":", "-.")
MAP, MAP_END = mpl.colormaps["viridis"], 0.95
"""Colours of more players than the palette has, perceptually even, and the part of them that is used."""

STYLE: Mapping[str, Any] = {
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "font.family": "serif",
    "font.serif": ["STIXGeneral"],
    "mathtext.fontset": "stix",
    "figure.dpi": 150.0,
    "savefig.dpi": 300.0,
    "svg.hashsalt": "mixed-order-game",
    "pdf.fonttype": 42,
}


def paper_style() -> AbstractContextManager[None]:
    """Matplotlib settings of these figures, for a with statement around a figure of one's own."""
    return mpl.rc_context(cast("Any", dict(STYLE)))


def new_axes(width: float = COLUMN_WIDTH, height: float | None = None) -> Axes:
    """Axes of a new figure, width by height inches (height: 0.68 of the width if not given)."""
    figure = Figure(figsize=(width, 0.68 * width if height is None else height), layout="constrained")
    axes: Axes = figure.subplots()
    return axes


def colours(count: int) -> Sequence[Any]:
    """One a player: the palette, or a perceptually even map if it does not suffice."""
    if count <= len(PALETTE):
        return PALETTE[:count]
    return [MAP(value) for value in np.linspace(0.0, MAP_END, count)]


def readable_on(colour: Any) -> str:
    """Black or white for text on a colour, whichever has more contrast (WCAG 2, relative luminance)."""
    sRGB = np.array(to_rgb(colour))
    linear = np.where(sRGB <= 0.04045, sRGB / 12.92, ((sRGB + 0.055) / 1.055) ** 2.4)  # noqa: PLR2004
    luminance = float(linear @ (0.2126, 0.7152, 0.0722))
    return "black" if luminance > np.sqrt(1.05 * 0.05) - 0.05 else "white"


def width_of(axes: Axes) -> float:
    """Width of the figure in inches."""
    figure = axes.get_figure(root=True)
    return COLUMN_WIDTH if figure is None else float(figure.get_size_inches()[0])


def legend_above(axes: Axes, handles: Sequence[Any], labels: Sequence[str], columns: int) -> None:
    """A legend above the axes, so that it covers no curve; read row by row."""
    count = len(handles)
    by_rows = [k for column in range(columns) for k in range(column, count, columns)]
    axes.legend(
        [handles[k] for k in by_rows],
        [labels[k] for k in by_rows],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        frameon=False,
        borderaxespad=0.1,
        handlelength=1.3,
        handletextpad=0.4,
        columnspacing=0.9,
    )
