"""The command `mog demo`: parses options and prints."""

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_game
from .options import FigureFormat, ForceOption, JsonOption
from .progress import progress_by_name
from .validate import show_validation


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for results and figures.")] = Path(
        "demo"
    ),
    fmu: Annotated[
        Path | None,
        typer.Option(
            help="The FMU or game to use; the paper's example when left out.",
            show_default=False,
            autocompletion=complete_game,
        ),
    ] = None,
    file_format: Annotated[
        FigureFormat, typer.Option("--format", case_sensitive=False, help="File format.")
    ] = FigureFormat.PNG,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate the paper's example, judge each claim, print the verdict and write results and figures.

    [bold]Example:[/bold] mog demo --output demo
    """
    from ..extras import has, install
    from ..fmu.build import fmu_of
    from ..studies.demo import demo as demonstrate

    path = fmu_of(fmu)
    with progress_by_name() as show:
        done = demonstrate(path, output, suffix=f".{file_format.value}", force=force, progress=show)
    for file in done.files:
        typer.echo(file, err=as_json)
    if not has("matplotlib"):
        typer.echo(f"mog: no figures without matplotlib: {install('matplotlib')}", err=True)
    show_validation(done.validation, as_json=as_json, strict=False)
