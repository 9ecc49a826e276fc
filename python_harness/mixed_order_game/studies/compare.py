"""Runs side by side: the game as it is, without the network, without phi and without both, and any others.

Without the network beta = 0: the weights start at 0 and stay there. Without phi delta = 0. Without both is
the strategy of Theorem 2, robust = false.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import MixedOrderGameError, ResultError, SimulationError
from ..fmu.model import Value
from ..interrupts import noted_signals
from ..results.metrics import METRIC_UNITS, Metrics
from ..results.result import Result, load
from .sampler import Sampler, Settings

BASELINES: Mapping[str, Mapping[str, Value]] = {
    "without network": {"beta": 0.0},
    "without phi": {"delta": 0.0},
    "without both": {"robust": False},
}
"""What the parts of the control are worth: start values by label."""

AS_IT_IS = "as it is"


class CompareError(MixedOrderGameError):
    """Runs that cannot be set side by side."""


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
        raise CompareError(f"no run is called {label!r}: {', '.join(run.label for run in self.runs)}")

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
    fmu: Path | str,
    variants: Mapping[str, Mapping[str, Value]] | None = None,
    *,
    start_values: Mapping[str, Value] | None = None,
    baselines: bool = True,
    settings: Settings | None = None,
) -> Comparison:
    """Run a game as it is, its variants, and the baselines of the game as it is.

    variants: start values by label, on top of start_values, which all runs share.
    settings: horizon, sampling and what settling means. The band of the settling time is that of the first
    run for all, unless given: 2 % of its largest initial |x - x*|.
    Raises VariableError for values that the FMU does not take; a run that it gives up becomes an entry with
    its words.
    """
    wanted: dict[str, Mapping[str, Value]] = {AS_IT_IS: {}}
    for label, values in [*(variants or {}).items(), *(BASELINES.items() if baselines else ())]:
        if label in wanted:
            raise CompareError(f"two runs are called {label!r}")
        wanted[label] = values
    chosen = settings or Settings()
    band = chosen.band
    runs: list[Compared] = []
    with noted_signals() as take_signals, Sampler(fmu) as sampler:
        model = sampler.model
        shared = model.expanded(start_values or {})
        starts = {label: {**shared, **model.expanded(values)} for label, values in wanted.items()}
        changes = {label: model.changed_values(model.start_values(start)) for label, start in starts.items()}
        for label, start in starts.items():
            take_signals()
            try:
                result = sampler.record(start, chosen)
            except SimulationError as error:
                runs.append(Compared(label, changes[label], None, None, str(error)))
                continue
            found = result.measured(band=band, settle_time=chosen.settle_time)
            band = found.band if band is None else band
            runs.append(Compared(label, changes[label], result, found))
    return Comparison(tuple(runs))


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
