"""The command `mog build`: parses options and prints."""

from pathlib import Path
from typing import Annotated

import typer

from .options import ForceOption, GameFileArgument, output_option, players_of_text
from .verbosity import note


def build(
    game: GameFileArgument = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The FMU to write.")] = Path(
        "MixedOrderGame.fmu"
    ),
    player: Annotated[
        str | None,
        typer.Option(
            "--player",
            help="Some players alone, as in 3 or 1,2; what they hear are inputs.",
            show_default=False,
        ),
    ] = None,
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

    [bold]Examples:[/bold]

    mog build my_game.toml --output my_game.fmu

    mog build my_game.toml --player 3 --output player_3.fmu
    """
    from ..files.writing import FMU
    from ..fmu.build import build_fmu, game_file
    from ..fmu.model import read_model
    from ..fmu.parts import build_part, notes_of_parts

    source = game_file(game)
    output_option(output, FMU, inputs=[source], force=force)
    if player is None:
        made = build_fmu(source, output, arm_linux=arm_linux, force=force)
    else:
        made = build_part(
            source, players_of_text(player, "--player"), output, arm_linux=arm_linux, force=force
        )
    typer.echo(made)
    for told in notes_of_parts(read_model(made)):
        note(told)
