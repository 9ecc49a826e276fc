"""The commands `mog new`, `mog check` and `mog schema`: parse options and print."""

from pathlib import Path
from typing import Annotated

import typer

from ..shared_options import ForceOption, output_option


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command("new")(new)
    app.command("check")(check)
    app.command("schema")(schema)


def new(
    output: Annotated[Path, typer.Argument(help="The game file to write (.toml).", show_default=False)],
    players: Annotated[int, typer.Option("--players", "-n", help="N, number of players.")] = 5,
    dimension: Annotated[int, typer.Option("--dimension", "-d", help="D, coordinates of an action.")] = 2,
    orders: Annotated[
        str, typer.Option(help="mixed (half and half), first, second, or a list such as 1,1,2.")
    ] = "mixed",
    graph: Annotated[
        str,
        typer.Option(
            help="Communication graph: ring, path, star, wheel, complete, tree, random:P, regular:DEGREE, "
            "small-world:K:P, scale-free:M, geometric:RADIUS, or edges such as 1-2,2-3:0.5 (weight 0.5)."
        ),
    ] = "ring",
    seed: Annotated[int, typer.Option(help="Of everything random.")] = 0,
    title: Annotated[
        str | None, typer.Option(help="Title of the game.", show_default="from the rest")
    ] = None,
    schema: Annotated[
        str | None,
        typer.Option(help="Schema named in the first line, for editors: a path or URL.", show_default=False),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that exists.")] = False,  # noqa: FBT002
) -> None:
    """Write a game file with comments: valid at once, with gains that suit its graph.

    [bold]Examples:[/bold]

    mog new my_game.toml --players 4 --dimension 1 --orders 1,2,2,1 --graph path

    mog new large.toml --players 60 --graph small-world:6:0.1 --seed 3
    """
    from ..errors import GameError
    from ..writing import GAME, write_file
    from .check_game import check_game
    from .new_game import Recipe, new_game

    output_option(output, GAME, force=force, hint="OUTPUT")
    recipe = Recipe(players, dimension, orders, graph, seed, title, schema)
    text = new_game(recipe)
    write_file(output, GAME, lambda file: file.write(text.encode()), force=force)
    problems = check_game(output)
    if problems:
        raise GameError(f"{output}:{problems[0].line}: {problems[0].sentence}")
    typer.echo(output)


def check(
    games: Annotated[list[Path], typer.Argument(help="Game files (.toml).", show_default=False)],
) -> None:
    """Check game files: tell problems with their lines, exit code 1 if there is one.

    [bold]Example:[/bold] mog check my_game.toml
    """
    from ..errors import GameError
    from .check_game import check_game

    broken = False
    for game in games:
        try:
            problems = check_game(game)
        except GameError as error:
            typer.echo(f"mog: {error}", err=True)
            broken = True
            continue
        for problem in problems:
            typer.echo(f"{game}:{problem.line}: {problem.sentence}", err=True)
        if not problems:
            typer.echo(f"{game} is valid")
        broken = broken or bool(problems)
    if broken:
        raise typer.Exit(1)


def schema(
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write it to a file.", show_default=False)
    ] = None,
    force: ForceOption = False,  # noqa: FBT002
) -> None:
    """Print the JSON Schema of game files, which lets an editor complete and check them.

    [bold]Example:[/bold] mog schema --output game.schema.json
    """
    from ..writing import SCHEMA, write_file
    from .schema import schema_path

    text = schema_path().read_text(encoding="utf-8")
    if output is None:
        typer.echo(text, nl=False)
    else:
        output_option(output, SCHEMA, force=force)
        typer.echo(write_file(output, SCHEMA, lambda file: file.write(text.encode()), force=force))
