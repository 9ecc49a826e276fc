"""The command `mog run`: parses options and prints."""

import json
from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_variables
from .options import (
    ForceOption,
    GameArgument,
    JsonOption,
    SettingsOption,
    ToleranceOption,
    names_option,
    output_option,
    settings_of,
)
from .progress import progress_by_name


def run(
    game: GameArgument = None,
    settings: SettingsOption = None,
    stop_time: Annotated[
        float | None, typer.Option(help="End of the run in s.", show_default="start plus the FMU's")
    ] = None,
    start_time: Annotated[
        float, typer.Option(help="Beginning of the run in s; any, such as Unix time.")
    ] = 0.0,
    step: Annotated[
        float | None, typer.Option(help="Time between samples in s.", show_default="FMU's")
    ] = None,
    tolerance: ToleranceOption = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Result file, .csv or .parquet.", show_default=False)
    ] = None,
    variables: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES",
            autocompletion=complete_variables,
            help="Variables to record, separated by commas; x stands for x[1,1], x[1,2] and so on; "
            "repeatable. All outputs and locals but y, W and time derivatives when left out.",
        ),
    ] = None,
    graph_schedule: Annotated[
        Path | None,
        typer.Option(help="Graphs that switch during the run, .toml or .csv.", show_default=False),
    ] = None,
    disturbance: Annotated[
        Path | None,
        typer.Option(help="External disturbance d_ext over time, .csv.", show_default=False),
    ] = None,
    linear_disturbance: Annotated[
        bool, typer.Option("--linear-disturbance", help="Straight between its rows, not held.")
    ] = False,
    plant: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PLAYER=FILE:FUNCTION",
            help="A Python function f(t, x, v, u) -> rate in place of a player's plant; repeatable.",
        ),
    ] = None,
    feedback: Annotated[
        str | None,
        typer.Option(
            metavar="FILE:FUNCTION",
            help="A Python function g(t, x, v) of all players, added to the unknown dynamics.",
        ),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    r"""Run a game through fmpy and write or summarize the result.

    [bold]Examples:[/bold]

    mog run --set k1=12 --set "a\[1,3]=0.5" --output result.parquet

    mog run my_game.toml --stop-time 5 --variables x,v,nash_error --output result.csv

    mog run --graph-schedule switching.toml --disturbance gust.csv

    mog run --plant 4=vehicle.py:plant
    """
    from ..files.functions import function_of_text
    from ..files.writing import RESULT
    from ..fmu.run import Simulator
    from ..fmu.schedule import read_disturbance, read_graph_schedule
    from .tables import print_result, result_data

    values = settings_of(settings or [])
    names = names_option(variables, "--variables") if variables else None
    plants = {number: function_of_text(text) for number, text in map(_player_and_function, plant or [])}
    dynamics = None if feedback is None else function_of_text(feedback)
    if output is not None:
        output_option(output, RESULT, inputs=[game, graph_schedule, disturbance], force=force)
    with Simulator(game) as simulator, progress_by_name() as show:
        model = simulator.model
        stop = start_time + model.stop_time if stop_time is None else stop_time
        span = stop - start_time
        schedule = None if graph_schedule is None else read_graph_schedule(graph_schedule, model)
        if schedule is not None:
            values = {**schedule.start_values(start_time), **model.expanded(values)}
        result = simulator.run(
            start_values=values,
            start_time=start_time,
            stop_time=stop,
            step=model.step if step is None else step,
            tolerance=model.tolerance if tolerance is None else tolerance,
            outputs=names,
            changes=None if schedule is None else schedule.changes(stop, start_time),
            inputs=None
            if disturbance is None
            else read_disturbance(disturbance, model, linear=linear_disturbance),
            plant=plants or None,
            feedback=dynamics,
            progress=lambda time: show("simulating", (time - start_time) / span),
        )
    if output is not None:
        typer.echo(result.save(output, force=force), err=as_json)
    if as_json:
        typer.echo(json.dumps(result_data(result), indent=2))
    elif output is None:
        print_result(result)


def _player_and_function(text: str) -> tuple[int, str]:
    """The parts of 4=vehicle.py:plant. Raises typer.BadParameter."""
    number, equals, function = text.partition("=")
    if not equals or not number.strip().isdecimal():
        raise typer.BadParameter(
            f"{text!r} is no player with its function, such as 4=vehicle.py:plant", param_hint="--plant"
        )
    return int(number), function
