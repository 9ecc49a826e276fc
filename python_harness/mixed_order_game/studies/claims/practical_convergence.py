"""Practical convergence: the actions settle near x*, and a thinner boundary layer brings them nearer.

Theorem 1 promises a neighbourhood as small as one likes for gains that are large enough. Whether those of a
game are large enough is seen on runs: one with its own epsilon and one with a quarter of it, each made longer
until it has settled or a limit is reached.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...fmu.model import Value
from ...fmu.run import Simulator
from ...game.parameters import GameParameters, OfPlayers
from .early_end import GONE, Ended, size_of_actions
from .perturbed_run import PerturbedRun, disturbance_periods, perturbed_run, sample_step
from .seeking_error import layer_slope
from .settling import AGREEMENT, SHORTEST, Maxima, horizons, least_window
from .verdict import Claim, Verdict

FloatArray = NDArray[np.float64]

QUARTER = 0.25
"""Part of epsilon with which the second run is made."""

MEASURED = {
    "actions": "|x - x*|",
    "velocities": "|v|",
    "estimates": "|y - xbar|",
    "residual": "|g + d - W'S|",
}
"""What is measured of each signal of a PerturbedRun."""

STATEMENTS = {
    "actions": "Practical convergence: actions settle near x*",
    "velocities": "Practical convergence: velocities settle near zero",
    "estimates": "Practical convergence: estimates settle near what they estimate",
}

Report = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Observed:
    """The longest runs that were made, with the game's epsilon and with a quarter of it."""

    game: GameParameters
    limit: float  # s, longest run allowed
    window: float  # s, shortest window that may be judged
    dominates: bool  # the boundary layer, over the gains and the adaptation
    run: PerturbedRun | Ended
    quarter: PerturbedRun | Ended | None  # None: the first run decided

    @property
    def settled(self) -> bool:
        """Whether both runs have settled and compare as they should."""
        if not (isinstance(self.run, PerturbedRun) and isinstance(self.quarter, PerturbedRun)):
            return False
        runs = self.run, self.quarter
        return all(run.settled for run in runs) and not any(
            _not_shrunk(self.run.signal(each), self.quarter.signal(each), dominates=self.dominates)
            for each in STATEMENTS
        )


def observe(
    simulator: Simulator,
    game: GameParameters,
    *,
    slowest_rate: float,
    limit: float,
    progress: Report | None = None,
) -> Observed:
    """Run until settled or gone, or the limit in s. slowest_rate: of the unperturbed loop, in 1/s."""
    values = simulator.model.start_values()
    periods = disturbance_periods(values, game)
    window = least_window(slowest_rate, periods)
    step = sample_step(min(window, limit / SHORTEST), periods)
    dominates = layer_dominates(game, values, periods, simulator.model.neurons)

    def run(name: str, epsilon: OfPlayers, stop: float) -> PerturbedRun | Ended:
        def report(time: float) -> None:
            if progress is not None:
                progress(name, time / limit)

        return perturbed_run(
            simulator,
            game,
            epsilon=epsilon,
            stop_time=stop,
            step=step,
            least_window=window,
            progress=report,
        )

    for stop in horizons(window, limit):
        own = run("robust", game.epsilon, stop)
        seen = Observed(game, limit, window, dominates, own, None)
        if isinstance(own, Ended) or (
            own.actions.grow and own.actions.largest > GONE * size_of_actions(game)
        ):
            break
        ready = own.actions.agree and own.residual.agree and SHORTEST * window <= stop
        if not ready or (not own.settled and stop < limit):
            continue
        if _saturates(own, game, ""):
            break
        thinner = run("a quarter of epsilon", QUARTER * game.epsilon, stop)
        seen = Observed(game, limit, window, dominates, own, thinner)
        if isinstance(thinner, Ended) or seen.settled:
            break
    if progress is not None:
        progress("robust", 1.0)
        progress("a quarter of epsilon", 1.0)
    return seen


def layer_dominates(
    game: GameParameters, values: dict[str, Value], periods: FloatArray, neurons: int
) -> bool:
    """Whether the slope K delta^2 / epsilon exceeds what else holds the seeking error.

    Against a disturbance of angular frequency w that is e = residual / (j w + k + slope): the gain k, and the
    adaptation, W'S = beta S'S e / (j w), S'S at most the number of neurons.
    """
    if not periods.size:
        return False
    beta = np.array([values.get(f"beta[{i}]", values.get("beta")) for i in range(1, game.players + 1)])
    adaptation = beta * neurons * float(periods.max()) / (2.0 * np.pi)
    slope = layer_slope(game.of_players("delta"), game.of_players("epsilon"))
    return bool(np.all(slope > np.maximum(game.regulation, adaptation)))


def practical_convergence(observed: Observed) -> list[Claim]:
    """The claims about actions, velocities and estimates, by one rule."""
    return [_judge(observed, signal) for signal in _judged(observed.game)]


def nothing_to_observe(game: GameParameters, verdict: Verdict, reason: str) -> list[Claim]:
    """The same claims where no run is needed to judge them."""
    return [Claim(_name(signal), STATEMENTS[signal], verdict, reason) for signal in _judged(game)]


def _judged(game: GameParameters) -> list[str]:
    second = bool((~game.first_order).any())
    return [signal for signal in STATEMENTS if second or signal != "velocities"]


def _name(signal: str) -> str:
    return f"practical_convergence_{signal}"


Found = tuple[Verdict, str] | None


def _judge(observed: Observed, signal: str) -> Claim:
    """The first of the rule's checks that has something to say decides; when none has, the claim holds."""
    name, statement = _name(signal), STATEMENTS[signal]
    found: Found
    if isinstance(observed.run, Ended):
        found = Verdict.FAILS if observed.run.escaped else Verdict.NOT_SETTLED, str(observed.run)
        return Claim(name, statement, *found, {"time": observed.run.time, "largest": observed.run.error})
    run, quarter = observed.run, observed.quarter
    figures = {
        "time": run.stop_time,
        "largest": run.signal(signal).largest,
        "residual": run.residual.largest,
    }
    if isinstance(quarter, PerturbedRun):
        figures["quarter"] = quarter.signal(signal).largest
    found = (
        _too_short(observed)
        or _grows(run, signal)
        or _saturates(run, observed.game, "")
        or _unsettled(run, signal, "")
        or _of_quarter(observed, run, signal)
    )
    return Claim(name, statement, *(found or _holds(run, signal, figures)), figures)


def _too_short(observed: Observed) -> Found:
    least = SHORTEST * observed.window
    if least <= observed.limit:
        return None
    if not np.isfinite(least):
        return (
            Verdict.NOT_SETTLED,
            "How long a run is needed is not known: no rate of decay of the unperturbed loop is known.",
        )
    return Verdict.NOT_SETTLED, (
        f"A run of {least:.4g} s is needed, with windows of three time constants and one period of the "
        f"disturbance; the limit is {observed.limit:.4g} s."
    )


def _grows(run: PerturbedRun, signal: str) -> Found:
    for kind in dict.fromkeys((signal, "actions")):
        if run.signal(kind).grow:
            told = f"The largest {MEASURED[kind]} grows from window to window"
            return Verdict.FAILS, f"{told}: {run.signal(kind)} {_by(run)}."
    return None


def _saturates(run: PerturbedRun, game: GameParameters, which: str) -> Found:
    residual, of_player, delta = run.residual.largest, "", game.delta
    if not isinstance(delta, float):
        residuals = np.abs((run.unknown - run.result.nn)[run.judged]).max(axis=(0, 2))  # (N,)
        i = int(np.argmax(residuals - delta))
        residual, of_player, delta = float(residuals[i]), f" of player {i + 1}", float(delta[i])
    if residual < delta or residual <= run.residual.floor:
        return None
    return Verdict.NOT_COVERED, (
        f"{which}The residual g + d - W'S{of_player} reaches {residual:.3g} {_by(run)} and "
        f"delta is {delta:.3g}: "
        f"the robust term saturates; the largest |x - x*| is {run.actions.largest:.3g}."
    )


def _unsettled(run: PerturbedRun, signal: str, which: str) -> Found:
    for kind in dict.fromkeys((signal, "actions", "residual")):
        if not run.signal(kind).agree:
            told = f"{which}The largest {MEASURED[kind]} differs between the last three windows"
            return Verdict.NOT_SETTLED, f"{told}: {run.signal(kind)} {_by(run)}."
    return None


def _of_quarter(observed: Observed, run: PerturbedRun, signal: str) -> Found:
    which, quarter = "With a quarter of epsilon: ", observed.quarter
    if not isinstance(quarter, PerturbedRun):
        return Verdict.NOT_SETTLED, f"{which}{quarter or 'not run.'}"
    own, thinner = run.signal(signal), quarter.signal(signal)
    found = _saturates(quarter, observed.game, which) or _unsettled(quarter, signal, which)
    if found:
        return found
    problem = _not_shrunk(own, thinner, dominates=observed.dominates)
    if problem:
        told = f"{MEASURED[signal]} reaches {own.largest:.3g} {_by(run)}, {thinner.largest:.3g} with it"
        return Verdict.NOT_SETTLED, f"A quarter of epsilon {problem} the neighbourhood: {told}."
    return None


def _not_shrunk(own: Maxima, thinner: Maxima, *, dominates: bool) -> str:
    """What a quarter of epsilon does to the neighbourhood that it should not; empty if nothing."""
    largest, size = max(thinner.largest, own.floor), max(own.largest, own.floor)
    if largest > (1.0 + AGREEMENT) * size:
        return "enlarges"
    if dominates and size > own.floor / QUARTER and largest > (1.0 - AGREEMENT) * size:
        return "does not shrink"
    return ""


def _holds(run: PerturbedRun, signal: str, figures: dict[str, float]) -> tuple[Verdict, str]:
    own = run.signal(signal)
    settled = f"The largest {MEASURED[signal]} settled at {own.largest:.3g} {_by(run)}"
    if own.largest <= own.floor:
        return Verdict.HOLDS, f"{settled}, below what the integrator resolves."
    return Verdict.HOLDS, f"{settled}, at {figures['quarter']:.3g} with a quarter of epsilon."


def _by(run: PerturbedRun) -> str:
    return f"by {run.stop_time:.4g} s"
