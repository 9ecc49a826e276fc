"""The command `mog ssp`: parses options and prints."""

from pathlib import Path
from typing import Annotated

import typer

from .options import ForceOption, GameFileArgument, output_option, players_of_text


def ssp(
    game: GameFileArgument = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The system structure to write.")] = Path(
        "game.ssp"
    ),
    group: Annotated[
        list[str] | None,
        typer.Option(
            "--group",
            metavar="PLAYERS",
            help="Players of one FMU, as in 1,2; one FMU a player without it.",
            show_default=False,
        ),
    ] = None,
    force: ForceOption = False,
) -> None:
    """Make a system structure (SSP 1.0): FMUs of the players, connected along the graph.

    [bold]Example:[/bold] mog ssp my_game.toml --group 1,2 --group 3,4,5 --output my_game.ssp
    """
    from ..files.writing import SSP
    from ..fmu.build import game_file
    from ..fmu.parts import build_ssp

    source = game_file(game)
    output_option(output, SSP, inputs=[source], force=force)
    groups = [players_of_text(each, "--group") for each in group] if group else None
    typer.echo(build_ssp(source, output, groups=groups, force=force))
