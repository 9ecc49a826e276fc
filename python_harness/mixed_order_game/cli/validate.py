"""The command `mog validate`: parses options and prints."""

import json
import math
from typing import TYPE_CHECKING, Annotated

import typer

from .options import GameArgument, JsonOption
from .progress import progress_by_name

if TYPE_CHECKING:
    from ..studies.validate import Validation


def validate(
    game: GameArgument = None,
    limit: Annotated[
        float | None,
        typer.Option(
            help="Longest simulated time in s in which the robust run may settle.", show_default="1000"
        ),
    ] = None,
    neighbourhood: Annotated[
        float | None,
        typer.Option(help="Largest |x - x*| wanted once settled: one more claim.", show_default=False),
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 1 unless every claim holds.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Judge the paper's claims on a game; exit with 1 if one fails.

    A claim holds, fails, is not covered (its premises are not met) or is not settled (within the limit).

    [bold]Example:[/bold] mog validate my_game.toml --neighbourhood 0.01 --limit 200 --strict
    """
    from ..fmu.build import fmu_of
    from ..studies.validate import LIMIT
    from ..studies.validate import validate as judge

    for name, value in (("--limit", limit), ("--neighbourhood", neighbourhood)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise typer.BadParameter("expected a positive number", param_hint=name)
    fmu = fmu_of(game)
    with progress_by_name() as show:
        verdict = judge(
            fmu, limit=LIMIT if limit is None else limit, neighbourhood=neighbourhood, progress=show
        )
    show_validation(verdict, as_json=as_json, strict=strict)


def show_validation(validation: "Validation", *, as_json: bool, strict: bool) -> None:
    """Print the verdicts; exit with 1 if one asks for it."""
    from .tables import print_validation

    if as_json:
        typer.echo(json.dumps(validation.as_json(), indent=2))
    else:
        print_validation(validation)
    problem = validation.problem(strict=strict)
    if problem:
        typer.echo(f"mog: {problem}", err=True)
        raise typer.Exit(1)
