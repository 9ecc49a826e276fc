"""The command `mog info`: parses options and prints."""

import json
from typing import Annotated

import typer

from .options import GameArgument, JsonOption


def info(
    game: GameArgument = None,
    variables: Annotated[bool, typer.Option("--variables", help="List every variable.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show a game: sizes, graph, gains and who chose them, variables, capabilities.

    [bold]Example:[/bold] mog info MixedOrderGame.fmu --variables
    """
    from ..fmu.model import read_model
    from .tables import info_data, print_info

    model = read_model(game)
    if as_json:
        typer.echo(json.dumps(info_data(model, variables=variables), indent=2))
    else:
        print_info(model, variables=variables)
