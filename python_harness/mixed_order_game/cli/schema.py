"""The command `mog schema`: parses options and prints."""

from pathlib import Path
from typing import Annotated

import typer

from .options import ForceOption, output_option


def schema(
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write it to a file.", show_default=False)
    ] = None,
    force: ForceOption = False,
) -> None:
    """Print the JSON Schema of game files, which lets an editor complete and check them.

    [bold]Example:[/bold] mog schema --output game.schema.json
    """
    from ..files.writing import SCHEMA, write_file
    from ..game.schema import schema_path

    text = schema_path().read_text(encoding="utf-8")
    if output is None:
        typer.echo(text, nl=False)
    else:
        output_option(output, SCHEMA, force=force)
        typer.echo(write_file(output, SCHEMA, lambda file: file.write(text.encode()), force=force))
