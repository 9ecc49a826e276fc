"""The command `mog periods`: parses options and prints."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import (
    ForceOption,
    GameArgument,
    JsonOption,
    SettingsOption,
    StopTimeOption,
    ToleranceOption,
    output_option,
    players_of_text,
    settings_of,
)
from .progress import counted_progress

if TYPE_CHECKING:
    from ..studies.periods import Periods


def periods(
    game: GameArgument = None,
    period: Annotated[
        list[float] | None,
        typer.Option(
            "--period",
            metavar="SECONDS",
            help="Time between two exchanges in s; repeatable.",
            show_default="0.005 to 0.2",
        ),
    ] = None,
    group: Annotated[
        list[str] | None,
        typer.Option(
            "--group",
            metavar="PLAYERS",
            help="Players of one part, as in 1,2; one part a player without it.",
            show_default=False,
        ),
    ] = None,
    search: Annotated[
        bool, typer.Option("--search", help="Seek the longest period that is survived, to 1 %.")
    ] = False,
    settings: SettingsOption = None,
    stop_time: StopTimeOption = None,
    tolerance: ToleranceOption = None,
    figure: Annotated[
        Path | None,
        typer.Option(help="Draw the errors over the periods (.pdf, .svg, .png).", show_default=False),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Let the players talk once a period: which periods a game survives, and what error they leave.

    Each part is an FMU of its own. All take a step of one period, then hear the others: what is heard is one
    period old.

    [bold]Examples:[/bold]

    mog periods --period 0.02 --period 0.05 --period 0.2 --search

    mog periods my_game.toml --group 1,2 --group 3,4,5 --figure periods.pdf
    """
    from ..extras import need
    from ..files.writing import FIGURE
    from ..studies.periods import PERIODS
    from ..studies.periods import periods as run_periods

    if figure is not None:
        need("matplotlib")
        output_option(figure, FIGURE, inputs=[game], force=force, hint="--figure")
    with counted_progress("coupling") as show:
        found = run_periods(
            game,
            period or PERIODS,
            groups=[players_of_text(each, "--group") for each in group] if group else None,
            start_values=settings_of(settings or []),
            stop_time=stop_time,
            tolerance=tolerance,
            search=search,
            progress=show,
        )
    if as_json:
        typer.echo(json.dumps(found.as_json(), indent=2))
    else:
        _print(found)
    if figure is not None:
        from ..results.plot import save_figure

        typer.echo(save_figure(found.plot(), figure, force=force), err=as_json)


def _print(found: "Periods") -> None:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    from .printing import show, standard_output

    console = standard_output()
    table = Table("period (s)", "verdict", "final error", "difference from the whole", box=SIMPLE_HEAD)
    for run in found.runs:
        table.add_row(f"{run.period:g}", run.verdict, f"{run.final_error:.3g}", f"{run.difference:.3g}")
    show(table, console)
    for note in found.notes:
        console.print(Text(note))
    for run in found.runs:
        if run.error:
            console.print(Text(f"{run.period:g} s: {run.error}"))
