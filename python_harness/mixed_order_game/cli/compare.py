"""The command `mog compare`: parses options and prints."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .completion import complete_source
from .options import (
    ForceOption,
    JsonOption,
    SettingsOption,
    SettleTimeOption,
    StepOption,
    StopTimeOption,
    ToleranceOption,
    output_option,
    settings_of,
)

if TYPE_CHECKING:
    from ..fmu.model import Value
    from ..studies.compare import Comparison


def compare(
    sources: Annotated[
        list[Path] | None,
        typer.Argument(
            help="FMUs (.fmu), game files (.toml) and results (.parquet, .csv); default the paper's example.",
            show_default=False,
            autocompletion=complete_source,
        ),
    ] = None,
    variants: Annotated[
        list[str] | None,
        typer.Option(
            "--variant",
            metavar="LABEL:NAME=VALUE,...",
            help="Another run of every game, with other start values; repeatable.",
        ),
    ] = None,
    settings: SettingsOption = None,
    baselines: Annotated[
        bool, typer.Option("--baselines/--no-baselines", help="Run every game without its parts, too.")
    ] = True,
    stop_time: StopTimeOption = None,
    step: StepOption = None,
    tolerance: ToleranceOption = None,
    settle_time: SettleTimeOption = None,
    band: Annotated[
        float | None,
        typer.Option(
            help="Norm of x - x* that counts as settled.", show_default="2 % of the first run's initial one"
        ),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Draw the errors over time (.pdf, .svg, .png).", show_default=False)
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    r"""Set runs side by side: settling time, overshoot, control energy, final error, events.

    A game comes with its baselines: without the network (beta = 0), without phi (delta = 0), without both.

    [bold]Examples:[/bold]

    mog compare

    mog compare my_game.toml --variant "high gain: k1=20, k4=100" --no-baselines --figure comparison.pdf

    mog compare first.parquet second.parquet --json
    """
    from ..extras import need
    from ..files.writing import FIGURE, RESULT
    from ..studies.compare import compare as run_variants
    from ..studies.compare import load_results

    fixed = settings_of(settings or [])
    wanted = dict(_variant(text) for text in variants or [])
    files = [path for path in sources or [] if RESULT.takes(path)]
    if sources and len(files) == len(sources) and (fixed or wanted):
        raise typer.BadParameter("results are not run again", param_hint="--variant, --set")
    if figure is not None:
        need("matplotlib")
        output_option(figure, FIGURE, inputs=sources or [], force=force, hint="--figure")
        load_results(files, ["nash_error"])  # which may be missing, before any run
    found = run_variants(
        sources or None,
        wanted,
        start_values=fixed,
        baselines=baselines,
        stop_time=stop_time,
        step=step,
        tolerance=tolerance,
        settle_time=settle_time,
        band=band,
    )
    if as_json:
        typer.echo(json.dumps(found.as_json(), indent=2))
    else:
        _print(found)
    if figure is not None:
        from ..results.plot import plot_error, save_figure

        typer.echo(save_figure(plot_error(found.results), figure, force=force), err=as_json)


def _variant(text: str) -> "tuple[str, dict[str, Value]]":
    from ..names import split_names

    label, separator, values = text.partition(":")
    if not (label.strip() and separator):
        raise typer.BadParameter(f"LABEL:NAME=VALUE,... expected, not {text!r}", param_hint="--variant")
    return label.strip(), settings_of(split_names(values), "--variant")


def _print(found: "Comparison") -> None:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    from ..results.metrics import METRIC_UNITS, told_figure
    from .printing import show, standard_output

    console = standard_output()
    table = Table("run", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name, unit in METRIC_UNITS.items():
        table.add_column(name.replace("_", " ") + (f" ({unit})" if unit else ""))
    for run in found.runs:
        table.add_row(Text(run.label), *(told_figure(run.metrics, name, 3) for name in METRIC_UNITS))
    show(table, console)
    for run in found.runs:
        if run.error:
            console.print(Text(f"{run.label}: {run.error}"))
