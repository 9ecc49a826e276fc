"""Figures of a run: actions, velocities, error, and the players' paths in the plane with their graph.

Every function draws into the axes given, or into a figure of its own, and returns the axes; save_figure
writes it. Colour tells the player (Okabe and Ito's palette, safe for colour-blind readers), line style the
coordinate.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..errors import PlotError, ResultError
from ..files.reading import suffix_of
from ..files.writing import FIGURE, write_file
from ..fmu.model import Model
from ..names import parse_name
from .graph_figure import SECOND_ORDER, edges_of, graph_of_result, is_directed, plot_graph
from .style import (
    COLUMN_WIDTH,
    LARGEST_LEGEND,
    LINE_STYLES,
    PAGE_WIDTH,
    TWO_COLUMNS,
    colours,
    legend_above,
    new_axes,
    paper_style,
    width_of,
)

if TYPE_CHECKING:
    from .result import Result

__all__ = [
    "COLUMN_WIDTH",
    "KINDS",
    "PAGE_WIDTH",
    "draw",
    "graph_of_result",
    "new_axes",
    "paper_figures",
    "paper_style",
    "plot_error",
    "plot_graph",
    "plot_plane",
    "plot_positions",
    "plot_velocities",
    "result_figures",
    "save_figure",
]

FloatArray = NDArray[np.float64]

PLANE = 2
"""Coordinates of a game whose paths can be drawn."""

SETTLED = 0.02
"""Part of a signal's range within which it counts as settled."""

SHORT_TRANSIENT = 0.2
"""Part of the run below which the transient is enlarged in an inset."""

SMALLEST_INSET = 0.25
"""Least height of the inset, as a part of the axes."""

EQUILIBRIUM, EARLIER = "0.45", "0.6"

SMALLEST_ERROR = 1e-17
"""Errors below are drawn at it: a logarithmic axis has no 0."""

BELOW_FLOOR = 1e-2
"""Part of the integrator's tolerance at which a logarithmic axis ends."""

CREATOR = "mixed-order-game"
"""What the files say of themselves, so that they are known again."""


def plot_positions(result: "Result", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """Actions x_il over time, one line each, and their equilibrium as thin lines. width in inches.

    The equilibrium is that of each time, with steps where costs change. Raises ResultError if x was not
    recorded.
    """
    with paper_style():
        axes = axes or new_axes(width)
        _lines(axes, result, "x")
        levels = np.round(result.equilibria.reshape(len(result.time), -1), 12)
        for level in np.unique(levels, axis=1).T:
            axes.plot(result.time, level, color=EQUILIBRIUM, linewidth=0.6, zorder=1, drawstyle="steps-pre")
        _over_time(axes, "action $x_{il}$" + _unit(result, "x"))
        _inset(axes, result, "x")
        _legend(axes, range(result.players), result, equilibrium=True)
    return axes


def plot_velocities(result: "Result", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """Velocities v_il of the second-order players over time, one line each. width in inches.

    Raises PlotError if no player has order 2, ResultError if v was not recorded.
    """
    players = _second_order(result)
    if not players:
        raise PlotError("no player of this game has a velocity: all have order 1")
    with paper_style():
        axes = axes or new_axes(width)
        _lines(axes, result, "v")
        _over_time(axes, "velocity $v_{il}$" + _unit(result, "v", otherwise="1/s"))
        _inset(axes, result, "v")
        _legend(axes, players, result, equilibrium=False)
    return axes


def plot_error(
    results: "Result | Mapping[str, Result]", axes: Axes | None = None, *, width: float = COLUMN_WIDTH
) -> Axes:
    """Distance to the equilibrium, |x - x*|_2, on a logarithmic axis; one line a labelled result.

    Shaded in a line's colour is what lies within the integrator's tolerance, where that line goes there.
    Raises ResultError if nash_error was not recorded.
    """
    labelled = {"": results} if not isinstance(results, Mapping) else results
    floors: dict[float, Any] = {}
    with paper_style():
        axes = axes or new_axes(width)
        for (label, result), colour in zip(labelled.items(), colours(len(labelled)), strict=True):
            axes.plot(result.time, np.maximum(result.nash_error, SMALLEST_ERROR), color=colour, label=label)
            floor = integrator_floor(result)
            if result.nash_error.min() < floor:
                floors[floor] = EQUILIBRIUM if floor in floors else colour
        axes.set_yscale("log")
        if floors:
            bottom = BELOW_FLOOR * min(floors)
            axes.set_ylim(bottom=bottom)
            for floor, colour in floors.items():
                axes.axhspan(
                    bottom, floor, color=colour, alpha=0.15, linewidth=0.0, label="integrator's tolerance"
                )
        first = next(iter(labelled.values()))
        _over_time(axes, r"error $\Vert x - x^*\Vert_2$" + _unit(first, "x"))
        handles, labels = axes.get_legend_handles_labels()
        named = [k for k, label in enumerate(labels) if label]
        if named:
            columns = 1 if width < TWO_COLUMNS else len(named)
            legend_above(axes, [handles[k] for k in named], [labels[k] for k in named], columns=columns)
    return axes


def integrator_floor(result: "Result") -> float:
    """2-norm of what the integrator's tolerance allows as error of actions at x*; NaN if it is unknown."""
    relative = float(result.parameters.get("tolerance_relative") or result.tolerance)
    absolute = float(result.parameters.get("tolerance_absolute") or 0.01 * relative)
    if np.isnan(relative):
        return float("nan")
    return float(np.linalg.norm(relative * np.abs(result.equilibria) + absolute, axis=(1, 2)).max())


def plot_plane(
    result: "Result",
    axes: Axes | None = None,
    *,
    edges: Iterable[tuple[int, int, float]] | None = None,
    width: float = COLUMN_WIDTH,
) -> Axes:
    """Paths of the players in the plane (D = 2), with the communication graph between their starts.

    Where costs change, the equilibria before the last one are drawn too, in grey.
    Arrows show who is heard by whom where the graph is directed.
    edges: (i, j, weight), 1-based; by default those among the result's parameters, none if it has no
    parameters. width in inches. Raises PlotError unless D = 2, ResultError if x was not recorded.
    """
    if result.dimension != PLANE:
        raise PlotError(f"paths are drawn in the plane: the game has {result.dimension} coordinates, not 2")
    x = result.x
    palette = colours(result.players)
    directed = is_directed(result)
    with paper_style():
        axes = axes or new_axes(width, height=0.95 * width)
        for i, j, weight in edges_of(result) if edges is None else edges:
            ends = x[0, [i - 1, j - 1]]
            width_of_edge = 0.8 * np.sqrt(weight)
            axes.plot(*ends.T, color="0.75", linewidth=width_of_edge, zorder=1, gid="edge")
            if directed:
                axes.annotate(
                    "",
                    ends.mean(axis=0) + 0.01 * (ends[1] - ends[0]),
                    ends.mean(axis=0),
                    arrowprops={"arrowstyle": "->", "color": "0.6", "linewidth": width_of_edge},
                    zorder=2,
                )
        for i, colour in enumerate(palette):
            axes.plot(*x[:, i].T, color=colour, label=str(i + 1), gid="path")
            axes.plot(*x[0, i], color=colour, marker="o", markersize=9.0, linestyle="none", zorder=3)
            if result.players <= LARGEST_LEGEND:
                axes.annotate(
                    str(i + 1),
                    (x[0, i, 0], x[0, i, 1]),
                    color="white",
                    fontsize=6.5,
                    ha="center",
                    va="center",
                    zorder=4,
                )
        earlier = earlier_equilibria(result)
        for points, colour in ((earlier, EARLIER), (result.x_star, "black")):
            axes.plot(*points.T, color=colour, marker="x", markersize=5.0, linestyle="none", zorder=5)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("$x_{i1}$" + _unit(result, "x"))
        axes.set_ylabel("$x_{i2}$" + _unit(result, "x"))
        keys = {
            "start of player $i$": Line2D([], [], color="0.3", marker="o", markersize=6.0, linestyle="none"),
            "path": Line2D([], [], color="0.3"),
            "communication": Line2D([], [], color="0.75", linewidth=0.8),
            "equilibrium": Line2D([], [], color="black", marker="x", markersize=5.0, linestyle="none"),
            "equilibrium before": Line2D([], [], color=EARLIER, marker="x", markersize=5.0, linestyle="none"),
        }
        if not len(earlier):
            del keys["equilibrium before"]
        if not any(line.get_gid() == "edge" for line in axes.lines):
            del keys["communication"]
        legend_above(axes, list(keys.values()), list(keys), columns=2 if width < TWO_COLUMNS else len(keys))
    return axes


KINDS: Mapping[str, Callable[..., Axes]] = {
    "positions": plot_positions,
    "velocities": plot_velocities,
    "error": plot_error,
    "plane": plot_plane,
    "graph": graph_of_result,
}
"""Figures of one run by the names of their files."""


def draw(result: "Result", kind: str, axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """One figure of a run, of a kind in KINDS. Raises PlotError for another one, and as the figure does."""
    if kind not in KINDS:
        raise PlotError(f"there is no figure {kind}: it is one of {', '.join(KINDS)}")
    return KINDS[kind](result, axes, width=width)


def paper_figure_names(model: Model) -> list[str]:
    """Names of the files that paper_figures draws for a game."""
    runs = ("robust", "unperturbed")
    kinds = ("positions", "velocities") if SECOND_ORDER in model.order else ("positions",)
    names = [f"{kind}_{run}" for run in runs for kind in kinds]
    return [*names, "error", *(["plane"] if model.dimension == PLANE else [])]


def paper_figures(robust: "Result", plain: "Result", *, width: float = COLUMN_WIDTH) -> dict[str, Axes]:
    """The paper's four figures by file name, then the error of both runs and, for D = 2, the robust paths.

    robust: a run with the robust part and the perturbations; plain: one with neither. The figures of
    velocities are left out if all players have order 1.
    """
    figures: dict[str, Callable[[], Axes]] = {"positions_robust": lambda: plot_positions(robust, width=width)}
    if _second_order(robust):
        figures["velocities_robust"] = lambda: plot_velocities(robust, width=width)
    figures["positions_unperturbed"] = lambda: plot_positions(plain, width=width)
    if _second_order(plain):
        figures["velocities_unperturbed"] = lambda: plot_velocities(plain, width=width)
    runs = {"robust, perturbed": robust, "neither": plain}
    figures["error"] = lambda: plot_error(runs, width=width)
    if robust.dimension == PLANE:
        figures["plane"] = lambda: plot_plane(robust, width=width)
    return {name: draw() for name, draw in figures.items()}


def result_figures(result: "Result", *, width: float = COLUMN_WIDTH) -> dict[str, Axes]:
    """Every figure that one result allows, by file name. Raises ResultError if it allows none."""
    recorded = {parse_name(name)[0] for name in result.columns}
    figures = {}
    if "x" in recorded:
        figures["positions"] = plot_positions(result, width=width)
    if "v" in recorded:
        figures["velocities"] = plot_velocities(result, width=width)
    if "nash_error" in recorded:
        figures["error"] = plot_error(result, width=width)
    if "x" in recorded and result.dimension == PLANE:
        figures["plane"] = plot_plane(result, width=width)
    if not figures:
        raise ResultError("there is nothing to draw: none of x, v and nash_error was recorded")
    return figures


def save_figure(axes: Axes, path: Path | str, *, force: bool = False) -> Path:
    """Write the figure of these axes as .pdf, .svg or .png; equal figures give equal bytes. Returns the path.

    Replaces a figure of this package, with force any file. Raises PlotError for another suffix, ResultError
    if the file cannot be written or is not replaced.
    """
    path = Path(path)
    if not FIGURE.takes(path):
        raise PlotError(f"{path} must end in {FIGURE.ending}")
    suffix = suffix_of(path)
    metadata = {
        ".pdf": {"Creator": CREATOR, "CreationDate": None},
        ".svg": {"Creator": CREATOR, "Date": None},
        ".png": {"Software": CREATOR},
    }
    figure = axes.get_figure(root=True)
    if figure is None:
        raise PlotError("these axes belong to no figure")

    def write(file: IO[bytes]) -> None:
        with paper_style():
            figure.savefig(
                file,
                format=suffix[1:],
                bbox_inches="tight",
                pad_inches=0.02,
                metadata=metadata[suffix],
            )

    return write_file(path, FIGURE, write, force=force)


def earlier_equilibria(result: "Result", players: int | None = None) -> FloatArray:
    """Equilibria of the first players, or of all, that costs changed on the way left behind, (K, D)."""
    points = np.round(result.equilibria[:, :players], 12)
    return np.unique(points[np.any(points != points[-1], axis=2)], axis=0)


def _second_order(result: "Result") -> list[int]:
    """Players with a velocity, 0-based."""
    return [i for i in range(result.players) if not np.isnan(result.v[:, i]).all()]


def _lines(axes: Axes, result: "Result", stem: str) -> None:
    values: FloatArray = getattr(result, stem)
    for i, colour in enumerate(colours(result.players)):
        for coordinate in range(result.dimension):
            if not np.isnan(values[:, i, coordinate]).all():
                style = LINE_STYLES[coordinate % len(LINE_STYLES)]
                label = f"{stem}[{i + 1},{coordinate + 1}]"
                axes.plot(result.time, values[:, i, coordinate], color=colour, linestyle=style, label=label)


def _inset(axes: Axes, result: "Result", stem: str) -> None:
    """Enlarge a short transient in the half above or below the settled lines, if that is free."""
    values = getattr(result, stem)
    span = float(np.nanmax(values) - np.nanmin(values))
    moving = np.flatnonzero(np.nanmax(np.abs(values - values[-1]), axis=(1, 2)) > SETTLED * span)
    if span == 0.0 or not moving.size:
        return
    end = 1.2 * float(result.time[moving[-1]] - result.time[0])
    if end > SHORT_TRANSIENT * float(result.time[-1] - result.time[0]):
        return
    low, high = axes.get_ylim()
    after = (values[result.time >= result.time[0] + end] - low) / (high - low)
    bottom, top = float(np.nanmin(after)), float(np.nanmax(after))
    above, below = (top + 0.16, 1.0), (0.14, bottom - 0.04)  # tick labels stand below the inset
    begin, stop = max(above, below, key=lambda part: part[1] - part[0])
    if stop - begin < SMALLEST_INSET:
        return
    inset = axes.inset_axes((0.36, begin, 0.62, stop - begin))
    inset.patch.set_alpha(0.9)
    _lines(inset, result, stem)
    inset.set_xlim(result.time[0], result.time[0] + end)
    inset.tick_params(labelsize=6.0)
    inset.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    inset.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))


def _over_time(axes: Axes, label: str) -> None:
    axes.set_xlabel("time (s)")
    axes.set_ylabel(label)
    axes.margins(x=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))


def _unit(result: "Result", stem: str, otherwise: str = "") -> str:
    """The unit of a signal in brackets; nothing for a dimensionless one."""
    found = (unit for name, unit in result.units.items() if parse_name(name)[0] == stem)
    unit = next(found, otherwise)
    return f" ({unit})" if unit not in ("", "1") else ""


def _legend(axes: Axes, players: Iterable[int], result: "Result", *, equilibrium: bool) -> None:
    """Colour for the player, style for the coordinate, above the axes so that it covers no curve."""
    chosen = list(players)
    palette = colours(result.players)
    handles: list[Line2D] = []
    labels: list[str] = []
    if len(chosen) <= LARGEST_LEGEND:
        for i in chosen:
            handles.append(Line2D([], [], color=palette[i]))
            labels.append(f"$i={i + 1}$")
    for coordinate in range(min(result.dimension, len(LINE_STYLES)) if result.dimension > 1 else 0):
        handles.append(Line2D([], [], color="0.3", linestyle=LINE_STYLES[coordinate]))
        labels.append(f"$l={coordinate + 1}$")
    if equilibrium:
        handles.append(Line2D([], [], color=EQUILIBRIUM, linewidth=0.6))
        labels.append("$x^*$")
    legend_above(axes, handles, labels, columns=5 if width_of(axes) < TWO_COLUMNS else 12)
