"""The command mog: parses options and prints; everything else is done by the library.

Exit codes: 0 fine; 1 a check failed, or an error told in one sentence on stderr; 2 wrong usage;
130 after Ctrl-C.
"""

import codecs
import io
import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
import typer.core

from .analysis.command import register as register_analyse
from .authoring.command import register as register_authoring
from .build import SOURCE_OR_RESULT, fmu_of, game_file
from .compare_command import register as register_compare
from .errors import MixedOrderGameError, reason
from .interrupts import INTERRUPTED, end_as_exceptions
from .reporting.command import register as register_report
from .shared_options import ForceOption, ToleranceOption, output_option
from .sweep_command import register as register_sweep
from .tune_command import register as register_tune
from .version import package_version

if TYPE_CHECKING:
    from .validate import Validation


class ErrorsAsSentences(typer.core.TyperGroup):
    """Prints the package's own exceptions as one sentence on stderr and exits with 1; Ctrl-C gives 130."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            typer.echo("mog: interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None
        except MixedOrderGameError as error:
            typer.echo(f"mog: {error}", err=True)
            raise typer.Exit(1) from error


app = typer.Typer(
    name="mog",
    cls=ErrorsAsSentences,
    help="Distributed Nash equilibrium seeking for mixed-order games, as an FMU.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

GAME_HELP = (
    "An FMU (.fmu), a game file (.toml) or a game of the package by name; the paper's example when left out."
)
Game = Annotated[Path | None, typer.Argument(help=GAME_HELP, show_default=False)]


class FigureFormat(StrEnum):
    """File formats of figures."""

    PDF = "pdf"
    SVG = "svg"
    PNG = "png"


class FigureWidth(StrEnum):
    """Widths of figures in a two-column paper."""

    COLUMN = "column"
    PAGE = "page"


def _version(value: bool) -> None:
    if value:
        typer.echo(f"mog {package_version()}")
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Distributed Nash equilibrium seeking for mixed-order games, as an FMU.

    Commands that run or show a game take an FMU, a game file or a game of the package by name, and the
    paper's example when given none.
    """


@app.command()
def build(
    game: Annotated[
        Path | None,
        typer.Argument(
            help="A game file (.toml) or a game of the package by name; the paper's example when left out.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The FMU to write.")] = Path(
        "MixedOrderGame.fmu"
    ),
    arm_linux: Annotated[
        bool | None,
        typer.Option(
            "--arm-linux",
            help="For 64-bit Arm Linux alone: also in the folder linux64, where most importers look.",
            show_default=False,
        ),
    ] = None,
    force: ForceOption = False,
) -> None:
    """Make an FMU from a game file. No compiler is needed.

    [bold]Example:[/bold] mog build my_game.toml --output my_game.fmu
    """
    from .build import build_fmu
    from .writing import FMU

    source = game_file(game)
    output_option(output, FMU, inputs=[source], force=force)
    typer.echo(build_fmu(source, output, arm_linux=arm_linux, force=force))


@app.command()
def info(
    game: Game = None,
    variables: Annotated[bool, typer.Option("--variables", help="List every variable.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show a game: sizes, graph, gains and who chose them, variables, capabilities.

    [bold]Example:[/bold] mog info MixedOrderGame.fmu --variables
    """
    from .model import read_model
    from .tables import info_data, print_info

    model = read_model(game)
    if as_json:
        typer.echo(json.dumps(info_data(model, variables=variables), indent=2))
    else:
        print_info(model, variables=variables)


@app.command()
def run(
    game: Game = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Start value of a parameter or input; repeatable."),
    ] = None,
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
            help="Variables to record, separated by commas; x stands for every x\\[i,l]; repeatable. "
            "All outputs and locals but y, W and time derivatives when left out.",
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
    force: ForceOption = False,
) -> None:
    r"""Run a game through fmpy and write or summarize the result.

    [bold]Examples:[/bold]

    mog run --set k1=12 --set "a\[1,3]=0.5" --output result.parquet

    mog run my_game.toml --stop-time 5 --variables x,v,nash_error --output result.csv

    mog run --graph-schedule switching.toml --disturbance gust.csv
    """
    from .run import Simulator
    from .schedule import read_disturbance, read_graph_schedule
    from .sweeping.options import names_option, settings_of
    from .tables import print_result
    from .writing import RESULT

    values = settings_of(settings or [])
    names = names_option(variables, "--variables") if variables else None
    if output is not None:
        output_option(output, RESULT, inputs=[game, graph_schedule, disturbance], force=force)
    with Simulator(game) as simulator, _progress() as show:
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
            progress=lambda time: show("simulating", (time - start_time) / span),
        )
    if output is not None:
        typer.echo(result.save(output, force=force))
    else:
        print_result(result)


@app.command()
def validate(
    game: Game = None,
    limit: Annotated[
        float | None,
        typer.Option(
            help="Longest simulated time in s in which the robust run may settle.", show_default="1000"
        ),
    ] = None,
    neighbourhood: Annotated[
        float | None,
        typer.Option(help="Largest |x - x*| wanted once settled: one more claim.", show_default=False),
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 1 unless every claim holds.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Judge the paper's claims on a game; exit with 1 if one fails.

    A claim holds, fails, is not covered (its premises are not met) or is not settled (within the limit).

    [bold]Example:[/bold] mog validate my_game.toml --neighbourhood 0.01 --limit 200 --strict
    """
    from .validate import LIMIT
    from .validate import validate as judge

    for name, value in (("--limit", limit), ("--neighbourhood", neighbourhood)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise typer.BadParameter("expected a positive number", param_hint=name)
    fmu = fmu_of(game)
    with _progress() as show:
        verdict = judge(
            fmu, limit=LIMIT if limit is None else limit, neighbourhood=neighbourhood, progress=show
        )
    _report(verdict, as_json=as_json, strict=strict)


@app.command()
def plot(
    source: Annotated[
        Path | None,
        typer.Argument(
            help="A result (.parquet, .csv), or what run takes; the paper's example when left out.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the figures.")] = Path("figures"),
    file_format: Annotated[
        FigureFormat, typer.Option("--format", case_sensitive=False, help="File format.")
    ] = FigureFormat.PDF,
    width: Annotated[
        FigureWidth, typer.Option(case_sensitive=False, help="Width in a two-column paper.")
    ] = FigureWidth.COLUMN,
    force: ForceOption = False,
) -> None:
    """Draw the figures of a result, or of a game the paper's four, the error and the paths in the plane.

    [bold]Examples:[/bold]

    mog plot --output figures --format svg

    mog plot result.parquet --width page
    """
    from .claims.tolerances import PLAIN_TOLERANCE, TOLERANCE
    from .plot import (
        COLUMN_WIDTH,
        PAGE_WIDTH,
        paper_figure_names,
        paper_figures,
        result_figures,
        save_figure,
    )
    from .results import load
    from .run import Simulator
    from .writing import FIGURE, RESULT

    inches = PAGE_WIDTH if width is FigureWidth.PAGE else COLUMN_WIDTH

    def judged(names: Iterable[str]) -> dict[str, Path]:
        paths = {name: output / f"{name}.{file_format.value}" for name in names}
        for path in paths.values():
            output_option(path, FIGURE, inputs=[source], force=force)
        return paths

    if source is not None and RESULT.takes(source):
        figures = result_figures(load(source), width=inches)
        paths = judged(figures)
    else:
        with Simulator(fmu_of(source, SOURCE_OR_RESULT)) as simulator:
            paths = judged(paper_figure_names(simulator.model))
            robust, plain = (
                simulator.run(
                    start_values={"robust": on, "perturbed": on},
                    stop_time=simulator.model.stop_time,
                    tolerance=tolerance,
                )
                for on, tolerance in ((True, TOLERANCE), (False, PLAIN_TOLERANCE))
            )
        figures = paper_figures(robust, plain, width=inches)
    for name, axes in figures.items():
        typer.echo(save_figure(axes, paths[name], force=force))


@app.command()
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for results and figures.")] = Path(
        "demo"
    ),
    fmu: Annotated[
        Path | None,
        typer.Option(help="The FMU or game to use; the paper's example when left out.", show_default=False),
    ] = None,
    file_format: Annotated[
        FigureFormat, typer.Option("--format", case_sensitive=False, help="File format.")
    ] = FigureFormat.PNG,
    force: ForceOption = False,
) -> None:
    """Simulate the paper's example, judge each claim, print the verdict and write results and figures.

    [bold]Example:[/bold] mog demo --output demo
    """
    from .demo import demo as demonstrate

    path = fmu_of(fmu)
    with _progress() as show:
        done = demonstrate(path, output, suffix=f".{file_format.value}", force=force, progress=show)
    for file in done.files:
        typer.echo(file)
    _report(done.validation, as_json=False, strict=False)


register_analyse(app)
register_authoring(app)
register_report(app)
register_compare(app)
register_sweep(app)
register_tune(app)


def main() -> None:
    """Entry point of the command, on any console."""
    end_as_exceptions()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # characters that it lacks are shown as \\uXXXX, not fatal
            utf8 = codecs.lookup(stream.encoding).name == "utf-8"
            stream.reconfigure(errors="surrogateescape" if utf8 else "backslashreplace")
    try:
        app()
    except OSError as error:  # mostly of a full disk behind standard output
        where = f"{error.filename}: " if error.filename else ""
        sys.stderr.write(f"mog: {where}{reason(error)}\n")
        sys.exit(1)


def _report(validation: "Validation", *, as_json: bool, strict: bool) -> None:
    from .tables import print_validation

    if as_json:
        typer.echo(json.dumps(validation.as_json(), indent=2))
    else:
        print_validation(validation)
    problem = validation.problem(strict=strict)
    if problem:
        typer.echo(f"mog: {problem}", err=True)
        raise typer.Exit(1)


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """Progress bars on stderr, one for each name; none when stderr is not a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bars:
        tasks: dict[str, TaskID] = {}

        def show(name: str, part: float) -> None:
            if name not in tasks:
                tasks[name] = bars.add_task(name, total=1.0)
            bars.update(tasks[name], completed=part if math.isfinite(part) else 0.0)

        yield show


if __name__ == "__main__":
    main()
