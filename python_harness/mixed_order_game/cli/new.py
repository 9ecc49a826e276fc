"""The command `mog new`: parses options and prints."""

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_graphs
from .options import output_option


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
            "small-world:K:P, scale-free:M, geometric:RADIUS, or edges such as 1-2,2-3:0.5 (weight 0.5); "
            "directed:ring, directed:random:P, or 1>2,2>3,3>1, where 2 hears 1.",
            autocompletion=complete_graphs,
        ),
    ] = "ring",
    seed: Annotated[int, typer.Option(help="Seed of all that is random.")] = 0,
    title: Annotated[
        str | None, typer.Option(help="Title of the game.", show_default="from the rest")
    ] = None,
    schema: Annotated[
        str | None,
        typer.Option(help="Schema named in the first line, for editors: a path or URL.", show_default=False),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that exists.")] = False,
) -> None:
    """Write a game file with comments: valid at once, with gains that suit its graph.

    [bold]Examples:[/bold]

    mog new my_game.toml --players 4 --dimension 1 --orders 1,2,2,1 --graph path

    mog new large.toml --players 60 --graph small-world:6:0.1 --seed 3
    """
    from ..errors import GameError
    from ..files.writing import GAME, write_file
    from ..game.check import check_game
    from ..game.new import Recipe, new_game

    output_option(output, GAME, force=force, hint="OUTPUT")
    recipe = Recipe(players, dimension, orders, graph, seed, title, schema)
    text = new_game(recipe)
    write_file(output, GAME, lambda file: file.write(text.encode()), force=force)
    problems = check_game(output)
    if problems:
        raise GameError(f"{output}:{problems[0].line}:{problems[0].column}: {problems[0].sentence}")
    typer.echo(output)
