"""The command `mog plot`: parses options and prints."""

from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_source
from .options import FigureFormat, ForceOption, output_option


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
    force: ForceOption = False,
) -> None:
    """Draw the figures of a result, or of a game the paper's four, the error and the paths in the plane.

    [bold]Examples:[/bold]

    mog plot --output figures --format svg

    mog plot result.parquet --width page
    """
    from ..files.writing import FIGURE, RESULT
    from ..fmu.build import SOURCE_OR_RESULT, fmu_of
    from ..fmu.run import Simulator
    from ..results.plot import (
        COLUMN_WIDTH,
        PAGE_WIDTH,
        paper_figure_names,
        paper_figures,
        result_figures,
        save_figure,
    )
    from ..results.result import load
    from ..studies.claims.tolerances import PLAIN_TOLERANCE, TOLERANCE

    inches = PAGE_WIDTH if width is FigureWidth.PAGE else COLUMN_WIDTH

    def judged(names: Iterable[str]) -> dict[str, Path]:
        paths = {name: output / f"{name}.{file_format.value}" for name in names}
        for path in paths.values():
            output_option(path, FIGURE, inputs=[source], force=force)
        return paths

    if source is not None and RESULT.takes(source):
        figures = result_figures(load(source), width=inches)
        paths = judged(figures)
    else:
        with Simulator(fmu_of(source, SOURCE_OR_RESULT)) as simulator:
            paths = judged(paper_figure_names(simulator.model))
            robust, plain = (
                simulator.run(
                    start_values={"robust": on, "perturbed": on},
                    stop_time=simulator.model.stop_time,
                    tolerance=tolerance,
                )
                for on, tolerance in ((True, TOLERANCE), (False, PLAIN_TOLERANCE))
            )
        figures = paper_figures(robust, plain, width=inches)
    for name, axes in figures.items():
        typer.echo(save_figure(axes, paths[name], force=force))
