"""Figures of signals over time: actions, velocities, control, weights, estimates.

A transient that is short against the run is enlarged in an inset; the frame in the axes marks what it shows.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import NDArray

from ..errors import PlotError
from ..names import indices_of
from .keys import label_ends, player_key, unit_of
from .style import COLUMN_WIDTH, LINE_STYLES, PALETTE, colours, new_axes, paper_style

if TYPE_CHECKING:
    from .result import Result

FloatArray = NDArray[np.float64]

SETTLED = 0.02
"""Part of a signal's range within which it counts as settled."""

SHORT_TRANSIENT = 0.2
"""Part of the run below which the transient is enlarged in an inset."""

ENLARGED = "0.94"
"""Background of what an inset enlarges, there and in the axes."""

MOST_LABELS, FARTHEST = 20, 0.06
"""Most lines that are named at their ends, and how far a name may be from its line, a part of the axes."""

SMALLEST_INSET = 0.25
"""Least height of the inset, as a part of the axes."""

MOST_LEVELS = 12
"""Most equilibria that are drawn as lines; more are told by marks at the right edge."""

MANY_POINTS = 50_000
"""Points of all lines from which they are pixels in a vector file, which else takes megabytes."""

SOME_MARKS = 80
"""Marks at the right edge up to which they are triangles."""

FEW_LINES, SOME_LINES = 24, 120
"""Lines up to which they are drawn in full width, and in half of it."""

MOST_ESTIMATING = 12
"""Most players whose estimates, N^2 D signals, are recorded to be drawn."""

FAR_BELOW = 0.2
"""Part of W_max below which weights are drawn without the line of it, which would leave them no height."""

NO_VELOCITY = "no player of this game has a velocity: all have order 1"
"""Why a game has no figure of velocities."""

MOVED = 0.002
"""Part of the largest value by which one has moved when an axis of logarithmic time begins."""

FINE = 0.1
"""Part of the usual step below which the first one tells that the start was sampled finely."""

LEAST_DISAGREEMENT, LEAST_CONTROL = 1e-12, 1e-7
"""Parts of the largest value below which nothing is shown: rounding, and controls that pass through 0."""

SMALLEST = 1e-17
"""Values below are drawn at it: a logarithmic axis has no 0."""


def plot_positions(result: "Result", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """Actions x_il over time, one line each, and their equilibrium on top of them. width in inches.

    The equilibrium is that of each time, with steps where costs change; of many players marks at the right
    edge tell it. Raises ResultError if x was not recorded.
    """
    with paper_style():
        axes = axes or new_axes(width)
        draw_lines(axes, result, result.x, "x")
        references = _equilibria(axes, result)
        over_time(axes, "action $x_{il}$" + unit_of(result, "x"))
        _show_transient(axes, result, result.x, "x")
        player_key(axes, _named_in_key(axes, result), result, references)
    return axes


def plot_velocities(result: "Result", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """Velocities v_il of the second-order players over time, one line each. width in inches.

    Raises PlotError if no player has order 2, ResultError if v was not recorded.
    """
    players = second_order_players(result)
    if not players:
        raise PlotError(NO_VELOCITY)
    with paper_style():
        axes = axes or new_axes(width)
        draw_lines(axes, result, result.v, "v")
        over_time(axes, "velocity $v_{il}$" + unit_of(result, "v", otherwise="1/s"))
        _show_transient(axes, result, result.v, "v")
        player_key(axes, players, result)
    return axes


def plot_control(result: "Result", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """Size |u_i| of every player's control over time, both logarithmic where the start was sampled finely.

    width in inches. Raises ResultError if u was not recorded.
    """
    with paper_style():
        axes = axes or new_axes(width)
        sizes = np.linalg.norm(result.u, axis=2, keepdims=True)
        draw_lines(axes, result, sizes, "u")
        _logarithmic_size(axes, sizes, LEAST_CONTROL)
        over_time(axes, r"control $\Vert u_i\Vert_2$" + unit_of(result, "u"))
        logarithmic_time(axes, result, sizes)
        player_key(axes, range(result.players), result, dimension=1)
    return axes


def plot_weights(result: "Result", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """Squared norms w'w of the weight columns over time, and their bound W_max where it is one for all.

    width in inches. Raises ResultError if W_norm2 was not recorded.
    """
    with paper_style():
        axes = axes or new_axes(width)
        draw_lines(axes, result, result.W_norm2, "W_norm2")
        over_time(axes, "weight column $w'w$" + unit_of(result, "W_norm2"))
        bound = result.parameters.get("W_max")
        references = []
        if bound is not None and np.nanmax(result.W_norm2) < FAR_BELOW * bound:
            nothing = Line2D([], [], linestyle="none")
            references.append((nothing, rf"$W_{{\max}} = {bound:g}$ lies above"))
        elif bound is not None:
            line = axes.axhline(float(bound), color="black", linewidth=0.8, linestyle=(0, (1, 1)), zorder=4)
            references.append((line, r"$W_{\max}$"))
        axes.set_ylim(bottom=0.0)
        logarithmic_time(axes, result, result.W_norm2)
        player_key(axes, range(result.players), result, references)
    return axes


def plot_estimates(result: "Result", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """How far the others' estimates of each player are from what it shares, over time; width in inches.

    The largest |y_ijl - xbar_jl| over i and l, a line for each j; of runs that did not record y the 2-norm of
    all, consensus_error. Raises ResultError if neither was recorded.
    """
    with paper_style():
        axes = axes or new_axes(width)
        if indices_of(result.columns, "y"):
            off = np.abs(result.y - result.xbar[:, np.newaxis]).max(axis=(1, 3))
            values = off[:, :, np.newaxis]
            draw_lines(axes, result, values, "y")
            over_time(axes, r"$\max_{i,l}\,|y_{ijl} - \bar{x}_{jl}|$" + unit_of(result, "y"))
            player_key(axes, range(result.players), result, dimension=1, letter="j")
        else:
            values = result["consensus_error"]
            axes.plot(result.time, values, color=colours(1)[0])
            over_time(axes, r"disagreement $\Vert y - \bar{x}\Vert_2$" + unit_of(result, "y"))
        _logarithmic_size(axes, values, LEAST_DISAGREEMENT)
        logarithmic_time(axes, result, values)
    return axes


def second_order_players(result: "Result") -> list[int]:
    """Players with a velocity, 0-based."""
    return [i for i in range(result.players) if not np.isnan(result.v[:, i]).all()]


def draw_lines(axes: Axes, result: "Result", values: FloatArray, stem: str) -> None:
    """One line for each player and coordinate of values (T, N, D); what is NaN has none."""
    known = np.asarray(~np.isnan(values).all(axis=0))
    count = int(known.sum())
    linewidth = 1.0 if count <= FEW_LINES else 0.6 if count <= SOME_LINES else 0.35
    for i, colour in enumerate(colours(result.players)):
        for coordinate in np.flatnonzero(known[i]).tolist():
            axes.plot(
                result.time,
                values[:, i, coordinate],
                color=colour,
                linestyle=LINE_STYLES[coordinate % len(LINE_STYLES)],
                linewidth=linewidth,
                label=f"{stem}[{i + 1},{coordinate + 1}]",
                rasterized=count * len(result.time) > MANY_POINTS,
            )


def over_time(axes: Axes, label: str) -> None:
    """Names of the axes, and times that are round."""
    axes.set_xlabel("time (s)")
    axes.set_ylabel(label)
    axes.margins(x=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))


def _logarithmic_size(axes: Axes, values: FloatArray, least: float) -> None:
    """A logarithmic axis of values >= 0, down to the smallest or to a part of the largest."""
    positive = values[values > 0.0]
    if positive.size:
        axes.set_yscale("log", nonpositive="mask")
        axes.set_ylim(bottom=0.7 * max(float(positive.min()), least * float(positive.max())))


def logarithmic_time(axes: Axes, result: "Result", values: FloatArray) -> None:
    """A logarithmic axis of time where samples resolve it, from when values (T, ...) begin to move."""
    steps = np.diff(result.time)
    if not (len(steps) and steps[0] < FINE * np.median(steps) and result.time[0] == 0.0):
        return
    flat = values.reshape(len(values), -1)
    moved = np.abs(flat - flat[0]).max(axis=1) > MOVED * np.nanmax(np.abs(flat))
    first = max(1, int(np.argmax(moved)))
    axes.set_xscale("log")
    axes.set_xlim(float(result.time[first]), float(result.time[-1]))
    axes.xaxis.set_major_locator(LogLocator(numticks=8))


def _equilibria(axes: Axes, result: "Result") -> list[tuple[Line2D, str]]:
    """Draw x* last, in its player's colour or black where several share it; returns what the legend tells."""
    levels = np.round(result.equilibria.reshape(len(result.time), -1), 12)
    owners = np.repeat(np.arange(result.players), result.dimension).tolist()
    distinct, members = np.unique(levels, axis=1, return_inverse=True)
    palette = colours(result.players)
    if distinct.shape[1] > MOST_LEVELS:
        # triangles that point left, from outside the axes; of very many players short lines
        look: dict[str, Any] = {"marker": 4, "markersize": 4.0, "linestyle": "none"}
        edge: dict[str, Any] = {"markeredgecolor": "black", "markeredgewidth": 0.25}
        if len(owners) > SOME_MARKS:
            look, edge = look | {"marker": 1, "markeredgewidth": 0.6}, {}
        across = axes.get_yaxis_transform()
        for level, i in zip(levels[-1], owners, strict=True):
            mark = look | edge | {"color": palette[i], "clip_on": False, "zorder": 6}
            axes.plot([1.0], [level], transform=across, **mark)
        return [(Line2D([], [], color="0.3", **look), "$x^*$ at the end")]
    for k, level in enumerate(distinct.T):
        whose = {owner for owner, member in zip(owners, members.ravel(), strict=True) if member == k}
        axes.plot(
            result.time,
            level,
            color=palette[whose.pop()] if len(whose) == 1 else "black",
            linewidth=0.8,
            linestyle=(0, (1, 1)),
            drawstyle="steps-pre",
            path_effects=[Stroke(linewidth=1.8, foreground="white"), Normal()],
            zorder=5,
        )
    return [(Line2D([], [], color="black", linewidth=0.8, linestyle=(0, (1, 1))), "$x^*$")]


def _named_in_key(axes: Axes, result: "Result") -> range:
    """Players that the key has to name, 0-based: none if every line can be named at its end."""
    players = range(result.players)
    if result.dimension > 1 or len(players) > MOST_LABELS:
        return players
    labels = [f"$i={i + 1}$" if len(players) <= len(PALETTE) else str(i + 1) for i in players]
    return range(0) if label_ends(axes, axes.lines[: len(players)], labels, farthest=FARTHEST) else players


def _show_transient(axes: Axes, result: "Result", values: FloatArray, stem: str) -> None:
    """Enlarge a transient that is short against the run; without room for that, let time be logarithmic."""
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
        logarithmic_time(axes, result, values)
        return
    inset = axes.inset_axes((0.3, begin, 0.69, stop - begin))
    draw_lines(inset, result, values, stem)
    inset.set_xlim(result.time[0], result.time[0] + end)
    inset.tick_params(labelsize=6.0)
    inset.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    inset.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
    for marked in (axes, inset):  # the band of time that the inset shows
        marked.axvspan(result.time[0], result.time[0] + end, color=ENLARGED, linewidth=0.0, zorder=0)
