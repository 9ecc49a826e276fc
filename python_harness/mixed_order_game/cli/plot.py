"""The command `mog plot`: parses options and prints."""

from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .completion import complete_kind, complete_source
from .options import FigureFormat, ForceOption, output_option

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class FigureWidth(StrEnum):
    """Widths of figures in a two-column paper."""

    COLUMN = "column"
    PAGE = "page"


def plot(
    source: Annotated[
        Path | None,
        typer.Argument(
            help="A result (.parquet, .csv), or what run takes; the paper's example when left out.",
            show_default=False,
            autocompletion=complete_source,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the figures.")] = Path("figures"),
    file_format: Annotated[
        FigureFormat, typer.Option("--format", case_sensitive=False, help="File format.")
    ] = FigureFormat.PDF,
    width: Annotated[
        FigureWidth, typer.Option(case_sensitive=False, help="Width in a two-column paper.")
    ] = FigureWidth.COLUMN,
    kinds: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            metavar="KIND",
            help="positions, velocities, error, plane, graph, control, weights or estimates; repeatable; "
            "all of them when left out.",
            autocompletion=complete_kind,
        ),
    ] = None,
    until: Annotated[
        float | None, typer.Option(help="Draw the run up to this time in s.", show_default="its end")
    ] = None,
    force: ForceOption = False,
) -> None:
    """Draw figures of a result, or of a game, which is run for them.

    Of a game these are the paper's four, from a robust, perturbed run and from one that is neither, and the
    other kinds from the first.

    [bold]Examples:[/bold]

    mog plot --output figures --format svg

    mog plot result.parquet --width page --kind positions --kind control --until 2
    """
    from ..extras import need
    from ..files.writing import FIGURE, RESULT

    need("matplotlib")
    from ..results.plot import COLUMN_WIDTH, KINDS, PAGE_WIDTH, cut, result_figures, save_figure
    from ..results.result import load

    inches = PAGE_WIDTH if width is FigureWidth.PAGE else COLUMN_WIDTH
    for kind in kinds or []:
        if kind not in KINDS:
            raise typer.BadParameter(f"{kind!r} is none of {', '.join(KINDS)}", param_hint="--kind")

    def judged(names: Iterable[str]) -> dict[str, Path]:
        paths = {name: output / f"{name}.{file_format.value}" for name in names}
        for path in paths.values():
            output_option(path, FIGURE, inputs=[source], force=force)
        return paths

    if source is not None and RESULT.takes(source):
        result = load(source)
        figures = result_figures(result if until is None else cut(result, until), kinds, width=inches)
        paths = judged(figures)
    else:
        figures, paths = _figures_of_game(source, kinds, until, inches, judged)
    for name, axes in figures.items():
        typer.echo(save_figure(axes, paths[name], force=force))


def _figures_of_game(
    source: Path | None,
    asked: Sequence[str] | None,
    until: float | None,
    width: float,
    judged: Callable[[Iterable[str]], dict[str, Path]],
) -> "tuple[dict[str, Axes], dict[str, Path]]":
    """Figures of a robust, perturbed run and of one that is neither, and their files, judged before both.

    Raises PlotError for a kind that is asked for and that the game does not have.
    """
    from ..errors import PlotError
    from ..fmu.build import SOURCE_OR_RESULT, fmu_of
    from ..fmu.run import Simulator
    from ..results.plot import KINDS, paper_figure_names, paper_figures, why_none
    from ..results.time_figures import MOST_ESTIMATING
    from ..studies.claims.tolerances import PLAIN_TOLERANCE, TOLERANCE

    with Simulator(fmu_of(source, SOURCE_OR_RESULT)) as simulator:
        model = simulator.model
        for lacking in filter(None, (why_none(model, kind) for kind in asked or ())):
            raise PlotError(lacking)
        kinds = asked or list(KINDS)
        paths = judged(paper_figure_names(model, kinds))
        robust, plain = (
            simulator.run(
                start_values={"robust": on, "perturbed": on},
                stop_time=model.stop_time if until is None else until,
                tolerance=tolerance,
                outputs=model.signals(estimates=on and model.players <= MOST_ESTIMATING),
                fine_start=True,
            )
            for on, tolerance in ((True, TOLERANCE), (False, PLAIN_TOLERANCE))
        )
    return paper_figures(robust, plain, kinds, width=width), paths
