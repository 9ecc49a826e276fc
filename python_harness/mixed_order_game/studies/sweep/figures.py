"""Heat maps of a sweep, for a paper: medians over two varied columns, or over the edges of graphs."""

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ...errors import PlotError, ResultError
from ...game.graphs import graph_of_text
from ...results.metrics import METRIC_UNITS
from ...results.style import COLUMN_WIDTH, legend_above, new_axes, paper_style
from .definition import Sweep
from .store import schema_of

if TYPE_CHECKING:
    from .table import SweepResult

FloatArray = NDArray[np.float64]

LARGEST_EXACT = 24
"""Most values of a column that get a row or column of their own; more are put into bins."""

BINS = 12
WIDE = 10.0
"""Ratio of the largest to the smallest value from which an axis or the colours are logarithmic."""

UNKNOWN = "0.85"
"""Colour of cells without a value: no run lies there, or none settled."""

LABELS = {
    "settling_time": "settling time",
    "overshoot": "overshoot",
    "control_energy": r"control energy $\int |u|^2\,\mathrm{d}t$",
    "control_peak": r"largest $|u_{il}|$",
    "final_error": r"final error $|x - x^*|$",
    "events": "sphere events",
    "graph_edges": "edges",
    "graph_connectivity": "algebraic connectivity",
}


def plot_heat_map(
    result: "SweepResult",
    x: str,
    y: str,
    value: str,
    axes: Axes | None = None,
    *,
    width: float = COLUMN_WIDTH,
) -> Axes:
    """Median of the column value over the columns x and y; grey where no run has it. width in inches.

    Columns with more than 24 different values are put into 12 bins, equal in the logarithm if they span more
    than a decade, as colours then are. Raises ResultError for a column that does not exist, PlotError if x
    and y do not vary.
    """
    across, up, values = result[x], result[y], result[value]
    columns, x_labels = _cells(across, x)
    rows, y_labels = _cells(up, y)
    medians = np.full((len(y_labels), len(x_labels)), np.nan)
    for row in range(len(y_labels)):
        for column in range(len(x_labels)):
            chosen = values[(rows == row) & (columns == column) & ~np.isnan(values)]
            if chosen.size:
                medians[row, column] = np.median(chosen)
    with paper_style():
        axes = axes or new_axes(width, height=0.85 * width)
        _image(axes, medians, value)
        _ticks(axes, x, x_labels, y, y_labels)
    return axes


def check_heat_map(definition: Sweep, x: str, y: str, value: str) -> None:
    """Judge the columns of a heat map before a sweep is run.

    Raises ResultError for a column that the table will not have or that is text, PlotError if x or y does not
    vary.
    """
    columns = schema_of(definition)
    for name in (x, y, value):
        if name not in columns.names:
            raise ResultError(f"the sweep has no column {name}: it has {', '.join(columns.names)}")
        if pa.types.is_string(columns.field(name).type):
            raise ResultError(f"{name} is text: it cannot be drawn")
    described = definition.describe(0)
    for name in (x, y):
        if name in described and not definition.varies(name):
            raise PlotError(f"{name} does not vary in this sweep")


def plot_edges(
    result: "SweepResult", value: str, axes: Axes | None = None, *, width: float = COLUMN_WIDTH
) -> Axes:
    """Median of the column value over the graphs that have the edge i-j, for each pair of players.

    Raises PlotError if the sweep has no graphs, ResultError if it has no such column.
    """
    if "graph" not in result.table.column_names:
        raise PlotError("this sweep varies no graphs")
    values = result[value]
    players = int(max(int(n) for n in _ends(result)))
    graphs = [graph_of_text(text, players).adjacency > 0.0 for text in result.table["graph"].to_pylist()]
    present = np.array(graphs) & ~np.isnan(values)[:, np.newaxis, np.newaxis]
    medians = np.full((players, players), np.nan)
    for i, j in zip(*np.nonzero(present.any(axis=0)), strict=True):
        medians[i, j] = np.median(values[present[:, i, j]])
    with paper_style():
        axes = axes or new_axes(width, height=0.85 * width)
        _image(axes, medians, value)
        names = [str(i + 1) for i in range(players)]
        _ticks(axes, "player $j$", names, "player $i$", names)
    return axes


def _ends(result: "SweepResult") -> set[str]:
    texts = set(result.table["graph"].to_pylist())
    return {end for text in texts for edge in text.split() for end in edge.partition(":")[0].split("-")}


def _cells(values: FloatArray, name: str) -> tuple[NDArray[np.int_], list[str]]:
    """Cell of every value and the cells' labels."""
    levels = np.unique(values[~np.isnan(values)])
    if levels.size < 2:  # noqa: PLR2004 - nothing to compare
        raise PlotError(f"{name} does not vary in this sweep")
    if levels.size <= LARGEST_EXACT:
        return np.searchsorted(levels, values), [f"{level:.4g}" for level in levels]
    logarithmic = levels[0] > 0.0 and levels[-1] / levels[0] > WIDE
    edges = (np.geomspace if logarithmic else np.linspace)(levels[0], levels[-1], BINS + 1)
    middle = np.sqrt(edges[1:] * edges[:-1]) if logarithmic else 0.5 * (edges[1:] + edges[:-1])
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1), [
        f"{m:.3g}" for m in middle
    ]


def _image(axes: Axes, medians: FloatArray, value: str) -> None:
    known = medians[~np.isnan(medians)]
    if not known.size:
        raise PlotError(f"no run of this sweep has a {value}")
    low, high = float(known.min()), float(known.max())
    norm = LogNorm(low, high) if low > 0.0 and high / low > WIDE else Normalize(low, high)
    axes.set_facecolor(UNKNOWN)
    axes.grid(visible=False)
    image = axes.imshow(medians, origin="lower", aspect="auto", cmap="viridis", norm=norm)
    figure = axes.get_figure(root=True)
    if figure is not None:
        figure.colorbar(image, ax=axes, label=_label(value), ticks=[low] if low == high else None)
    if known.size < medians.size:
        legend_above(axes, [Patch(facecolor=UNKNOWN)], ["no value"], columns=1)


def _label(name: str) -> str:
    unit = METRIC_UNITS.get(name, "")
    return LABELS.get(name, name) + (f" ({unit})" if unit else "")


def _ticks(axes: Axes, x: str, x_labels: list[str], y: str, y_labels: list[str]) -> None:
    axes.set_xticks(range(len(x_labels)), x_labels, rotation=90 if len(x_labels) > BINS // 2 else 0)
    axes.set_yticks(range(len(y_labels)), y_labels)
    axes.set_xlabel(_label(x))
    axes.set_ylabel(_label(y))
