"""What a report is made from: runs of one game, the judged claims, and what is known of the unknown."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError, ModelError, ResultError, SimulationError
from ..fmu.model import Model, Value
from ..fmu.run import Simulator
from ..game.definition import has_expressions
from ..game.equilibrium import has_affine_gradients
from ..game.parameters import GameParameters, game_parameters
from ..results.result import Result
from ..results.time_figures import MOST_ESTIMATING
from ..results.unknown_term import UNKNOWN, recorded_for_unknown_term, unknown_term
from ..studies.claims.tolerances import PLAIN_TOLERANCE, TOLERANCE
from ..studies.claims.unperturbed_loop import LARGEST_LINEAR_LOOP
from ..studies.validate import Validation, validate
from ..theory.analysis import analyse
from ..theory.findings import Analysis, Progress
from ..theory.linearized import linearized_loop
from ..theory.spectrum import linear_loop, spectral_abscissa
from ..times import in_seconds

FloatArray = NDArray[np.float64]

ON_SPHERE = 1e-9
"""Relative distance of w'w from W_max within which a column counts as on the sphere."""


FAR = 1e3
"""Durations of a run from which on its start, Unix time, say, would fill the axis of time with digits."""

STORED = (
    "This page is made from a stored run: what needs the game itself, the claims, the predicted rate and the "
    "unknown term, is left out."
)


@dataclass(frozen=True, eq=False)
class Evidence:
    """One run and what belongs to it; what is None could not be had from the source."""

    result: Result
    model: Model | None = None
    changes: Mapping[str, Value] | None = None
    plain: Result | None = None  # the same game, neither perturbed nor robust
    abscissa: float | None = None  # of the linear loop of that game, 1/s
    unknown: FloatArray | None = None  # g_i(x) + d_i(t) + d_ext along the run, (T, N, D)
    validation: Validation | None = None
    analysis: Analysis | None = None  # without runs
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether no claim fails."""
        return self.validation is None or self.validation.passed


def _predicted_rate(
    simulator: Simulator, game: GameParameters, changes: Mapping[str, Value], analysis: Analysis | None
) -> tuple[float | None, list[str]]:
    """Spectral abscissa of the unperturbed loop in 1/s, and what there is to be told of it.

    Of a large loop it is a bound, from the analysis.
    """
    cost = has_expressions(game.expressions, "cost")
    if cost:
        try:
            loop = linearized_loop(simulator, changes)
        except SimulationError as error:
            return None, [f"No rate is predicted: {cost}, and {error}."]
        if loop.is_large:
            return _bound_of_rate(analysis, f", for near x* alone: {cost}")
        abscissa = loop.abscissa
        if has_affine_gradients(simulator.model.path, game.expressions):
            return abscissa, []
        return abscissa, [
            f"The predicted rate is that of the loop linearized at x*, for near x* alone: {cost}."
        ]
    if game.players > LARGEST_LINEAR_LOOP:
        return _bound_of_rate(analysis, "")
    return spectral_abscissa(linear_loop(game)), []


def _bound_of_rate(analysis: Analysis | None, near: str) -> tuple[float | None, list[str]]:
    """Minus the rate of a loop that is too large for its eigenvalues; near ends the sentence."""
    rows = () if analysis is None else analysis.rows
    rate = next((float(row.value) for row in rows if row.name == "slowest rate"), None)
    if rate is None:
        return None, ["No rate is predicted: the linear loop is too large for its eigenvalues."]
    told = "The predicted rate is a lower bound, as the linear loop is too large for its eigenvalues"
    return -rate, [f"{told}{near}."]


def _analysis(
    fmu: Path | str, changes: Mapping[str, Value], progress: Progress | None
) -> tuple[Analysis | None, list[str]]:
    """The analysis without runs, and why there is none."""
    try:
        return analyse(fmu, changes=changes, simulation=False, progress=progress), []
    except (GameError, ModelError, SimulationError) as error:
        return None, [f"There is no analysis: {error}."]


def evidence_of_game(
    fmu: Path | str,
    *,
    changes: Mapping[str, Value] | None = None,
    claims: bool = True,
    stop_time: float | None = None,
    progress: Progress | None = None,
) -> Evidence:
    """Run an FMU as it stands and unperturbed, and judge its claims.

    changes: start values in place of the FMU's own; the claims, which are about the game as it stands, are
    then left out. stop_time in s. progress is called with the name of a run and the part of it done.
    Raises what Simulator and validate raise.
    """
    notes: list[str] = []
    with Simulator(fmu) as simulator:
        model = simulator.model
        stop = model.stop_time if stop_time is None else stop_time
        game = game_parameters(model, changes)

        def simulate(
            name: str, settings: Mapping[str, Value], tolerance: float, *, estimates: bool
        ) -> Result:
            return simulator.run(
                start_values=settings,
                stop_time=stop,
                step=model.step,
                tolerance=tolerance,
                outputs=[*model.signals(estimates=estimates), *(rates or [])] if estimates or rates else None,
                progress=None if progress is None else lambda time: progress(name, time / stop),
                fine_start=True,
            )

        rates = recorded_for_unknown_term(model)
        estimates = bool(model.indexed("y")) and model.players <= MOST_ESTIMATING
        result = simulate("run", changes or {}, TOLERANCE, estimates=estimates)
        off = {**(changes or {}), "robust": False, "perturbed": False}
        plain = simulate("unperturbed run", off, PLAIN_TOLERANCE, estimates=False)
        analysis, without = _analysis(fmu, changes or {}, progress)
        abscissa, note = _predicted_rate(simulator, game, changes or {}, analysis)
        notes += note
    if not estimates:
        many = f"there are N^2 D of them, and N = {model.players} exceeds {MOST_ESTIMATING}"
        why = many if model.players > MOST_ESTIMATING else "the FMU does not expose them"
        notes.append(f"Estimates are not drawn one by one: {why}.")
    if rates is None:
        unknown = has_expressions(game.expressions, *UNKNOWN)
        notes.append(f"The unknown term is not drawn: {unknown}, and the FMU exposes no time derivatives.")
    notes += without
    validation = None
    if changes:
        notes.append("The claims are about the game as it stands; this run has changed parameters.")
    elif claims:
        validation = validate(fmu, progress=progress)
    return Evidence(
        result=result,
        model=model,
        changes=changes,
        plain=plain,
        abscissa=abscissa,
        unknown=None if rates is None else unknown_term(game, result),
        validation=validation,
        analysis=analysis,
        notes=tuple(notes),
    )


def thinned(evidence: Evidence, samples: int) -> Evidence:
    """The same with at most so many samples of each run, evenly chosen among them, and both ends."""

    def chosen(count: int) -> NDArray[np.int_]:
        return np.unique(np.linspace(0, count - 1, min(count, samples)).round().astype(int))

    def thin(result: Result) -> Result:
        kept = chosen(len(result.time))
        columns = {name: column[kept] for name, column in result.columns.items()}
        return replace(result, time=result.time[kept], columns=columns)

    unknown = evidence.unknown
    return replace(
        evidence,
        result=thin(evidence.result),
        plain=None if evidence.plain is None else thin(evidence.plain),
        unknown=None if unknown is None else unknown[chosen(len(unknown))],
    )


def evidence_of_result(result: Result) -> Evidence:
    """A report of a stored run alone: no claims, no prediction, no unknown term."""
    notes = [STORED]
    start, span = float(result.time[0]), float(result.time[-1] - result.time[0])
    if abs(start) > FAR * span:
        result = replace(result, time=result.time - start)
        notes.append(f"Times count from the start of the run at {in_seconds(start)}.")
    return Evidence(result=result, notes=tuple(notes))


def shared_signal(result: Result) -> FloatArray | None:
    """xbar (T, N, D), what players share; None if z or x was not recorded."""
    try:
        return result.xbar
    except ResultError:
        return None


def weight_bound(result: Result) -> float | None:
    """W_max of a run; None if its parameters are unknown."""
    bound = result.parameters.get("W_max")
    return None if bound is None else float(bound)


def sphere_switches(result: Result) -> list[tuple[int, int, int, bool]]:
    """Columns seen to reach or leave the sphere: (sample, player, coordinate, whether it enters), 0-based.

    Only what shows between two samples; solver_events counts every switch.
    """
    bound = weight_bound(result)
    if bound is None:
        return []
    on = result.W_norm2 >= bound * (1.0 - ON_SPHERE)
    return [
        (int(t) + 1, int(i), int(coordinate), bool(on[t + 1, i, coordinate]))
        for t, i, coordinate in np.argwhere(on[1:] != on[:-1])
    ]


def energy_so_far(result: Result) -> FloatArray:
    """Integral of |u_i|^2 from the start, (T, N), by the trapezoidal rule over the samples."""
    power = np.sum(result.u**2, axis=2)
    steps = 0.5 * (power[1:] + power[:-1]) * np.diff(result.time)[:, np.newaxis]
    return np.vstack([np.zeros(power.shape[1]), np.cumsum(steps, axis=0)])
