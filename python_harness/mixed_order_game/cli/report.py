"""The command `mog report`: parses options and prints."""

from pathlib import Path
from typing import Annotated

import typer

from .options import ForceOption, output_option, settings_of


def report(
    source: Annotated[
        Path | None,
        typer.Argument(
            help="An FMU, a game file, a game of the package by name, or a result (.parquet, .csv); "
            "the paper's example when left out.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The page to write (.html).")] = Path(
        "report.html"
    ),
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Start value of a parameter; repeatable."),
    ] = None,
    stop_time: Annotated[
        float | None, typer.Option(help="End of the run in s.", show_default="FMU's")
    ] = None,
    claims: Annotated[
        bool,
        typer.Option(
            "--claims/--no-claims", help="Judge the paper's claims, which takes more and longer runs."
        ),
    ] = True,
    force: ForceOption = False,
) -> None:
    r"""Write one HTML page about a game or a run: interactive figures, claims, parameters, provenance.

    The page needs no network. It is written in any case; the exit code is 1 if a claim fails.

    [bold]Examples:[/bold]

    mog report my_game.toml --output my_game.html

    mog report --set k3=10 --set "a\[1,3]=1" --output weak_consensus.html

    mog run --output run.parquet
    mog report run.parquet
    """
    from ..files.writing import PAGE
    from ..reporting.page import report as write_report

    output_option(output, PAGE, inputs=[source], force=force)
    changes = settings_of(settings or [])
    done = write_report(
        source,
        output,
        changes=changes,
        claims=claims,
        stop_time=stop_time,
        force=force,
    )
    typer.echo(done.path)
    validation = done.evidence.validation
    problem = "" if validation is None else validation.problem()
    if problem:
        typer.echo(f"mog: {problem}", err=True)
        raise typer.Exit(1)
