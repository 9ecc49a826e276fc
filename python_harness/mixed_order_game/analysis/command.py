"""The command `mog analyse`: parses options and prints."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

HELP = "An FMU (.fmu), a game file (.toml) or the name of a shipped game; the paper's example when left out."


def analyse(
    game: Annotated[Path | None, typer.Argument(help=HELP, show_default=False)] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Start value of a parameter; repeatable."),
    ] = None,
    simulation: Annotated[  # noqa: FBT002 - the signature is the options
        bool, typer.Option("--simulation/--no-simulation", help="Compare the bounds with runs of the FMU.")
    ] = True,
    square: Annotated[  # noqa: FBT002
        bool,
        typer.Option("--square/--no-square", help="Keep or remove the square terms of the unknown dynamics."),
    ] = True,
    radius: Annotated[
        float, typer.Option(help="Distance to the equilibrium that the designed gains guarantee.")
    ] = 0.1,
    tables: Annotated[  # noqa: FBT002
        bool, typer.Option("--tables", help="Print every figure and hypothesis after the verdicts.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,  # noqa: FBT002
) -> None:
    """Tell whether the gains suit the graph: thresholds of the theorems, exact spectrum, guaranteed radius.

    Compares the theorems' bounds with the exact spectrum and with runs, names every hypothesis that fails,
    and seeks gains that meet them all.

    [bold]Examples:[/bold]

    mog analyse my_game.toml --no-simulation --json

    mog analyse --no-square --radius 0.01 --set k3=100
    """
    from ..sweeping.options import settings_of
    from .analysis import analyse as run_analysis
    from .rendering import print_analysis

    with _progress() as show:
        found = run_analysis(
            game,
            changes=settings_of(settings or []),
            simulation=simulation,
            square=square,
            radius=radius,
            progress=show,
        )
    if as_json:
        typer.echo(json.dumps(found.to_dict(), indent=2))
    else:
        print_analysis(found, tables=tables)


def register(app: typer.Typer) -> None:
    """Add the command to an application."""
    app.command()(analyse)


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """A spinner on stderr that names the step; nothing when stderr is not a terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _name, _part: None
        return
    with console.status("analysing", spinner="line") as status:
        yield lambda name, _part: status.update(name)
