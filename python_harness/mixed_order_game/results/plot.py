"""Figures of a run: over time, in the plane, and of its communication graph.

Every function draws into the axes given, or into a figure of its own, and returns the axes; save_figure
writes it. Colour tells the player (Okabe and Ito's palette, safe for colour-blind readers; viridis for more
than eight), line style the coordinate.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING

from matplotlib.axes import Axes

from ..errors import PlotError, ResultError
from ..files.reading import suffix_of
from ..files.writing import FIGURE, write_file
from ..fmu.model import Model
from .error_figure import plot_error
from .graph_figure import SECOND_ORDER, graph_of_result, plot_graph
from .plane_figure import PLANE, no_plane, plot_plane
from .style import COLUMN_WIDTH, PAGE_WIDTH, new_axes, paper_style
from .time_figures import (
    NO_VELOCITY,
    plot_control,
    plot_estimates,
    plot_positions,
    plot_velocities,
    plot_weights,
    second_order_players,
)

if TYPE_CHECKING:
    from .result import Result

__all__ = [
    "COLUMN_WIDTH",
    "KINDS",
    "PAGE_WIDTH",
    "cut",
    "draw",
    "graph_of_result",
    "new_axes",
    "paper_figures",
    "paper_style",
    "plot_control",
    "plot_error",
    "plot_estimates",
    "plot_graph",
    "plot_plane",
    "plot_positions",
    "plot_velocities",
    "plot_weights",
    "result_figures",
    "save_figure",
]

CREATOR = "mixed-order-game"
"""What the files say of themselves, so that they are known again."""

KINDS: Mapping[str, Callable[..., Axes]] = {
    "positions": plot_positions,
    "velocities": plot_velocities,
    "error": plot_error,
    "plane": plot_plane,
    "graph": graph_of_result,
    "control": plot_control,
    "weights": plot_weights,
    "estimates": plot_estimates,
}
"""Figures of one run by the names of their files."""


PAPER_KINDS = ("positions", "velocities", "error", "plane")
"""Figures that show what the paper shows."""


def draw(result: "Result", kind: str, axes: Axes | None = None, *, width: float = COLUMN_WIDTH) -> Axes:
    """One figure of a run, of a kind in KINDS. Raises PlotError for another one, and as the figure does."""
    if kind not in KINDS:
        raise PlotError(f"there is no figure {kind}: it is one of {', '.join(KINDS)}")
    return KINDS[kind](result, axes, width=width)


def cut(result: "Result", until: float) -> "Result":
    """The run up to a time in s. Raises PlotError if that leaves no two samples."""
    kept = result.time <= until
    if kept.sum() < 2:  # noqa: PLR2004 - a line needs two
        raise PlotError(f"there is nothing to draw until {until:g} s")
    columns = {name: column[kept] for name, column in result.columns.items()}
    return replace(result, time=result.time[kept], columns=columns)


def paper_figure_names(model: Model, kinds: Sequence[str] = PAPER_KINDS) -> list[str]:
    """Names of the files that paper_figures draws for a game."""
    return [name for kind in dict.fromkeys(kinds) if not why_none(model, kind) for name in _files_of(kind)]


def why_none(model: Model, kind: str) -> str:
    """Why a game has no figure of a kind; empty if it has one."""
    if kind == "velocities" and SECOND_ORDER not in model.order:
        return NO_VELOCITY
    return no_plane(model.dimension) if kind == "plane" and model.dimension != PLANE else ""


def _files_of(kind: str) -> list[str]:
    """Files of a kind: of actions and velocities the paper has two, of the robust and of the other run."""
    return [f"{kind}_robust", f"{kind}_unperturbed"] if kind in ("positions", "velocities") else [kind]


def paper_figures(
    robust: "Result", plain: "Result", kinds: Sequence[str] = PAPER_KINDS, *, width: float = COLUMN_WIDTH
) -> dict[str, Axes]:
    """The paper's four figures by file name, then the error of both runs and others of the robust one.

    robust: a run with the robust part and the perturbations; plain: one with neither. Figures of velocities
    are left out if all players have order 1, paths unless D = 2.
    """
    left_out = {"velocities"} if not second_order_players(robust) else set()
    left_out |= {"plane"} if robust.dimension != PLANE else set()
    figures: dict[str, Axes] = {}
    for kind in kinds:
        if kind in left_out:
            continue
        if kind == "error":
            runs = {"robust, perturbed": robust, "neither": plain}
            figures["error"] = plot_error(runs, width=width)
            continue
        for name, run in zip(_files_of(kind), (robust, plain), strict=False):
            figures[name] = draw(run, kind, width=width)
    return figures


def result_figures(
    result: "Result", kinds: Sequence[str] | None = None, *, width: float = COLUMN_WIDTH
) -> dict[str, Axes]:
    """Figures of one result by file name: those of the kinds, by default all that it allows.

    Raises PlotError and ResultError as a figure asked for does, ResultError if nothing can be drawn.
    """
    if kinds is not None:
        return {kind: draw(result, kind, width=width) for kind in kinds}
    figures = {}
    for kind in KINDS:
        try:
            figures[kind] = draw(result, kind, width=width)
        except (PlotError, ResultError):  # another game has it, or another run recorded it
            continue
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
