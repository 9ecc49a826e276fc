"""The command `mog compare`: parses options and prints."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import (
    ForceOption,
    SettingsOption,
    SettleTimeOption,
    StepOption,
    StopTimeOption,
    ToleranceOption,
    output_option,
    settings_of,
)

if TYPE_CHECKING:
    from ..fmu.model import Model, Value
    from ..studies.compare import Comparison


def compare(
    sources: Annotated[
        list[Path] | None,
        typer.Argument(
            help="FMUs (.fmu), game files (.toml) and results (.parquet, .csv); default the paper's example.",
            show_default=False,
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
            help="Largest |x - x*| that counts as settled.", show_default="2 % of the first run's initial one"
        ),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Draw the errors over time (.pdf, .svg, .png).", show_default=False)
    ] = None,
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    r"""Set runs side by side: settling time, overshoot, control energy, final error, events.

    A game comes with its baselines: without the network (beta = 0), without phi (delta = 0), without both.

    [bold]Examples:[/bold]

    mog compare

    mog compare my_game.toml --variant "high gain: k1=20, k4=100" --no-baselines --figure comparison.pdf

    mog compare first.parquet second.parquet --json
    """
    from ..files.writing import FIGURE, RESULT
    from ..fmu.build import SOURCE_OR_RESULT, fmu_of
    from ..fmu.model import read_model
    from ..studies.compare import Comparison, compare_results, load_results
    from ..studies.compare import compare as run_variants
    from ..studies.sampler import Settings

    fixed = settings_of(settings or [])
    wanted = dict(_variant(text) for text in variants or [])
    games: list[Path | None] = [path for path in sources or [] if not RESULT.takes(path)]
    files = [path for path in sources or [] if RESULT.takes(path)]
    if not files and not games:
        games = [None]
    if not games and (fixed or wanted):
        raise typer.BadParameter("results are not run again", param_hint="--variant, --set")

    if figure is not None:
        output_option(figure, FIGURE, inputs=sources or [], force=force, hint="--figure")
    models = [read_model(fmu_of(game, SOURCE_OR_RESULT)) for game in games]
    results = load_results(files, [] if figure is None else ["nash_error"])
    _judge(models, [{**fixed, **values} for values in wanted.values()])

    runs = list(compare_results(results, band=band, settle_time=settle_time).runs)
    for game, model in zip(games, models, strict=True):
        first = next((run.metrics for run in runs if run.metrics is not None), None)
        comparison = run_variants(
            model.path,
            wanted,
            start_values=fixed,
            baselines=baselines,
            settings=Settings(
                stop_time=model.stop_time if stop_time is None else stop_time,
                step=model.step if step is None else step,
                tolerance=model.tolerance if tolerance is None else tolerance,
                settle_time=settle_time,
                band=band if first is None else first.band,
            ),
        )
        prefix = "" if game is None or len(games) + len(files) == 1 else f"{game.stem}: "
        runs += [run.renamed(prefix + run.label) for run in comparison.runs]
    found = Comparison(tuple(runs))
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


def _judge(models: Sequence["Model"], values: Sequence[Mapping[str, "Value"]]) -> None:
    """Raises VariableError for values that one of the games does not take, before any is run."""
    for model in models:
        for each in values:
            model.start_values(each)


def _print(found: "Comparison") -> None:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    from ..results.metrics import METRIC_UNITS
    from .printing import show, standard_output

    console = standard_output()
    table = Table("run", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name, unit in METRIC_UNITS.items():
        table.add_column(name.replace("_", " ") + (f" ({unit})" if unit else ""))
    for run in found.runs:
        figures = [None if run.metrics is None else getattr(run.metrics, name) for name in METRIC_UNITS]
        table.add_row(Text(run.label), *("-" if value is None else f"{value:.3g}" for value in figures))
    show(table, console)
    for run in found.runs:
        if run.error:
            console.print(Text(f"{run.label}: {run.error}"))
