"""The command `mog sweep`: parses options and prints."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..game.graph_kinds import GRAPHS_HELP
from ..interrupts import INTERRUPTED
from ..studies.sampling import Sampling
from .completion import complete_graphs
from .options import (
    BandOption,
    ForceOption,
    GameArgument,
    JsonOption,
    SettingsOption,
    SettleTimeOption,
    StopTimeOption,
    ToleranceOption,
    graphs_option,
    output_option,
    pairs_of,
    range_option,
    settings_of,
)
from .progress import counted_progress

if TYPE_CHECKING:
    from ..studies.sweep.definition import Sweep
    from ..studies.sweep.table import SweepResult

MOST_NAMED = 5
"""Rows that a sentence about failures names."""

MOST_LEVELS = 12
"""Most values of a varied column for which the summary has a table."""


def sweep(
    game: GameArgument = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the rows.")] = Path("sweep"),
    example: Annotated[
        bool,
        typer.Option(
            "--example",
            help="The built-in example: every connected graph, judged on the paper's neighbourhood.",
        ),
    ] = False,
    settings: SettingsOption = None,
    grid: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help="All combinations of values: 1,2,5 or FIRST:LAST:COUNT or FIRST:LAST:COUNT:log; repeatable.",
        ),
    ] = None,
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--range", metavar="NAME=LOW:HIGH", help="Drawn from LOW:HIGH or LOW:HIGH:log; repeatable."
        ),
    ] = None,
    samples: Annotated[int, typer.Option(min=0, help="Points drawn from the ranges.")] = 0,
    design: Annotated[
        Sampling,
        typer.Option(
            case_sensitive=False,
            metavar="METHOD",
            help="How points are drawn: latin-hypercube, or sobol, which wants a power of two.",
        ),
    ] = Sampling.LATIN_HYPERCUBE,
    graphs: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND", help=f"Graphs: {GRAPHS_HELP}; repeatable.", autocompletion=complete_graphs
        ),
    ] = None,
    initial_states: Annotated[int, typer.Option(min=0, help="Random initial actions x0 to run from.")] = 0,
    initial_actions: Annotated[
        str, typer.Option(metavar="LOW:HIGH", help="Range of the random x0.")
    ] = "-10:10",
    initial_velocities: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="Range of random v0; the game's own when left out."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all that is random.")] = 0,
    stop_time: StopTimeOption = None,
    tolerance: ToleranceOption = None,
    settle_time: SettleTimeOption = None,
    band: BandOption = None,
    neighbourhood: Annotated[
        float | None,
        typer.Option(min=0.0, help="Exit with 1 if a final error is not below.", show_default=False),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", min=1, help="Number of processes.", show_default="one a core"),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Run on the workers of this Dask scheduler.", show_default=False
        ),
    ] = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="Discard the rows that the folder holds.")
    ] = False,
    heat_maps: Annotated[
        list[str] | None,
        typer.Option(
            "--heat-map",
            metavar="X,Y,FIGURE",
            help="Draw the median of a figure over two columns, into the folder; repeatable.",
        ),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    r"""Run a game many times: over grids, samples, graphs and random initial states, on all cores.

    The rows stream into Parquet files in the output folder. An interrupted sweep goes on when the same
    command is given again; a worker that dies loses nothing. Exit code 1 if a run leaves the neighbourhood
    asked for, or if no run succeeds.

    [bold]Examples:[/bold]

    mog sweep --example --output connected_graphs

    mog sweep --grid k1=5:20:4 --grid delta=5,10,20 --output gains --heat-map k1,delta,final_error

    mog sweep --range k2=0.5:2 --range k3=10:200:log --samples 64 --design sobol --graphs random:0.5@9

    mog sweep my_game.toml --initial-states 50 --initial-actions -5:5 --scheduler tcp://10.0.0.1:8786
    """
    from ..extras import need
    from ..files.writing import FIGURE
    from ..fmu.build import fmu_of
    from ..fmu.model import read_model
    from ..studies.designs import grid_of_text, range_of_text
    from ..studies.sampler import Settings
    from ..studies.sweep.conduct import connected_graphs_example
    from ..studies.sweep.conduct import sweep as conduct
    from ..studies.sweep.definition import Sweep

    maps = [_heat_map(text) for text in heat_maps or []]
    fixed = settings_of(settings or [])
    if example and (grid or ranges or graphs or initial_states or fixed or samples):
        raise typer.BadParameter("the example has its own graphs and values", param_hint="--example")
    fmu = fmu_of(game)
    if example:
        definition = connected_graphs_example(fmu)
    else:
        model = read_model(fmu)
        definition = Sweep(
            fmu=fmu,
            fixed=fixed,
            grid=pairs_of(grid or [], grid_of_text, "--grid"),
            ranges=pairs_of(ranges or [], range_of_text, "--range"),
            samples=samples,
            sampling=design,
            graphs=graphs_option(graphs or [], model, seed),
            initial_states=initial_states,
            initial_actions=range_option(initial_actions, "--initial-actions") or Sweep.initial_actions,
            initial_velocities=range_option(initial_velocities, "--initial-velocities"),
            seed=seed,
            settings=Settings(
                stop_time=model.stop_time if stop_time is None else stop_time,
                tolerance=model.tolerance if tolerance is None else tolerance,
                settle_time=settle_time,
                band=band,
            ),
            neighbourhood=neighbourhood,
        )
    if maps:
        need("matplotlib")
        from ..studies.sweep.figures import check_heat_map
    for names in maps:
        check_heat_map(definition, *names)
        output_option(_map_file(output, names), FIGURE, force=force, hint="--heat-map")
    try:
        with counted_progress("sweeping") as show:
            result = conduct(
                definition, output, jobs=jobs, scheduler=scheduler, restart=restart, progress=show
            )
    except KeyboardInterrupt:
        typer.echo(f"mog: interrupted; the same command goes on with the rows in {output}", err=True)
        raise typer.Exit(INTERRUPTED) from None
    _show(result, definition, maps, as_json=as_json, force=force)


def _heat_map(text: str) -> tuple[str, str, str]:
    from ..names import split_names

    names = split_names(text)
    if len(names) != 3:  # noqa: PLR2004 - X, Y, FIGURE
        raise typer.BadParameter(f"X,Y,FIGURE expected, not {text!r}", param_hint="--heat-map")
    return names[0], names[1], names[2]


def _map_file(folder: Path, names: tuple[str, str, str]) -> Path:
    plain = "_".join("".join(c if c.isalnum() else "-" for c in each) for each in names)
    return folder / f"heat_map_{plain}.pdf"


def _show(
    result: "SweepResult",
    definition: "Sweep",
    maps: list[tuple[str, str, str]],
    *,
    as_json: bool,
    force: bool,
) -> None:
    missed = [] if definition.neighbourhood is None else result.misses(definition.neighbourhood).tolist()
    if as_json:
        typer.echo(json.dumps(_data(result, missed, definition.neighbourhood), indent=2))
    else:
        _print(result, definition)
    for names in maps:
        from ..results.plot import save_figure
        from ..studies.sweep.figures import plot_heat_map

        path = save_figure(plot_heat_map(result, *names), _map_file(result.folder, names), force=force)
        typer.echo(path, err=as_json)
    failed = result.failed.tolist()
    if missed:
        typer.echo(
            f"mog: {_rows(missed)} of {len(result)} missed the neighbourhood {definition.neighbourhood:g}",
            err=True,
        )
        raise typer.Exit(1)
    if len(failed) == len(result):
        reason = result.table["status"][0].as_py()
        typer.echo(f"mog: no run succeeded: {reason}", err=True)
        raise typer.Exit(1)


def _rows(rows: list[int]) -> str:
    named = ", ".join(map(str, rows[:MOST_NAMED])) + (", ..." if len(rows) > MOST_NAMED else "")
    return f"{len(rows)} row{'s' * (len(rows) != 1)} ({named})"


def _data(result: "SweepResult", missed: list[int], neighbourhood: float | None) -> dict[str, Any]:
    return {
        "folder": str(result.folder),
        "rows": len(result),
        "failed": result.failed.tolist(),
        "neighbourhood": neighbourhood,
        "missed": missed,
        "summary": {
            each.name: {
                "count": each.count,
                **({"least": each.least, "median": each.median, "most": each.most} if each.count else {}),
                "row_of_most": each.row_of_most,
            }
            for each in result.summary()
        },
        "provenance": {
            name: result.definition[name]
            for name in ("package_version", "guid", "seed", "changed", "fingerprint")
        },
    }


def _print(result: "SweepResult", definition: "Sweep") -> None:
    import numpy as np
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    from ..results.metrics import METRIC_UNITS
    from .printing import show, standard_output

    console = standard_output()
    console.print(Text(f"{definition.model.title}: {len(result)} runs in {result.folder}", style="bold"))
    table = Table("figure", "least", "median", "most", "in row", box=SIMPLE_HEAD)
    for each in result.summary():
        unit = METRIC_UNITS[each.name]
        numbers = (f"{value:.4g}" for value in (each.least, each.median, each.most))
        name = each.name.replace("_", " ") + (f" ({unit})" if unit else "")
        table.add_row(name, *numbers, str(each.row_of_most) if each.count else "-")
    show(table, console)
    for name in (*definition.varied, *(("graph_edges",) if definition.graphs else ())):
        if 1 < len(np.unique(result[name])) <= MOST_LEVELS:
            table = Table(name, "median settling time (s)", "median final error", box=SIMPLE_HEAD)
            settling, final = (result.medians([name], figure) for figure in ("settling_time", "final_error"))
            for level in settling:
                table.add_row(f"{level[0]:.5g}", f"{settling[level]:.4g}", f"{final[level]:.4g}")
            show(table, console)
    if len(result.failed):
        reasons = result.table["status"].to_pylist()
        first = next(reason for reason in reasons if reason != "ok")
        console.print(Text(f"{_rows(result.failed.tolist())} failed, the first: {first}"))
    if definition.neighbourhood is not None:
        settings = definition.settings
        begin = 0.8 * settings.stop_time if settings.settle_time is None else settings.settle_time
        count = len(result.misses(definition.neighbourhood))
        verdict = "every run stays" if count == 0 else f"all but {count} runs stay"
        told = f"{verdict} below |x - x*| = {definition.neighbourhood:g} from {begin:g} s on"
        console.print(Text(told))
