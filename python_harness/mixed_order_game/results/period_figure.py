"""The error that a period leaves, over the periods at which players talk."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from .style import COLUMN_WIDTH, PALETTE, legend_above, new_axes, paper_style

if TYPE_CHECKING:
    from ..studies.periods import Periods

GREY = "0.45"


def plot_periods(found: "Periods", axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """Largest |x_il - x*_il| in the last fifth over the period, on logarithmic axes.

    Crosses are runs that grow; those that an FMU gave up stand at the upper edge. Levels are the whole game's
    error and the period below which the loop of Theorem 2 is stable.
    """
    periods = np.array([run.period for run in found.runs])
    errors = np.array([run.final_error for run in found.runs])
    grows = np.array([run.verdict == "grows" for run in found.runs])
    known = np.isfinite(errors)
    shown = np.where(known, errors, 10.0 * max(errors[known], default=1.0))
    with paper_style():
        axes = axes or new_axes(width)
        handles = [axes.axhline(found.whole_error, color=GREY, linestyle="--")]
        labels = ["whole game"]
        limit = found.unperturbed_limit
        if limit is not None and 0.0 < limit < np.inf:
            handles.append(axes.axvline(limit, color=GREY, linestyle=":"))
            labels.append("limit, unperturbed")
        axes.plot(periods, shown, color=PALETTE[0])
        for chosen, marker, label in ((~grows, "o", "survived"), (grows, "x", "grows")):
            if chosen.any():
                handles += axes.plot(
                    periods[chosen],
                    shown[chosen],
                    marker,
                    color=PALETTE[0 if marker == "o" else 1],
                    markersize=4,
                )
                labels.append(label)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("period at which players talk (s)")
        axes.set_ylabel(r"largest $|x - x^*|$ at the end")
        legend_above(axes, handles, labels, columns=2)
    return axes
