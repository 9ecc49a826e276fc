"""Runs side by side: the game as it is, without the network, without phi and without both, and any others.

Without the network beta = 0: the weights start at 0 and stay there. Without phi delta = 0. Without both is
the strategy of Theorem 2, robust = false.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ..errors import MixedOrderGameError, ResultError, SimulationError
from ..extras import need
from ..files.writing import RESULT
from ..fmu.build import SOURCE_OR_RESULT, GameSource, fmu_of
from ..fmu.model import Model, Value, read_model
from ..interrupts import noted_signals
from ..notebook import page, paragraph, table
from ..results.metrics import METRIC_UNITS, Metrics, told_figure
from ..results.result import Result, load
from .sampler import Sampler, Settings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Source = GameSource | Result
"""A game that is run, or a run that was recorded."""

BASELINES: Mapping[str, Mapping[str, Value]] = {
    "without network": {"beta": 0.0},
    "without phi": {"delta": 0.0},
    "without both": {"robust": False},
}
"""What the parts of the control are worth: start values by label."""

AS_IT_IS = "as it is"


class CompareError(MixedOrderGameError, ValueError):
    """Runs that cannot be set side by side."""


class UnknownRunError(CompareError, KeyError):
    """A label that no run has."""


@dataclass(frozen=True, eq=False)
class Compared:
    """One column of a comparison. A run that the FMU gave up has no result and no figures."""

    label: str
    changed: Mapping[str, Value]  # what differs from the FMU's start values
    result: Result | None
    metrics: Metrics | None
    error: str = ""  # of a run that the FMU gave up

    def renamed(self, label: str) -> "Compared":
        """The same run under another label."""
        return replace(self, label=label)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Runs side by side, the first of them the reference."""

    runs: tuple[Compared, ...]

    def __repr__(self) -> str:
        return f"<Comparison of {', '.join(run.label for run in self.runs)}>"

    def __getitem__(self, label: str) -> Compared:
        """A run by its label. Raises CompareError."""
        for run in self.runs:
            if run.label == label:
                return run
        raise UnknownRunError(f"no run is called {label!r}: {', '.join(run.label for run in self.runs)}")

    def _repr_html_(self) -> str:
        """For notebooks: the figures of every run, a row each."""
        header = [
            "run",
            *(name.replace("_", " ") + (f" ({unit})" if unit else "") for name, unit in METRIC_UNITS.items()),
        ]
        rows = [
            (run.label, *(told_figure(run.metrics, name, 4) for name in METRIC_UNITS)) for run in self.runs
        ]
        errors = [paragraph(f"{run.label}: {run.error}") for run in self.runs if run.error]
        return page("Runs side by side", table(header, rows), *errors)

    def plot(self, axes: "Axes | None" = None, *, width: float = 3.5) -> "Axes":
        """Draw the distances to the equilibrium over time, on a logarithmic axis.

        Parameters, what is returned and the need of Matplotlib are as for `Result.plot`.

        Raises
        ------
        ResultError
            If nash_error was not recorded.
        """
        need("matplotlib")
        from ..results.plot import plot_error

        return plot_error(self.results, axes, width=width)

    @property
    def results(self) -> dict[str, Result]:
        """Results by label, those of runs that came to their end; plot.plot_error draws them."""
        return {run.label: run.result for run in self.runs if run.result is not None}

    def table(self) -> dict[str, dict[str, float]]:
        """Figure -> label -> value; NaN for runs without it."""
        return {
            name: {
                run.label: float("nan") if run.metrics is None else float(getattr(run.metrics, name))
                for run in self.runs
            }
            for name in METRIC_UNITS
        }

    def as_json(self) -> dict[str, Any]:
        """Plain values for json.dumps."""
        return {
            run.label: {
                "changed": dict(run.changed),
                "metrics": None if run.metrics is None else run.metrics.as_json(),
                "package_version": "" if run.result is None else run.result.package_version,
                "guid": "" if run.result is None else run.result.guid,
                **({"error": run.error} if run.error else {}),
            }
            for run in self.runs
        }


def compare(
    sources: Source | Sequence[Source] = None,
    variants: Mapping[str, Mapping[str, Value]] | None = None,
    *,
    start_values: Mapping[str, Value] | None = None,
    baselines: bool = True,
    stop_time: float | None = None,
    step: float | None = None,
    tolerance: float | None = None,
    settle_time: float | None = None,
    band: float | None = None,
) -> Comparison:
    """Set runs side by side: games as they are, their variants and baselines, and runs that were recorded.

    The baselines show what the parts of the control are worth: a game without the network (beta = 0), without
    phi (delta = 0) and without both (robust = false).

    Parameters
    ----------
    sources
        One or several of: an FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`, a
        result file (.parquet, .csv), a `Result`; the paper's example when left out.
    variants
        Further runs of every game: start values by label, on top of `start_values`.
    start_values
        Start values that all runs of games share.
    baselines
        Whether every game is run without its parts, too.
    stop_time, step, tolerance
        End of the runs and time between samples in s, relative tolerance; default each FMU's own.
    settle_time
        Time in s from which the final error is taken; default 80 % of the run.
    band
        Norm of x - x* that counts as settled, in the game's length unit; default 2 % of the first run's
        initial one, for all runs.

    Returns
    -------
    Comparison
        The recorded runs first. A run that the FMU gave up is an entry with its words and without figures.

    Raises
    ------
    VariableError
        For values that an FMU does not take, before any run.
    CompareError
        For two runs of one label, and for variants of recorded runs alone.
    ResultError
        If a recorded run lacks x or x_star.

    Examples
    --------
    >>> found = mog.compare("rivalling_pairs", {"slow": {"k2": 0.5}}, baselines=False, stop_time=2.0)
    >>> [run.label for run in found.runs]
    ['as it is', 'slow']
    """
    listed: list[Source] = [*sources] if isinstance(sources, list | tuple) else [cast("Source", sources)]
    games = [each for each in listed if not (isinstance(each, Result) or _is_result_file(each))]
    if not games and (variants or start_values):
        raise CompareError("recorded runs are not run again: variants and start values need a game")
    models = [read_model(fmu_of(game, SOURCE_OR_RESULT)) for game in games]
    wanted = _wanted(variants or {}, baselines=baselines)
    for model in models:
        for values in wanted.values():
            model.start_values({**model.expanded(start_values or {}), **model.expanded(values)})
    recorded = _recorded([each for each in listed if isinstance(each, Result) or _is_result_file(each)])
    runs = list(compare_results(recorded, band=band, settle_time=settle_time).runs)
    for game, model in zip(games, models, strict=True):
        first = next((run.metrics for run in runs if run.metrics is not None), None)
        settings = Settings(
            stop_time=model.stop_time if stop_time is None else stop_time,
            step=model.step if step is None else step,
            tolerance=model.tolerance if tolerance is None else tolerance,
            settle_time=settle_time,
            band=band if first is None else first.band,
        )
        prefix = "" if len(listed) == 1 else f"{_name_of(game, model)}: "
        runs += [
            run.renamed(prefix + run.label)
            for run in _variants_of(model, wanted, start_values or {}, settings)
        ]
    return Comparison(tuple(runs))


def _is_result_file(source: GameSource) -> bool:
    return isinstance(source, str | Path) and RESULT.takes(Path(source))


def _recorded(sources: Sequence[Source]) -> dict[str, Result]:
    """Recorded runs by label: files by their names, objects by their titles."""
    files = [Path(each) for each in sources if isinstance(each, str | Path)]
    objects = [each for each in sources if isinstance(each, Result)]
    results = load_results(files)
    for number, each in enumerate(objects, start=1):
        label = each.title or f"run {number}"
        results[label if label not in results else f"{label} ({number})"] = each
    return results


def _name_of(game: GameSource, model: Model) -> str:
    return Path(game).stem if isinstance(game, str | Path) else model.title


def _wanted(
    variants: Mapping[str, Mapping[str, Value]], *, baselines: bool
) -> dict[str, Mapping[str, Value]]:
    """Start values by label: the game as it is, its variants, its baselines. Raises CompareError."""
    wanted: dict[str, Mapping[str, Value]] = {AS_IT_IS: {}}
    for label, values in [*variants.items(), *(BASELINES.items() if baselines else ())]:
        if label in wanted:
            raise CompareError(f"two runs are called {label!r}")
        wanted[label] = values
    return wanted


def _variants_of(
    model: Model,
    wanted: Mapping[str, Mapping[str, Value]],
    start_values: Mapping[str, Value],
    settings: Settings,
) -> Iterator[Compared]:
    band = settings.band
    shared = model.expanded(start_values)
    with noted_signals() as take_signals, Sampler(model.path) as sampler:
        for label, values in wanted.items():
            take_signals()
            start = {**shared, **model.expanded(values)}
            changed = model.changed_values(model.start_values(start))
            try:
                result = sampler.record(start, replace(settings, band=band))
            except SimulationError as error:
                yield Compared(label, changed, None, None, str(error))
                continue
            found = result.metrics
            band = found.band if band is None else band
            yield Compared(label, changed, result, found)


def compare_results(
    results: Mapping[str, Result], *, band: float | None = None, settle_time: float | None = None
) -> Comparison:
    """Set recorded runs side by side. Raises ResultError if one lacks x or x_star."""
    runs: list[Compared] = []
    for label, result in results.items():
        found = result.measured(band=band, settle_time=settle_time)
        band = found.band if band is None else band
        runs.append(Compared(label, dict(result.changed), result, found))
    return Comparison(tuple(runs))


def load_results(paths: Sequence[Path], needed: Sequence[str] = ()) -> dict[str, Result]:
    """Result files by name; by path where two have the same name.

    Raises ResultError for what is no result or lacks one of the signals that are needed.
    """
    names = [path.stem for path in paths]
    labels = [path.stem if names.count(path.stem) == 1 else str(path) for path in paths]
    if len(set(labels)) != len(labels):
        raise ResultError("a result is named twice")
    results = {label: load(path) for label, path in zip(labels, paths, strict=True)}
    for label, result in results.items():
        lacking = [name for name in needed if name not in result.columns]
        if lacking:
            raise ResultError(f"{label}: {lacking[0]} was not recorded")
    return results
