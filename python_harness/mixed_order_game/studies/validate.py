"""Judges the paper's claims on an FMU: Theorems 1 and 2, Lemma 3, and what they rest on.

One rule for every game. The switches `robust` and `perturbed` are set for each run, whatever the game says.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from ..errors import ExperimentError, PlotError, SimulationError
from ..extras import need
from ..fmu.build import GameSource
from ..fmu.estimates import fmu_with_estimates
from ..fmu.model import Model
from ..fmu.run import Simulator
from ..game.definition import has_expressions
from ..game.parameters import GameParameters, game_parameters
from ..notebook import page, paragraph, table
from ..results.result import Result
from ..results.unknown_term import UNKNOWN, FloatArray, recorded_for_unknown_term
from ..theory.growing_modes import Stability, stability
from ..theory.linearized import linearized_loop
from .claims.archive import archive_valid
from .claims.control_bounds import control_bounds
from .claims.early_end import Ended, run_or_end
from .claims.equilibrium import equilibrium_claim, equilibrium_of_expressions
from .claims.explanation import explain
from .claims.neighbourhood import within_neighbourhood
from .claims.perturbed_run import PerturbedRun
from .claims.practical_convergence import Observed, nothing_to_observe, observe, practical_convergence
from .claims.tolerances import TOLERANCE
from .claims.unperturbed_loop import (
    LARGEST_LINEAR_LOOP,
    run_until_decay_is_seen,
    spectrum_of,
    unperturbed_actions_converge,
    unperturbed_loop_stable,
    unperturbed_run,
)
from .claims.verdict import Claim, Verdict
from .claims.weights import weights_bounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["LIMIT", "Claim", "Validation", "Verdict", "validate"]

LIMIT = 1000.0
"""Longest simulated time of a robust run, in s, in which it may settle."""

Report = Callable[[str, float], None]


@dataclass(frozen=True, eq=False, repr=False)
class Validation:
    """All claims about one FMU, with the runs that figures show."""

    model: Model
    claims: tuple[Claim, ...]
    notes: tuple[str, ...]  # why the neighbourhood has its size, and what else is worth knowing
    robust: Result | None  # the default experiment, robust and perturbed; None if it ended early
    plain: Result | None  # neither robust nor perturbed, until everything has decayed; None likewise

    def _repr_html_(self) -> str:
        """For notebooks: every claim with its verdict and the reason."""
        rows = [(claim.verdict.value, claim.statement, claim.reason) for claim in self.claims]
        notes = [paragraph(note) for note in self.notes]
        summary = paragraph(f"{self.summary()}.")
        return page(self.model.title, table(["verdict", "claim", "reason"], rows), *notes, summary)

    def __repr__(self) -> str:
        return f"<Validation {self.model.title}: {self.summary()}>"

    def plot(self, axes: "Axes | None" = None, *, width: float = 3.5) -> "Axes":
        """Draw the distance to the equilibrium of the runs that were judged, on a logarithmic axis.

        Parameters, what is returned and the need of Matplotlib are as for `Result.plot`.

        Raises
        ------
        PlotError
            If no run came to its end.
        """
        need("matplotlib")
        from ..results.plot import plot_error

        runs = {"robust, perturbed": self.robust, "neither": self.plain}
        ended = {label: run for label, run in runs.items() if run is not None}
        if not ended:
            raise PlotError("no run came to its end")
        return plot_error(ended, axes, width=width)

    @property
    def passed(self) -> bool:
        """Whether no claim fails."""
        return not self.named(Verdict.FAILS)

    @property
    def holds(self) -> bool:
        """Whether every claim holds."""
        return len(self.named(Verdict.HOLDS)) == len(self.claims)

    def named(self, *verdicts: Verdict) -> list[str]:
        """Names of the claims with one of these verdicts."""
        return [claim.name for claim in self.claims if claim.verdict in verdicts]

    def summary(self) -> str:
        """How many claims have which verdict."""
        if self.holds:
            return "Every claim holds"
        counts = [(len(self.named(verdict)), verdict.value) for verdict in Verdict]
        told = ", ".join(
            f"{count} {verdict if count == 1 else verdict.removesuffix('s')}"
            for count, verdict in counts
            if count
        )
        return f"Of {len(self.claims)} claims: {told}"

    def problem(self, *, strict: bool = False) -> str:
        """Which claims fail, or with strict do not hold, for a command that then exits with 1; else empty."""
        counted = [Verdict.FAILS, Verdict.NOT_COVERED, Verdict.NOT_SETTLED] if strict else [Verdict.FAILS]
        told = [f"{', '.join(self.named(each))}: {each.value}" for each in counted if self.named(each)]
        return "; ".join(told)

    def as_json(self) -> dict[str, Any]:
        """Plain values for json.dumps; a figure that is not finite becomes None."""

        def plain(claim: Claim) -> dict[str, Any]:
            figures = {name: value if math.isfinite(value) else None for name, value in claim.figures.items()}
            return {**asdict(claim), "verdict": claim.verdict.value, "figures": figures}

        return {
            "fmu": str(self.model.path),
            "title": self.model.title,
            "guid": self.model.guid,
            "passed": self.passed,
            "holds": self.holds,
            "summary": self.summary(),
            "claims": [plain(claim) for claim in self.claims],
            "notes": list(self.notes),
        }


def validate(
    game: GameSource = None,
    *,
    limit: float = LIMIT,
    neighbourhood: float | None = None,
    progress: Report | None = None,
) -> Validation:
    """Judge every claim of the paper on a game, by runs as long as it takes.

    Parameters
    ----------
    game
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`; the paper's example
        when left out.
    limit
        Longest simulated time of a robust run in s, in which it may settle.
    neighbourhood
        Largest |x - x*| wanted once settled, in the game's length unit: one more claim.
    progress
        Called with the name of a run and the part of it done, 0 to 1.

    Returns
    -------
    Validation
        Each claim with its verdict and the reason, and the runs that figures show.

    Raises
    ------
    GameError, ModelError
        For a game or FMU that is missing or is none.
    SimulationError
        For an FMU that cannot be loaded; for a limit or a neighbourhood that is not positive it is a
        ValueError, too.

    Examples
    --------
    >>> verdict = mog.validate("rivalling_pairs", limit=40.0)
    >>> verdict.claims[0].name, verdict.claims[0].verdict.value
    ('nash_equilibrium', 'holds')
    """
    for name, value in (("limit", limit), ("neighbourhood", neighbourhood)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ExperimentError(f"{name} = {value:g} is not positive")
    with Simulator(game) as simulator:
        return _judged(simulator, limit, neighbourhood, progress)


def _judged(
    simulator: Simulator, limit: float, neighbourhood: float | None, progress: Report | None
) -> Validation:
    model = simulator.model
    game = game_parameters(model)
    known = equilibrium_of_expressions(game, model.path)
    if has_expressions(game.expressions, "cost"):
        game = replace(game, x_star=_equilibrium_of(simulator))
    if known is not None and known.is_affine:
        game = _linear(simulator, game)
    equilibrium = equilibrium_claim(game, known)
    if equilibrium.verdict is Verdict.FAILS:
        claims = [
            equilibrium,
            *nothing_to_observe(game, Verdict.FAILS, equilibrium.reason),
            archive_valid(model.path),
        ]
        return Validation(model, tuple(claims), (), None, None)
    spectrum = spectrum_of(game)
    stability = unperturbed_loop_stable(game, spectrum, _locally(simulator, game))
    plain: Result | Ended
    if has_expressions(game.expressions, "cost") and game.jacobian is None:
        plain, spectrum = run_until_decay_is_seen(simulator, game, spectrum, limit, progress)
    else:
        known_to_grow = spectrum.abscissa is None and stability.verdict is Verdict.FAILS
        stop = model.stop_time if known_to_grow else None
        plain = unperturbed_run(simulator, game, spectrum, stop_time=stop, progress=progress)
    convergence = unperturbed_actions_converge(game, spectrum, plain, stability)
    robust = _default_experiment(simulator, game, progress)
    observed = None
    practical = _practical_despite(game, stability, convergence)
    if not practical:
        with _that_shows_the_unknown(simulator) as shown:
            practical = _unmeasured(shown.model, game)
            if not practical:
                observed = observe(
                    shown, game, slowest_rate=spectrum.slowest_rate, limit=limit, progress=progress
                )
                practical = practical_convergence(observed)
    claims = [equilibrium, *practical]
    if neighbourhood is not None:
        claims.append(within_neighbourhood(practical[0], neighbourhood))
    runs = [run.result for run in _runs(observed)] + ([robust] if isinstance(robust, Result) else [])
    claims += [weights_bounded(runs, game), stability, convergence, archive_valid(model.path)]
    return Validation(
        model=model,
        claims=tuple(claims),
        notes=(
            *(explain(run, game) for run in _runs(observed)[:1]),
            *control_bounds(robust if isinstance(robust, Result) else None, game, model.path),
            *_notes(game),
        ),
        robust=robust if isinstance(robust, Result) else None,
        plain=plain if isinstance(plain, Result) else None,
    )


def _linear(simulator: Simulator, game: GameParameters) -> GameParameters:
    """With the Jacobian of a pseudo-gradient that is affine; as it is where the loop is too large for it."""
    try:
        loop = linearized_loop(simulator)
    except SimulationError:
        return game
    return loop.game if game.players <= LARGEST_LINEAR_LOOP and not loop.is_large else game


def _locally(simulator: Simulator, game: GameParameters) -> float | Stability | None:
    """Of the loop linearized at x*, where it may not be linear: its spectral abscissa in 1/s.

    Of a large one it is whether it is stable.
    """
    if game.jacobian is not None or not has_expressions(game.expressions, "cost"):
        return None
    try:
        loop = linearized_loop(simulator)
    except SimulationError as error:
        return Stability(None, str(error))
    return stability(loop.game) if loop.is_large else loop.abscissa


def _default_experiment(
    simulator: Simulator, game: GameParameters, progress: Report | None
) -> Result | Ended:
    model = simulator.model

    def report(time: float) -> None:
        if progress is not None:
            progress("default", time / model.stop_time)

    return run_or_end(
        simulator,
        game,
        start_values={"robust": True, "perturbed": True},
        stop_time=model.stop_time,
        step=model.step,
        tolerance=TOLERANCE,
        fine_start=True,
        progress=report,
    )


def _practical_despite(game: GameParameters, stability: Claim, convergence: Claim) -> list[Claim]:
    """Theorem 1's claims where Theorem 2's decide them already, by an unstable loop; empty where not.

    Where the stability is not known, actions that leave x* show it.
    """
    if stability.verdict is Verdict.FAILS:
        known = stability.figures.get("abscissa")
        unstable = "modes grow" if known is None else f"spectral abscissa {known:.4g} 1/s"
    elif stability.verdict is Verdict.NOT_COVERED and convergence.verdict is Verdict.FAILS:
        unstable = "its actions leave x*"
    else:
        return []
    reason = (
        f"The unperturbed loop is unstable, {unstable}, and the robust part, being bounded, cannot hold "
        "actions that are far enough from x*."
    )
    return nothing_to_observe(game, Verdict.FAILS, reason)


@contextmanager
def _that_shows_the_unknown(simulator: Simulator) -> Iterator[Simulator]:
    """The simulator, or one of the same game that shows time derivatives where its file hides them."""
    fmu = simulator.model.path
    if recorded_for_unknown_term(simulator.model) is None:
        fmu = fmu_with_estimates(fmu)
    if fmu == simulator.model.path:
        yield simulator
    else:
        with Simulator(fmu) as shown:
            yield shown


def _unmeasured(model: Model, game: GameParameters) -> list[Claim]:
    """Theorem 1's claims where the FMU does not show the unknown term; empty where it does."""
    if recorded_for_unknown_term(model) is not None:
        return []
    unknown = has_expressions(game.expressions, *UNKNOWN)
    reason = (
        f"The residual g + d - W'S cannot be measured: {unknown}, and the game is too large for its FMU to "
        "show time derivatives unless its file asks for it."
    )
    return nothing_to_observe(game, Verdict.NOT_COVERED, reason)


def _notes(game: GameParameters) -> list[str]:
    """What settling rests on where the game file does not tell it."""
    notes = []
    cost, disturbance = (has_expressions(game.expressions, part) for part in ("cost", "disturbance"))
    if cost and game.jacobian is None:
        notes.append(f"The slowest rate is that of the unperturbed run: {cost}.")
    if disturbance:
        notes.append(
            "Whether the windows in which settling is judged span every period, and samples resolve it, "
            f"is not known: {disturbance}."
        )
    return notes


def _equilibrium_of(simulator: Simulator) -> FloatArray:
    """x* (N, D) of the FMU."""
    model = simulator.model
    names = [variable.name for _, variable in sorted(model.indexed("x_star").items())]
    return simulator.at_start(names, {}).reshape(model.players, model.dimension)


def _runs(observed: Observed | None) -> list[PerturbedRun]:
    if observed is None:
        return []
    return [run for run in (observed.run, observed.quarter) if isinstance(run, PerturbedRun)]
