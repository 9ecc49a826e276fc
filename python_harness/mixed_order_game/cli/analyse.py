"""The command `mog analyse`: parses options and prints."""

import json
from typing import Annotated

import typer

from .options import GameArgument, JsonOption, SettingsOption, settings_of
from .progress import step_named


def analyse(
    game: GameArgument = None,
    settings: SettingsOption = None,
    simulation: Annotated[
        bool, typer.Option("--simulation/--no-simulation", help="Compare the bounds with runs of the FMU.")
    ] = True,
    square: Annotated[
        bool,
        typer.Option("--square/--no-square", help="Keep or remove the square terms of the unknown dynamics."),
    ] = True,
    radius: Annotated[
        float, typer.Option(help="Distance to the equilibrium that the designed gains guarantee.")
    ] = 0.1,
    box: Annotated[
        float | None,
        typer.Option(
            help="Of games with expressions: constants hold where every action is within this distance of x*;"
            " by default as far as the starts, if proved there.",
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Of dynamics that depend on velocities: constants hold where no coordinate of a velocity is"
            " larger; by default as at the start, larger where the designed gains ask for it.",
        ),
    ] = None,
    tables: Annotated[
        bool, typer.Option("--tables", help="Print every figure and hypothesis after the verdicts.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Tell whether the gains suit the graph: thresholds of the theorems, exact spectrum, guaranteed radius.

    Compares the theorems' bounds with the exact spectrum and with runs, names every hypothesis that fails,
    and seeks gains that meet them all.

    [bold]Examples:[/bold]

    mog analyse my_game.toml --no-simulation --json

    mog analyse cournot_isoelastic --box 0.5

    mog analyse --no-square --radius 0.01 --set k3=100
    """
    from ..theory.analysis import analyse as run_analysis
    from .analysis_tables import print_analysis

    with step_named("analysing") as show:
        found = run_analysis(
            game,
            changes=settings_of(settings or []),
            simulation=simulation,
            square=square,
            radius=radius,
            box=box,
            speed=speed,
            progress=show,
        )
    if as_json:
        typer.echo(json.dumps(found.to_dict(), indent=2))
    else:
        print_analysis(found, tables=tables)
