"""The command `mog explore`: parses options and serves the page."""

from typing import Annotated

import typer

from .options import GameArgument


def explore(
    game: GameArgument = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Port of the page, 0 for any.",
            show_default="8640, or any where it is taken",
        ),
    ] = None,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
    ] = True,
) -> None:
    """Try a game by hand on a local page: gains, graph, starts and pushes, answered while you move them.

    The page is for this machine alone and needs no network. Ctrl-C ends it.

    [bold]Examples:[/bold]

    mog explore

    mog explore my_game.toml --port 9000 --no-browser
    """
    from ..extras import need

    for package in ("bokeh", "tornado"):
        need(package)
    from ..explore.server import serve

    def ready(address: str) -> None:
        typer.echo(address)
        if browser:
            import webbrowser

            webbrowser.open(address)

    serve(game, port=port, ready=ready)
