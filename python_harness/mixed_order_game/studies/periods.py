"""A game whose players talk once a period: which period it survives, and what the neighbourhood does."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..arguments import number_argument
from ..errors import ExperimentError, SimulationError
from ..extras import need
from ..fmu.build import GameSource
from ..fmu.coupled import Coupled
from ..fmu.model import Model, Value
from ..fmu.run import Simulator, samples
from ..game.definition import has_expressions
from ..game.parameters import game_parameters
from ..notebook import digits, page, paragraph, table
from ..results.result import Result
from ..theory.sampled import longest_period

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]

PERIODS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Periods in s that are tried unless others are wished."""

BAND, LAST = 0.02, 0.2
"""Norm of x - x* that counts as settled, in parts of the initial one; of the run, what is looked at."""

FINE = 1e-2
"""To what part of itself the longest period that is survived is sought."""

LARGEST = 500
"""Most states of the loop of Theorem 2, in one coordinate, whose limit is sought."""

Verdict = Literal["settles", "shrinks", "grows"]


@dataclass(frozen=True, eq=False)
class Period:
    """What a period did. A run that an FMU gave up grows, and has its words."""

    period: float  # s
    verdict: Verdict
    final_error: float  # largest |x_il - x*_il| in the last fifth; infinite where an FMU gave up
    difference: float  # largest difference of an action from the whole game's in there
    error: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Periods:
    """Runs of one game with several periods, the shortest first."""

    title: str
    groups: tuple[tuple[int, ...], ...]  # 1-based players of each part
    stop_time: float  # s
    whole_error: float  # largest |x_il - x*_il| in the last fifth, of the whole game, which always talks
    runs: tuple[Period, ...]
    unperturbed_limit: float | None
    """Period in s below which the loop of Theorem 2 is stable, 0 if it is unstable itself; None if a cost has
    an expression, or of many players."""
    survived: tuple[float, float] | None = None
    """Periods in s that were found by search: one that is survived, and one not much longer that is not."""
    searched: bool = False

    def __repr__(self) -> str:
        return (
            f"<Periods of {self.title}: {', '.join(f'{run.period:g} s {run.verdict}' for run in self.runs)}>"
        )

    def __getitem__(self, period: float) -> Period:
        """The run with a period in s. Raises KeyError."""
        for run in self.runs:
            if np.isclose(run.period, period, rtol=1e-9, atol=0.0):
                return run
        raise KeyError(f"no run has the period {period:g} s")

    @property
    def notes(self) -> list[str]:
        """What is to be said besides the runs."""
        said = [f"The whole game, which always talks, ends within {self.whole_error:.3g}."]
        if self.survived is not None:
            inside, beyond = self.survived
            said.append(f"In {self.stop_time:g} s, {inside:.3g} s is survived, {beyond:.3g} s is not.")
        elif self.searched and self.runs[0].verdict == "grows":
            hint = "" if self.unperturbed_limit == 0.0 else ": search among shorter ones"
            said.append(f"{self.runs[0].period:g} s is not survived{hint}.")
        elif self.searched:
            said.append(f"{self.runs[-1].period:g} s is survived: search among longer ones.")
        limit = self.unperturbed_limit
        if limit == 0.0:
            said.append(
                "Without robust part and perturbation the loop is unstable, however short the period."
            )
        elif limit is not None:
            known = (
                "for every period that was tried" if np.isinf(limit) else f"for periods below {limit:.3g} s"
            )
            said.append(f"Without robust part and perturbation the loop is stable {known}.")
        return said

    def _repr_html_(self) -> str:
        """For notebooks: a row for each period."""
        header = ["period (s)", "verdict", "final error", "difference from the whole game"]
        rows = [
            (digits(run.period), run.verdict, digits(run.final_error), digits(run.difference))
            for run in self.runs
        ]
        return page(self.title, table(header, rows), *map(paragraph, self.notes))

    def as_json(self) -> dict[str, Any]:
        """Plain values for json.dumps; None for what is infinite."""
        return {
            "title": self.title,
            "groups": [list(group) for group in self.groups],
            "stop_time": self.stop_time,
            "whole_error": _plain(self.whole_error),
            "unperturbed_limit": None if self.unperturbed_limit is None else _plain(self.unperturbed_limit),
            "survived": None if self.survived is None else list(self.survived),
            "runs": [
                {
                    "period": run.period,
                    "verdict": run.verdict,
                    "final_error": _plain(run.final_error),
                    "difference": _plain(run.difference),
                    **({"error": run.error} if run.error else {}),
                }
                for run in self.runs
            ],
        }

    def plot(self, axes: "Axes | None" = None, *, width: float = 3.5) -> "Axes":
        """Draw the final error over the period, on logarithmic axes.

        Parameters, what is returned and the need of Matplotlib are as for `Result.plot`.
        """
        need("matplotlib")
        from ..results.period_figure import plot_periods

        return plot_periods(self, axes, width=width)


def periods(
    game: GameSource = None,
    values: Sequence[float] = PERIODS,
    *,
    groups: Sequence[Collection[int]] | None = None,
    start_values: Mapping[str, Value] | None = None,
    stop_time: float | None = None,
    tolerance: float | None = None,
    search: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Periods:
    """Couple the parts of a game, which talk once a period, and see what each period does.

    Every part is an FMU of some players. All take a step of one period, then each is told what the others'
    outputs are and holds it over its next step: what is heard is one period old at the end.

    Parameters
    ----------
    game
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`; the paper's example
        when left out.
    values
        Periods in s.
    groups
        1-based players of each part, each player in one of them; one part a player when left out.
    start_values
        Parameters to set first, by name, in the parts that have them.
    stop_time, tolerance
        End of each run in s, relative tolerance of the FMUs; default the game's own.
    search
        Whether the longest period that is survived is sought, to 1 %, between two of the periods.
    progress
        Called with the runs done and their number, after each.

    Returns
    -------
    Periods
        A run settles if |x - x*| stays within 2 % of its initial norm in the last fifth; else it shrinks or
        grows, by its largest there and in the fifth before. What does not grow is survived.

    Raises
    ------
    ExperimentError
        For periods and times that make no sense.
    GameError
        For groups that do not have each player once.
    ModelError
        For a game that is a part itself or has external plants.
    VariableError
        For a start value that the game does not take.

    Examples
    --------
    >>> found = mog.periods("five_vehicles", [0.05, 0.2], stop_time=10.0)
    >>> [run.verdict for run in found.runs]
    ['settles', 'grows']
    """
    wanted = sorted({number_argument(each, "period", ExperimentError) for each in values})
    if not wanted:
        raise ExperimentError("no period is given")
    with Coupled(game, groups) as coupled, Simulator(coupled.model.path) as whole:
        model = coupled.model
        stop = (
            model.stop_time if stop_time is None else number_argument(stop_time, "stop_time", ExperimentError)
        )
        for each in wanted:
            if not each > 0.0:
                raise ExperimentError(f"period = {each:g} s is not positive")
            samples(0.0, stop, each)
            if each > LAST * stop:
                raise ExperimentError(
                    f"the period {each:g} s is longer than a fifth of the run of {stop:g} s"
                )
        study = _Study(coupled, whole, start_values or {}, stop, tolerance or model.tolerance)
        runs = []
        for number, each in enumerate(wanted, 1):
            runs.append(study.run(each))
            if progress is not None:
                progress(number, len(wanted))
        return Periods(
            title=model.title,
            groups=coupled.groups,
            stop_time=stop,
            whole_error=study.error,
            runs=tuple(runs),
            unperturbed_limit=_unperturbed_limit(model, coupled.groups, start_values or {}),
            survived=study.search(runs) if search else None,
            searched=search,
        )


class _Study:
    """Runs of the coupled parts, judged by the whole game's x* and against its actions."""

    def __init__(
        self,
        coupled: Coupled,
        whole: Simulator,
        start_values: Mapping[str, Value],
        stop: float,
        tolerance: float,
    ) -> None:
        self._coupled, self._whole = coupled, whole
        self._start, self._stop, self._tolerance = start_values, stop, tolerance
        whole_run = self.whole_run(coupled.model.step)
        self._x_star = whole_run.x_star
        self.error = whole_run.largest_error((1.0 - LAST) * stop)

    def whole_run(self, step: float) -> Result:
        """The whole game, sampled every step."""
        return self._whole.run(
            start_values=self._start,
            stop_time=self._stop,
            step=step,
            tolerance=self._tolerance,
            outputs=["x"],
        )

    def run(self, period: float, *, compared: bool = True) -> Period:
        """One period, compared with the whole game or not."""
        time = samples(0.0, self._stop, period)
        try:
            x = self._coupled.run(time, start_values=self._start, tolerance=self._tolerance)
        except SimulationError as error:
            return Period(period, "grows", np.inf, np.inf, str(error))
        norm = np.linalg.norm((x - self._x_star).reshape(len(time), -1), axis=1)
        last, before = (time >= (1.0 - part * LAST) * self._stop * (1.0 - 1e-9) for part in (1, 2))
        largest = norm[last].max()
        verdict: Verdict = "shrinks" if largest < norm[before & ~last].max() else "grows"
        return Period(
            period,
            "settles" if largest <= BAND * norm[0] else verdict,
            float(np.abs(x - self._x_star)[last].max()),
            float(np.abs(x - self.whole_run(period).x)[last].max()) if compared else np.nan,
        )

    def search(self, runs: Sequence[Period]) -> tuple[float, float] | None:
        """Periods on both sides of the longest one that is survived; None unless runs are on both."""
        grown = [k for k, run in enumerate(runs) if run.verdict == "grows"]
        if not grown or grown[0] == 0:
            return None
        inside, beyond = runs[grown[0] - 1].period, runs[grown[0]].period
        while beyond - inside > FINE * inside:
            middle = 0.5 * (inside + beyond)
            if self.run(middle, compared=False).verdict == "grows":
                beyond = middle
            else:
                inside = middle
        return inside, beyond


def _unperturbed_limit(
    model: Model, groups: Sequence[Collection[int]], start_values: Mapping[str, Value]
) -> float | None:
    parameters = game_parameters(model, start_values)
    states = (2 + parameters.players) * parameters.players
    if has_expressions(parameters.expressions, "cost") or states > LARGEST:
        return None
    return longest_period(parameters, groups)


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None
