"""Judges the paper's claims on an FMU: Theorems 1 and 2, Lemma 3, and what they rest on.

Three runs: robust and perturbed (Theorem 1), neither (Theorem 2), perturbed but not robust (for comparison).
The two switches are set for each run, whatever the game file says.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .bounds import Bounds, bounds
from .errors import SimulationError
from .model import Model
from .parameters import GameParameters, game_parameters
from .results import Result
from .run import Simulator
from .spectrum import decay_rate, linear_loop, predicted_deviation, spectral_abscissa

TOLERANCE = 1e-8
PLAIN_TOLERANCE = 1e-10
CONVERGED = 1e-6
"""Theorem 2: the error that must be reached."""

WEIGHT_EXCESS = 1e-9
"""Lemma 3: relative rounding granted to w'w <= W_max."""

FITTED = (1e-4, 1e-8)
"""The decay rate is fitted while the error is between these parts of its start."""

RATE_AGREEMENT = 0.02
SLOWEST_RATE = 0.9
"""Least ratio of fitted rate to spectral abscissa. It is not 1: multiple eigenvalues, as those of the paper's
example, give t exp(-a t), which at the times fitted decays a few percent slower than exp(-a t)."""

SMALLEST_START = 1e-3
"""Least distance from the equilibrium at the start, for the fitted errors to be above the integrator's."""

LARGEST_GROWTH = 50.0
"""An unstable loop is run until its error has grown by exp(50) at most."""

LARGEST_LINEAR_LOOP = 30
"""Most players for which the dense linear loop (2 N + N^2 states) is set up."""


@dataclass(frozen=True)
class Claim:
    """One row of the verdict: passed is `figure relation bound`."""

    name: str
    statement: str
    figure: float
    bound: float
    unit: str
    passed: bool
    relation: str = "<="  # or "<", ">="


@dataclass(frozen=True, eq=False)
class Validation:
    """All claims of one FMU, with the runs they were judged on."""

    model: Model
    claims: tuple[Claim, ...]
    notes: tuple[str, ...]  # what could not be judged, and why
    robust: Result
    plain: Result

    @property
    def passed(self) -> bool:
        """Whether every claim holds."""
        return all(claim.passed for claim in self.claims)

    def as_json(self) -> dict[str, Any]:
        """Plain values for json.dumps; a figure or bound that is not finite becomes None."""

        def finite(value: object) -> object:
            return None if isinstance(value, float) and not math.isfinite(value) else value

        return {
            "fmu": str(self.model.path),
            "title": self.model.title,
            "guid": self.model.guid,
            "passed": self.passed,
            "claims": [{key: finite(value) for key, value in asdict(claim).items()} for claim in self.claims],
            "notes": list(self.notes),
        }


def validate(
    fmu: Path | str,
    *,
    neighbourhood: float | None = None,
    settle_time: float | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Validation:
    """Run the FMU three times and judge every claim.

    neighbourhood: largest |x - x*| allowed by Theorem 1, in the game's length unit.
    settle_time: time in s from which Theorem 1 is judged, up to the stop time of the default experiment.
    Defaults: bounds.bounds. progress is called with the name of a run and the part of it done, 0 to 1.
    Raises ModelError or SimulationError if the FMU cannot be read or run.
    """
    with Simulator(fmu) as simulator:
        model = simulator.model
        game = game_parameters(model)
        limits = bounds(model, game, neighbourhood=neighbourhood, settle_time=settle_time)
        if not 0.0 <= limits.settle_time < model.stop_time:
            raise SimulationError(
                f"settle time {limits.settle_time:g} s is not within the run of {model.stop_time:g} s"
            )
        notes: list[str] = []

        def report(name: str, stop: float) -> Callable[[float], None] | None:
            return None if progress is None else lambda time: progress(name, time / stop)

        def perturbed(name: str, *, robust: bool) -> Result:
            return simulator.run(
                start_values={"robust": robust, "perturbed": True},
                stop_time=model.stop_time,
                step=model.step,
                tolerance=TOLERANCE,
                progress=report(name, model.stop_time),
            )

        robust = perturbed("robust", robust=True)
        claims = [*_theorem_1(robust, limits), _weights_bounded(robust, game), _consensus(robust, limits)]

        if game.disturbance_bound.any() or game.dynamics_linear.any() or game.dynamics_square.any():
            try:
                bare: Result | None = perturbed("not robust", robust=False)
            except SimulationError as error:
                notes.append(f"Without the robust part the run ends early: {error}")
                bare = None
            claims.append(_rejection(robust, bare, limits))
        else:
            notes.append("Rejection is not judged: the game has no unknown dynamics and no disturbance.")

        plain_claims, plain = _theorem_2(simulator, game, limits, report, notes)
    claims += plain_claims
    claims.append(_archive(model.path))
    return Validation(model=model, claims=tuple(claims), notes=tuple(notes), robust=robust, plain=plain)


def _at_most(name: str, statement: str, figure: float, bound: float, unit: str) -> Claim:
    return Claim(name, statement, figure, bound, unit, passed=figure <= bound)


def _below(name: str, statement: str, figure: float, bound: float, unit: str) -> Claim:
    return Claim(name, statement, figure, bound, unit, passed=figure < bound, relation="<")


def _at_least(name: str, statement: str, figure: float, bound: float, unit: str) -> Claim:
    return Claim(name, statement, figure, bound, unit, passed=figure >= bound, relation=">=")


def _theorem_1(robust: Result, limits: Bounds) -> list[Claim]:
    since = f"from {limits.settle_time:g} s on"
    return [
        _below(
            "theorem_1_actions",
            f"Theorem 1: actions near the equilibrium, max |x - x*| {since}",
            robust.largest_error(limits.settle_time),
            limits.neighbourhood,
            "1",
        ),
        _below(
            "theorem_1_velocities",
            f"Theorem 1: velocities near zero, max |v| {since}",
            robust.largest_velocity(limits.settle_time),
            limits.velocity,
            "1/s",
        ),
    ]


def _weights_bounded(robust: Result, game: GameParameters) -> Claim:
    return _at_most(
        "lemma_3_weights",
        "Lemma 3: weights bounded, max w'w over columns and samples",
        float(np.max(robust.W_norm2)),
        game.W_max * (1.0 + WEIGHT_EXCESS),
        "1",
    )


def _consensus(robust: Result, limits: Bounds) -> Claim:
    chosen = robust.window(limits.settle_time, np.inf)
    return _below(
        "consensus",
        f"Consensus of the estimates, max |y - xbar|_2 from {limits.settle_time:g} s on",
        float(np.max(robust["consensus_error"][chosen])),
        limits.consensus,
        "1",
    )


def _rejection(robust: Result, bare: Result | None, limits: Bounds) -> Claim:
    without = math.inf if bare is None else bare.largest_error(limits.settle_time)
    return _at_least(
        "rejection",
        "Rejection of the perturbations, max |x - x*| without over with the robust part",
        without / robust.largest_error(limits.settle_time),
        limits.rejection,
        "1",
    )


def _theorem_2(
    simulator: Simulator,
    game: GameParameters,
    limits: Bounds,
    report: Callable[[str, float], Callable[[float], None] | None],
    notes: list[str],
) -> tuple[list[Claim], Result]:
    def plain(stop: float, step: float) -> Result:
        return simulator.run(
            start_values={"robust": False, "perturbed": False},
            stop_time=stop,
            step=step,
            tolerance=PLAIN_TOLERANCE,
            progress=report("unperturbed", stop),
        )

    model = simulator.model
    if game.players > LARGEST_LINEAR_LOOP:
        states = 2 * game.players + game.players**2
        notes.append(f"Theorem 2's rate is not judged: the linear loop has {states:,} states a coordinate.")
        result = plain(model.stop_time, model.step)
        return [_converged(result, limits.settle_time)], result

    abscissa = spectral_abscissa(linear_loop(game))
    stable = _below(
        "theorem_2_stability",
        "Theorem 2: unperturbed loop stable, spectral abscissa",
        abscissa,
        0.0,
        "1/s",
    )
    if not stable.passed:
        notes.append("Theorem 2's rate is not judged: the gains of this game do not stabilize it.")
        stop = model.stop_time if abscissa <= 0.0 else min(model.stop_time, LARGEST_GROWTH / abscissa)
        result = plain(stop, model.step)
        return [stable, _converged(result, 0.8 * stop)], result

    # Long enough for the error to fall by exp(30), 1e13.
    times, deviation = predicted_deviation(game, 30.0 / -abscissa, 3000)
    largest = np.abs(deviation).max(axis=(1, 2))
    error = np.linalg.norm(deviation, axis=(1, 2))
    begin, end = (_first_below(error, part * error[0]) for part in FITTED)
    settled = _first_below(largest, 0.5 * CONVERGED)
    time = limits.convergence_time if limits.convergence_time is not None else float(times[settled])
    last = min(int(1.5 * max(end, settled, int(np.searchsorted(times, time)))), len(times) - 1)
    result = plain(float(times[last]), float(times[1]))
    if error[0] < SMALLEST_START:
        notes.append(f"Theorem 2's rate is not judged: the game starts {error[0]:.2g} from its equilibrium.")
        return [_converged(result, time), stable], result
    fitted = decay_rate(result.time[begin:end], result.nash_error[begin:end])
    predicted = decay_rate(times[begin:end], error[begin:end])
    return [
        _converged(result, time),
        stable,
        _at_most(
            "theorem_2_rate",
            f"Theorem 2: decay as predicted, relative deviation of the fitted rate from {predicted:.4g} 1/s",
            abs(fitted - predicted) / predicted,
            RATE_AGREEMENT,
            "1",
        ),
        _at_least(
            "theorem_2_exponential",
            f"Theorem 2: exponential decay, fitted rate {fitted:.4g} 1/s over the spectral abscissa",
            fitted / -abscissa,
            SLOWEST_RATE,
            "1",
        ),
    ], result


def _converged(plain: Result, time: float) -> Claim:
    return _below(
        "theorem_2_convergence",
        f"Theorem 2: unperturbed actions converge, max |x - x*| from {time:.3g} s on",
        plain.largest_error(time),
        CONVERGED,
        "1",
    )


def _first_below(values: NDArray[np.float64], bound: float) -> int:
    """Index from which all values are below the bound, at most the last one."""
    above = np.flatnonzero(values >= bound)
    return min(int(above[-1]) + 1 if above.size else 0, len(values) - 1)


def _archive(path: Path) -> Claim:
    from fmpy.validation import validate_fmu

    problems = validate_fmu(str(path))
    told = f": {problems[0]}" if problems else ""
    return _at_most("archive", f"Archive valid, findings of fmpy{told}", float(len(problems)), 0.0, "1")
