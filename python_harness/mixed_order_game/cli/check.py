"""The command `mog check`: parses options and prints."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from .completion import complete_game_file
from .options import JsonOption
from .verbosity import note


def check(
    games: Annotated[
        list[Path],
        typer.Argument(help="Game files (.toml).", show_default=False, autocompletion=complete_game_file),
    ],
    as_json: JsonOption = False,
) -> None:
    """Check game files: tell problems with their lines; exit code 1 if there is one.

    [bold]Example:[/bold] mog check my_game.toml
    """
    from ..extras import has, install

    judged = [_judge(game) for game in games]
    if as_json:
        typer.echo(json.dumps(judged, indent=2))
    else:
        for each in judged:
            if each["valid"]:
                typer.echo(_told(each))
    if all(each["valid"] for each in judged):
        return
    if not has("jsonschema"):
        note(f"mog: only the first problem of each file; for all: {install('jsonschema')}")
    raise typer.Exit(1)


def _judge(game: Path) -> dict[str, Any]:
    """What is found of one file, as plain values for json.dumps; problems and warnings go to stderr."""
    from ..errors import GameError
    from ..game.check import check_game
    from ..game.equilibrium import judge_equilibrium

    found: dict[str, Any] = {"file": str(game), "valid": False, "problems": [], "equilibrium": None}
    try:
        problems = check_game(game)
    except GameError as error:
        typer.echo(f"mog: {error}", err=True)
        return {**found, "problems": [{"line": None, "column": None, "sentence": str(error)}]}
    for problem in problems:
        typer.echo(f"{game}:{problem.line}:{problem.column}: {problem.sentence}", err=True)
    if problems:
        return {**found, "problems": [asdict(problem) for problem in problems]}
    equilibrium = judge_equilibrium(game)
    for warning in equilibrium.warnings if equilibrium else ():
        note(f"{game}: warning: {warning}")
    return {**found, "valid": True, "equilibrium": equilibrium and equilibrium.as_json()}


def _told(judged: Mapping[str, Any]) -> str:
    """One line about a valid file."""
    from ..game.equilibrium import Kind

    equilibrium = judged["equilibrium"]
    local = equilibrium is not None and equilibrium["kind"] == Kind.LOCAL
    return f"{judged['file']} is valid" + (f"; {equilibrium['sentence'].removesuffix('.')}" if local else "")
