"""The distance to the equilibrium over time, and below which size the integrator's tolerance hides it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import Normal, Stroke

from .keys import label_ends, unit_of
from .style import COLUMN_WIDTH, colours, legend_above, new_axes, paper_style
from .time_figures import SMALLEST, over_time

if TYPE_CHECKING:
    from .result import Result

BELOW_FLOOR = 1e-2
"""Part of the integrator's tolerance at which a logarithmic axis ends."""

SEVERAL_FLOORS = "0.45"

MOST_IN_LEGEND = 2
"""Most runs that a legend names; more are named at the ends of their lines."""


def plot_error(
    results: "Result | Mapping[str, Result]", axes: Axes | None = None, *, width: float = COLUMN_WIDTH
) -> Axes:
    """Distance to the equilibrium, |x - x*|_2, on a logarithmic axis; one line a labelled result.

    Shaded in a line's colour is what lies within the integrator's tolerance, where that line goes there.
    Raises ResultError if nash_error was not recorded.
    """
    labelled = {"": results} if not isinstance(results, Mapping) else results
    floors: dict[float, str] = {}
    with paper_style():
        axes = axes or new_axes(width)
        lines = []
        for (label, result), colour in zip(labelled.items(), colours(len(labelled)), strict=True):
            error = np.maximum(result.nash_error, SMALLEST)
            lines += axes.plot(result.time, error, color=colour, label=label)
            floor = integrator_floor(result)
            if result.nash_error.min() < floor:
                floors[floor] = SEVERAL_FLOORS if floor in floors else colour
        axes.set_yscale("log")
        over_time(axes, r"error $\Vert x - x^*\Vert_2$" + unit_of(next(iter(labelled.values())), "x"))
        handles = lines if any(labelled) and len(lines) <= MOST_IN_LEGEND else []
        names = list(labelled)
        if floors:
            bottom = BELOW_FLOOR * min(floors)
            axes.set_ylim(bottom=bottom)
            for floor, colour in floors.items():
                axes.axhspan(bottom, floor, color=colour, alpha=0.15, linewidth=0.0)
            axes.text(
                0.98,
                np.sqrt(bottom * max(floors)),
                "within the integrator's tolerance",
                transform=axes.get_yaxis_transform(),
                fontsize=6.5,
                color="0.35",
                ha="right",
                va="center",
                path_effects=[Stroke(linewidth=1.8, foreground="white"), Normal()],
            )
        if handles:
            legend_above(axes, handles, names, columns=len(names))
        if len(lines) > MOST_IN_LEGEND:
            label_ends(axes, lines, list(labelled))
    return axes


def integrator_floor(result: "Result") -> float:
    """2-norm of what the integrator's tolerance allows as error of actions at x*; NaN if it is unknown."""
    relative = float(result.parameters.get("tolerance_relative") or result.tolerance)
    absolute = float(result.parameters.get("tolerance_absolute") or 0.01 * relative)
    if np.isnan(relative):
        return float("nan")
    return float(np.linalg.norm(relative * np.abs(result.equilibria) + absolute, axis=(1, 2)).max())
