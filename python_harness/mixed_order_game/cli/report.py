"""The command `mog report`: parses options and prints."""

import json
from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_source
from .options import ForceOption, JsonOption, SettingsOption, output_option, settings_of


def report(
    source: Annotated[
        Path | None,
        typer.Argument(
            help="An FMU, a game file, a game of the package by name, or a result (.parquet, .csv); "
            "the paper's example when left out.",
            show_default=False,
            autocompletion=complete_source,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The page to write (.html).")] = Path(
        "report.html"
    ),
    settings: SettingsOption = None,
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
    as_json: JsonOption = False,
) -> None:
    r"""Write one HTML page about a game or a run: interactive figures, claims, parameters, provenance.

    The page needs no network. It is written in any case; the exit code is 1 if a claim fails.

    [bold]Examples:[/bold]

    mog report my_game.toml --output my_game.html

    mog report --set k3=10 --set "a\[1,3]=1" --output weak_consensus.html

    mog report run.parquet --output run.html
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
    validation = done.evidence.validation
    if as_json:
        judged = None if validation is None else validation.as_json()
        typer.echo(json.dumps({"page": str(done.path), "validation": judged}, indent=2))
    else:
        typer.echo(done.path)
    problem = "" if validation is None else validation.problem()
    if problem:
        typer.echo(f"mog: {problem}", err=True)
        raise typer.Exit(1)
