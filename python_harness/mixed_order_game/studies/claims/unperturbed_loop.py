"""Theorem 2's claims: the unperturbed loop is exponentially stable, and its run is the exact solution.

For quadratic costs the loop is linear, s' = M s + c, without the robust part and without perturbations: its
eigenvalues tell stability, and the run is compared with x* + exp(M t) (s(0) - s*) from beginning to end, so
that decay that is too slow shows and decay that is too fast as well.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...fmu.model import Model
from ...fmu.run import Simulator
from ...game.definition import has_expressions
from ...game.parameters import GameParameters
from ...results.result import Result
from ...theory.growing_modes import Stability, stability
from ...theory.spectrum import consensus_rate, linear_loop, monotonicity_constant, predicted_deviation
from .early_end import GONE, Ended, run_or_end, size_of_actions
from .settling import EXTENSION, TIME_CONSTANTS, WINDOWS, Maxima, window_maxima, window_of
from .tolerances import PLAIN_TOLERANCE
from .verdict import Claim, Verdict

FloatArray = NDArray[np.float64]

LARGEST_LINEAR_LOOP = 30
"""Most players for which the dense linear loop (2 N + N^2 states) is set up."""

ZERO = 1e-12
"""A spectral abscissa of this part of the largest eigenvalue is zero to rounding."""

DECAY = 30.0
"""The run lasts until the slowest mode has fallen by exp(30)."""

LARGEST_GROWTH = 50.0
"""An unstable loop is run until its error has grown by exp(50) at most."""

INTERVALS = 3000

LEAST_SAMPLES = 20
"""Samples from which a rate of decay can be read."""

AGREEMENT = 1e-3
"""Difference between the run and the exact solution, as a part of the distance from x* still to come."""

RESOLVED = 1000.0
"""Differences of this many tolerances are above the integrator's."""


@dataclass(frozen=True)
class Spectrum:
    """Where the slowest mode lies; abscissa is None for a loop that may not be linear, or is too large."""

    abscissa: float | None  # 1/s
    marginal: bool  # zero to rounding
    slowest_rate: float  # 1/s, of what decays; 0 if nothing does

    @property
    def unstable(self) -> bool:
        """Whether a mode grows."""
        return self.abscissa is not None and self.abscissa > 0.0 and not self.marginal


def spectrum_of(game: GameParameters) -> Spectrum:
    """Eigenvalues of the linear loop; for large games rates of its parts in place of the slowest mode.

    No rate is known beforehand where a cost has an expression, unless the game holds the Jacobian that is the
    same everywhere: see slowest_rate_seen.
    """
    if has_expressions(game.expressions, "cost") and game.jacobian is None:
        return Spectrum(None, marginal=False, slowest_rate=0.0)
    if game.players > LARGEST_LINEAR_LOOP:
        pull = float(np.min(game.k2)) * monotonicity_constant(game)
        rates = (pull, consensus_rate(game), float(game.regulation.min()))
        return Spectrum(None, marginal=False, slowest_rate=max(0.0, min(rates)))
    eigenvalues = np.linalg.eigvals(linear_loop(game))
    abscissa = float(eigenvalues.real.max())
    marginal = abs(abscissa) <= ZERO * float(np.abs(eigenvalues).max())
    return Spectrum(abscissa, marginal=marginal, slowest_rate=max(0.0, -abscissa))


def unperturbed_loop_stable(
    game: GameParameters, spectrum: Spectrum, local: float | Stability | None = None
) -> Claim:
    """All eigenvalues have negative real parts.

    Where a cost has an expression, local is the spectral abscissa in 1/s of the loop linearized at x*, or
    whether that is stable: an unstable one refutes the claim, a stable one does not prove it.
    """
    expression = has_expressions(game.expressions, "cost") if game.jacobian is None else None
    abscissa = spectrum.abscissa
    if expression:
        abscissa = local if isinstance(local, float) else None

    def claim(verdict: Verdict, reason: str) -> Claim:
        statement = "Theorem 2: the unperturbed loop is exponentially stable"
        figures = {} if abscissa is None else {"abscissa": abscissa}
        return Claim("theorem_2_stability", statement, verdict, reason, figures)

    if expression:
        return claim(*_judged_near(local, expression))
    if abscissa is None:
        counted = stability(game)
        verdicts = {True: Verdict.HOLDS, False: Verdict.FAILS, None: Verdict.NOT_COVERED}
        return claim(verdicts[counted.stable], f"{counted.told[0].upper()}{counted.told[1:]}.")
    if spectrum.marginal:
        return claim(Verdict.NOT_SETTLED, f"The spectral abscissa is zero to rounding, {abscissa:.2g} 1/s.")
    if spectrum.unstable:
        return claim(Verdict.FAILS, f"The spectral abscissa is {abscissa:.4g} 1/s: a mode grows.")
    return claim(Verdict.HOLDS, f"The spectral abscissa is {abscissa:.4g} 1/s.")


def _judged_near(local: float | Stability | None, expression: str) -> tuple[Verdict, str]:
    """Of a loop that may not be linear, because of an expression."""
    told = f"The loop need not be linear, {expression}"
    if local is None:
        return Verdict.NOT_COVERED, f"{told}: it has no eigenvalues to judge."
    if isinstance(local, Stability):
        told += f"; linearized at x*, {local.told}"
        if local.stable is False:
            return Verdict.FAILS, f"{told}: they grow there."
        return Verdict.NOT_COVERED, f"{told}{': it is exponentially stable near x*' if local.stable else ''}."
    told += f"; linearized at x* its spectral abscissa is {local:.4g} 1/s: "
    if local > 0.0:
        return Verdict.FAILS, told + "a mode grows there."
    return Verdict.NOT_COVERED, told + (
        "it is exponentially stable near x*." if local < 0.0 else "zero to rounding, which decides nothing."
    )


def unperturbed_run(
    simulator: Simulator,
    game: GameParameters,
    spectrum: Spectrum,
    *,
    stop_time: float | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Result | Ended:
    """Run long enough to see everything decay, or grow; every sample of predicted_deviation's.

    stop_time in s, in place of one that follows from the spectrum.
    """
    if stop_time is None:
        stop_time = _stop_time(simulator.model, spectrum)

    def report(time: float) -> None:
        if progress is not None:
            progress("unperturbed", time / stop_time)

    return run_or_end(
        simulator,
        game,
        start_values={"robust": False, "perturbed": False},
        stop_time=stop_time,
        step=stop_time / INTERVALS,
        tolerance=PLAIN_TOLERANCE,
        progress=report,
    )


def _stop_time(model: Model, spectrum: Spectrum) -> float:
    if spectrum.unstable:
        return min(model.stop_time, LARGEST_GROWTH / (spectrum.abscissa or 1.0))
    return DECAY / spectrum.slowest_rate if spectrum.slowest_rate > 0.0 else model.stop_time


def unperturbed_actions_converge(
    game: GameParameters, spectrum: Spectrum, run: Result | Ended, stability: Claim | None = None
) -> Claim:
    """The run follows the exact solution down to x*, neither slower nor faster.

    stability: that of unperturbed_loop_stable, which decides where a large linear loop is unstable.
    """

    def claim(verdict: Verdict, reason: str, **figures: float) -> Claim:
        statement = "Theorem 2: unperturbed actions converge to x* as the exact solution does"
        return Claim("theorem_2_convergence", statement, verdict, reason, figures)

    linear = game.jacobian is not None or not has_expressions(game.expressions, "cost")
    grows = f"a mode grows at {spectrum.abscissa:.4g} 1/s." if spectrum.unstable else ""
    if linear and not grows and stability is not None and stability.verdict is Verdict.FAILS:
        grows = stability.reason
    if grows:
        return claim(Verdict.FAILS, f"The loop is unstable: {grows}")
    if isinstance(run, Ended):
        return claim(Verdict.FAILS if run.escaped else Verdict.NOT_SETTLED, str(run))
    if spectrum.abscissa is None:
        return claim(*_seen(run, has_expressions(game.expressions, "cost") or "the loop is too large"))
    if spectrum.marginal:
        return claim(Verdict.NOT_SETTLED, "The exact solution neither decays nor grows, to rounding.")
    times, exact = predicted_deviation(game, float(run.time[-1]), len(run.time) - 1)
    worst, time, seen, expected = largest_disagreement(run.x - run.x_star, exact, np.abs(run.x), times)
    end = float(np.abs(run.x[-1] - run.x_star).max())
    if worst > 1.0:
        reason = f"At {time:.3g} s the run is {seen:.4g} from x*, the exact solution {expected:.4g}."
        return claim(Verdict.FAILS, reason, disagreement=worst)
    reason = (
        f"The run agrees with exp(M t) from {float(np.abs(exact[0]).max()):.3g} to {end:.2g} from x* "
        f"within {AGREEMENT:.1%} of what is left."
    )
    return claim(Verdict.HOLDS, reason, disagreement=worst)


def largest_disagreement(
    seen: FloatArray, exact: FloatArray, size: FloatArray, times: FloatArray
) -> tuple[float, float, float, float]:
    """Worst difference of two deviations (T, N, D) over what is allowed, its time, and both distances there.

    Allowed at t: AGREEMENT times the largest exact deviation from t on, and what the integrator does not
    resolve of actions of this size (T, N, D).
    """
    still = np.maximum.accumulate(np.abs(exact).max(axis=(1, 2))[::-1])[::-1]
    allowed = AGREEMENT * still + RESOLVED * PLAIN_TOLERANCE * (size.max() + 0.01)
    ratio = np.abs(seen - exact).max(axis=(1, 2)) / allowed
    k = int(np.argmax(ratio))
    return float(ratio[k]), float(times[k]), float(np.abs(seen[k]).max()), float(np.abs(exact[k]).max())


def run_until_decay_is_seen(
    simulator: Simulator,
    game: GameParameters,
    spectrum: Spectrum,
    limit: float,
    progress: Callable[[str, float], None] | None,
) -> tuple[Result | Ended, Spectrum]:
    """For a loop without a known spectrum: the run, and the spectrum with the slowest rate that it shows.

    The run lasts the FMU's default experiment, or longer up to the limit in s until a rate is seen, or until
    it has gone.
    """
    stop = simulator.model.stop_time
    while True:
        run = unperturbed_run(simulator, game, spectrum, stop_time=stop, progress=progress)
        rate = slowest_rate_seen(run)
        if rate > 0.0 or isinstance(run, Ended) or stop >= limit or _has_gone(run, game):
            return run, replace(spectrum, slowest_rate=rate)
        stop = min(EXTENSION * stop, limit)


def slowest_rate_seen(run: Result | Ended) -> float:
    """Rate in 1/s at which the largest |x - x*| of a run fell: the slower of its last quarters.

    Samples that are not resolved are left out. 0 if the run ended early, or if the error did not fall by
    exp(TIME_CONSTANTS) in all.
    """
    if isinstance(run, Ended):
        return 0.0
    error = np.abs(run.x - run.x_star).max(axis=(1, 2))
    still = np.maximum.accumulate(error[::-1])[::-1]
    resolved = np.flatnonzero(still > _floor(run))
    end = int(resolved[-1]) if resolved.size else 0
    if end < LEAST_SAMPLES or not still[end] < still[0] * np.exp(-TIME_CONSTANTS):
        return 0.0
    quarters = [end // 2, 3 * end // 4, end]
    rates = -np.diff(np.log(still[quarters])) / np.diff(run.time[quarters])
    return max(0.0, float(rates.min()))


def _floor(run: Result, until: float = np.inf) -> float:
    """Distance from x* that the integrator does not resolve, by the largest action up to a time in s."""
    largest = float(np.abs(run.x[run.window(-np.inf, until)]).max())
    return RESOLVED * PLAIN_TOLERANCE * (largest + 0.01)


def _last_windows(run: Result) -> Maxima:
    """Of the largest |x - x*|; what is not resolved is that of the first of them, where a run may grow."""
    stop = float(run.time[-1])
    window = window_of(stop, 0.0)
    error = np.abs(run.x - run.x_star).max(axis=(1, 2))
    return window_maxima(run.time, error, window, _floor(run, stop - (WINDOWS - 1) * window))


def _has_gone(run: Result, game: GameParameters) -> bool:
    last = _last_windows(run)
    return last.grow and last.largest > GONE * size_of_actions(game)


def _seen(run: Result, why: str) -> tuple[Verdict, str]:
    """Of a loop without an exact solution; why in half a sentence."""
    last = _last_windows(run)
    if last.grow:
        return Verdict.FAILS, f"The largest |x - x*| grows from window to window: {last}."
    error = np.abs(run.x - run.x_star).max(axis=(1, 2))
    told = f"the run goes from {error[0]:.3g} to {error[-1]:.3g} from x* in {run.time[-1]:.4g} s"
    return Verdict.NOT_COVERED, f"There is no exact solution to compare with, as {why}; {told}."
