"""The command `mog build`: parses options and prints."""

from pathlib import Path
from typing import Annotated

import typer

from .options import ForceOption, output_option


def build(
    game: Annotated[
        Path | None,
        typer.Argument(
            help="A game file (.toml) or a game of the package by name; the paper's example when left out.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The FMU to write.")] = Path(
        "MixedOrderGame.fmu"
    ),
    arm_linux: Annotated[
        bool | None,
        typer.Option(
            "--arm-linux",
            help="For 64-bit Arm Linux alone: also in the folder linux64, where most importers look.",
            show_default=False,
        ),
    ] = None,
    force: ForceOption = False,
) -> None:
    """Make an FMU from a game file. No compiler is needed.

    [bold]Example:[/bold] mog build my_game.toml --output my_game.fmu
    """
    from ..files.writing import FMU
    from ..fmu.build import build_fmu, game_file

    source = game_file(game)
    output_option(output, FMU, inputs=[source], force=force)
    typer.echo(build_fmu(source, output, arm_linux=arm_linux, force=force))
