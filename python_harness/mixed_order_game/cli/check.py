"""The command `mog check`: parses options and prints."""

from pathlib import Path
from typing import Annotated

import typer


def check(
    games: Annotated[list[Path], typer.Argument(help="Game files (.toml).", show_default=False)],
) -> None:
    """Check game files: tell problems with their lines, exit code 1 if there is one.

    [bold]Example:[/bold] mog check my_game.toml
    """
    from ..errors import GameError
    from ..extras import has, install
    from ..game.check import check_game
    from ..game.equilibrium import Kind, judge_equilibrium

    broken = False
    for game in games:
        try:
            problems = check_game(game)
        except GameError as error:
            typer.echo(f"mog: {error}", err=True)
            broken = True
            continue
        for problem in problems:
            typer.echo(f"{game}:{problem.line}:{problem.column}: {problem.sentence}", err=True)
        if not problems:
            equilibrium = judge_equilibrium(game)
            if equilibrium is None:
                typer.echo(f"{game} is valid")
                continue
            local = f"; {equilibrium.sentence.removesuffix('.')}" if equilibrium.kind is Kind.LOCAL else ""
            typer.echo(f"{game} is valid{local}")
            for warning in equilibrium.warnings:
                typer.echo(f"{game}: warning: {warning}", err=True)
        broken = broken or bool(problems)
    if broken:
        if not has("jsonschema"):
            typer.echo(
                f"mog: only the first problem of each file; for all: {install('jsonschema')}", err=True
            )
        raise typer.Exit(1)
