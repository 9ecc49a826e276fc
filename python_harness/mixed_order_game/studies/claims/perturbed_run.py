"""A run of the robust strategy against its perturbations, and what is measured on its last windows."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...fmu.model import Value
from ...fmu.run import Progress, Simulator
from ...game.definition import has_expressions
from ...game.parameters import GameParameters, OfPlayers
from ...results.result import Result
from ...results.unknown_term import recorded_for_unknown_term, unknown_term
from ...theory.spectrum import gradient_map
from .early_end import Ended, run_or_end
from .settling import WINDOWS, Maxima, window_maxima, window_of
from .tolerances import TOLERANCE

FloatArray = NDArray[np.float64]

RESOLVED = 10.0
"""Errors of this many tolerances are above those of the integrator."""

PER_WINDOW = 200
PER_PERIOD = 50
MOST_PER_WINDOW = 1000
LARGEST_RECORD = 50_000_000
"""Samples of the shortest window and of the fastest disturbance's period; limits of samples and numbers."""

RECORDED = ("x", "v", "z", "u", "nn", "phi", "W_norm2", "consensus_error")


@dataclass(frozen=True, eq=False)
class PerturbedRun:
    """One run and the largest values in its last three windows."""

    result: Result
    unknown: FloatArray  # g_i(x) + d_i(t), (T, N, D)
    judged: NDArray[np.bool_]  # (T,), true in the last three windows
    actions: Maxima  # |x_il - x*_il|
    residual: Maxima  # |g_i(x) + d_i(t) - W_i'S_i|, what is left to the robust term
    velocities: Maxima  # |v_il| of second-order players
    estimates: Maxima  # 2-norm of all y_ij - xbar_j

    @property
    def stop_time(self) -> float:
        """End of the run in s."""
        return float(self.result.time[-1])

    def signal(self, name: str) -> Maxima:
        """One of the four by its name."""
        maxima: Maxima = getattr(self, name)
        return maxima

    @property
    def settled(self) -> bool:
        """Whether the window maxima of every signal agree."""
        return all(each.agree for each in (self.actions, self.residual, self.velocities, self.estimates))


def disturbance_periods(values: Mapping[str, float | bool], game: GameParameters) -> FloatArray:
    """Periods in s of all sinusoids with an amplitude, from the values of the FMU's parameters."""
    entries = [(i, k) for i in range(1, game.players + 1) for k in range(1, game.dimension + 1)]
    pairs = [
        (abs(values[f"disturbance_amplitude[{i},{k}]"]), abs(values[f"disturbance_frequency[{i},{k}]"]))
        for i, k in entries
    ]
    return np.array([2.0 * np.pi / frequency for amplitude, frequency in pairs if amplitude * frequency > 0])


def sample_step(window: float, periods: FloatArray) -> float:
    """Time between samples, in s, that finds the largest values of a window of that length."""
    fastest = float(periods.min(initial=np.inf))
    return max(min(window / PER_WINDOW, fastest / PER_PERIOD), window / MOST_PER_WINDOW)


def perturbed_run(
    simulator: Simulator,
    game: GameParameters,
    *,
    epsilon: OfPlayers,
    stop_time: float,
    step: float,
    least_window: float = 0.0,
    progress: Progress | None = None,
) -> PerturbedRun | Ended:
    """Run from 0 to stop_time with these widths of the boundary layer, sampled every step, times in s.

    epsilon: one number, or one of each player. least_window: shortest window that may be judged, in s.
    """
    model = simulator.model
    recorded = [stem for stem in RECORDED if stem in model.variables or model.indexed(stem)]
    recorded += recorded_for_unknown_term(model) or []
    count = len(model.select(recorded))
    step = max(step, stop_time * count / LARGEST_RECORD)

    widths: dict[str, Value] = (
        {"epsilon": epsilon}
        if isinstance(epsilon, float)
        else {f"epsilon[{i}]": float(width) for i, width in enumerate(epsilon, start=1)}
    )

    result = run_or_end(
        simulator,
        game,
        start_values={"robust": True, "perturbed": True, **widths},
        stop_time=stop_time,
        step=step,
        tolerance=TOLERANCE,
        outputs=recorded,
        progress=progress,
    )
    if isinstance(result, Ended):
        return result
    return _measured(result, game, window_of(stop_time, least_window))


def _measured(result: Result, game: GameParameters, window: float) -> PerturbedRun:
    unknown = unknown_term(game, result)
    judged = result.window(result.time[-1] - WINDOWS * window, np.inf)
    first = result.window(result.time[-1] - WINDOWS * window, result.time[-1] - (WINDOWS - 1) * window)
    largest = float(np.abs(result.x[first]).max())  # later ones of a run that grows say nothing of its start
    floor = RESOLVED * TOLERANCE * (largest + 0.01)
    steepest = 1.0  # 1/s, where it is not known
    if not has_expressions(game.expressions, "cost"):
        steepest = float((game.of_players("k2") * np.abs(gradient_map(game)).sum(axis=1)).max())
    pushed = max(float(np.abs(unknown[judged]).max()), float(np.abs(result.nn[judged]).max()))

    def maxima(values: FloatArray, resolved: float) -> Maxima:
        return window_maxima(result.time, values, window, resolved)

    def entries(values: FloatArray) -> FloatArray:
        return np.asarray(np.abs(values).max(axis=(1, 2)))

    return PerturbedRun(
        result=result,
        unknown=unknown,
        judged=judged,
        actions=maxima(entries(result.x - result.x_star), floor),
        residual=maxima(entries(unknown - result.nn), RESOLVED * TOLERANCE * (pushed + 0.01)),
        velocities=maxima(entries(np.nan_to_num(result.v)), floor * steepest),
        estimates=maxima(result["consensus_error"], floor * np.sqrt(game.players)),
    )
