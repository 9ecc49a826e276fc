"""The command `mog tune`: parses options and prints."""

import json
from typing import TYPE_CHECKING, Annotated

import typer

from ..game.graph_kinds import GRAPHS_HELP
from ..interrupts import INTERRUPTED
from .completion import complete_graphs
from .options import (
    BandOption,
    GameArgument,
    JsonOption,
    SettingsOption,
    graphs_option,
    pairs_of,
    settings_of,
)
from .progress import step_named

if TYPE_CHECKING:
    from ..studies.tune import Tuned


def tune(
    game: GameArgument = None,
    *,
    settling_time: Annotated[
        float,
        typer.Option(min=0.0, help="Wish in s: the norm of x - x* stays within the band from here on."),
    ],
    graphs: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND",
            help=f"Tune for all of these graphs: {GRAPHS_HELP}; repeatable.",
            autocompletion=complete_graphs,
        ),
    ] = None,
    gains: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Gains to tune, separated by commas; delta, beta, epsilon too.",
            show_default="k1,k2,k3,k4, those that move a player",
        ),
    ] = None,
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--range", metavar="NAME=LOW:HIGH", help="Where a gain is sought: LOW:HIGH; repeatable."
        ),
    ] = None,
    settings: SettingsOption = None,
    band: BandOption = None,
    largest_error: Annotated[
        float | None,
        typer.Option(min=0.0, help="Largest |x - x*| in the last fifth of the runs.", show_default="any"),
    ] = None,
    stop_time: Annotated[
        float | None, typer.Option(help="End of the runs in s.", show_default="4 times the wish, at least 2")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search and of random graphs.")] = 0,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", min=1, help="Processes for many graphs.", show_default="one a core"),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    r"""Find gains that settle in a wished time with little control energy; exit with 1 if none do.

    Differential evolution on the linear loop, then simulation through the FMU: what is printed was run on
    every graph.

    [bold]Examples:[/bold]

    mog tune --settling-time 1.5

    mog tune my_game.toml --settling-time 1 --graphs all --gains k1,k2,k3,k4,delta --range k3=10:200
    """
    from ..fmu.build import fmu_of
    from ..fmu.model import read_model
    from ..names import split_names
    from ..studies.designs import range_of_text
    from ..studies.tune import tune as search

    fixed = settings_of(settings or [])
    boxes = pairs_of(ranges or [], range_of_text, "--range")
    fmu = fmu_of(game)
    chosen = graphs_option(graphs or [], read_model(fmu), seed) or None
    with step_named("tuning") as show:
        found = search(
            fmu,
            settling_time,
            graphs=chosen,
            gains=None if gains is None else split_names(gains),
            ranges=boxes,
            start_values=fixed,
            band=band,
            largest_error=largest_error,
            stop_time=stop_time,
            seed=seed,
            jobs=jobs,
            progress=show,
        )
    if as_json:
        typer.echo(json.dumps(found.as_json(), indent=2))
    else:
        _print(found)
    if found.interrupted:
        typer.echo("mog: interrupted; these are the best gains so far", err=True)
        raise typer.Exit(INTERRUPTED)
    if not found.met:
        wishes = "" if found.settles else f" to settle within {found.wish:g} s"
        if not found.exact:
            wishes += f"{' and' if wishes else ''} to end within {found.largest_error:g} of the equilibrium"
        typer.echo(f"mog: no gains in the ranges were found{wishes}", err=True)
        raise typer.Exit(1)


def _print(found: "Tuned") -> None:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    from ..results.metrics import METRIC_UNITS, told_figure
    from .printing import show, standard_output

    console = standard_output()
    table = Table("", "before", "tuned", box=SIMPLE_HEAD)
    for name, value in found.gains.items():
        table.add_row(name, f"{found.start_gains[name]:.4g}", f"{value:.4g}")
    before, after = found.start_metrics[found.worst], found.metrics[found.worst]
    for name, unit in METRIC_UNITS.items():
        cells = (told_figure(each, name, 4) for each in (before, after))
        table.add_row(name.replace("_", " ") + (f" ({unit})" if unit else ""), *cells)
    show(table, console)
    count = len(found.graphs)
    where = (
        "on its graph"
        if count == 1
        else f"on the slowest of {count} graphs, {found.graphs[found.worst].label}"
    )
    console.print(Text(f"figures {where}; {found.simulations} simulations"))
    for note in found.notes:
        console.print(Text(f"note: {note}"))
    console.print(Text("use: " + " ".join(f"--set {name}={value:g}" for name, value in found.gains.items())))
