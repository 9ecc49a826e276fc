"""The claim that there is a Nash equilibrium for the actions to converge to."""

from pathlib import Path

import numpy as np

from ...errors import GameError
from ...game.definition import has_expressions
from ...game.equilibrium import Equilibrium, Kind, judge_equilibrium
from ...game.parameters import GameParameters
from ...theory.spectrum import monotonicity_constant, nash_equilibrium
from .verdict import Claim, Verdict

UNIQUE = "There is a unique Nash equilibrium x*"

FLAT = 1e-12
"""Curvatures of this part of their terms are zero to rounding."""


def nash_equilibrium_exists(game: GameParameters, fmu: Path) -> Claim:
    """Gradients vanish at one point and no player's own cost is concave there.

    An FMU whose costs have expressions cannot be instantiated unless it found such a point; what is known of
    it is judged by the game in the FMU.
    """
    return equilibrium_claim(game, equilibrium_of_expressions(game, fmu))


def equilibrium_of_expressions(game: GameParameters, fmu: Path) -> Equilibrium | None:
    """What is known of x* where a cost has an expression; None of other games."""
    return judge_equilibrium(fmu) if has_expressions(game.expressions, "cost") else None


def equilibrium_claim(game: GameParameters, found: Equilibrium | None) -> Claim:
    """The claim, by what is known of costs with expressions, or by coefficients."""
    if found is not None:
        return _of_expressions(found)
    verdict, reason = _judge(game)
    figures = {"m": monotonicity_constant(game)}
    return Claim("nash_equilibrium", UNIQUE, verdict, reason, figures)


def _of_expressions(found: Equilibrium) -> Claim:
    figures = {"m": found.monotonicity, "convex_within": float(found.convex_within.min())}
    verdict = Verdict.NOT_SETTLED if found.kind is Kind.OPEN else Verdict.HOLDS
    warnings = [each for each in found.warnings if each != found.sentence]
    only = found.kind is Kind.NASH and found.is_affine
    told = [found.sentence, *(warnings or ([] if only else ["That it is the only one is not proved."]))]
    statement = UNIQUE if only else "x* is a Nash equilibrium, if only a local one"
    return Claim("nash_equilibrium", statement, verdict, " ".join(told), figures)


def _judge(game: GameParameters) -> tuple[Verdict, str]:
    coupling = game.cost_coupling - np.diag(np.diag(game.cost_coupling))
    curvature = game.cost_quadratic + coupling.sum(axis=1)
    scale = np.abs(game.cost_quadratic) + np.abs(coupling).sum(axis=1)
    least = int(np.argmin(np.where(scale > 0.0, curvature / np.where(scale > 0.0, scale, 1.0), 0.0)))
    if curvature[least] < -FLAT * scale[least]:
        return Verdict.FAILS, (
            f"The cost of player {least + 1} is concave in its own action, curvature "
            f"{2.0 * curvature[least]:.3g}: where the gradients vanish it has a maximum."
        )
    try:
        nash_equilibrium(game)
    except GameError:
        return Verdict.FAILS, "The gradients of all players do not vanish at exactly one point."
    m = monotonicity_constant(game)
    if m > 0.0:
        return Verdict.HOLDS, f"The pseudo-gradient is strongly monotone, m = {m:.3g}."
    return Verdict.HOLDS, (
        "Every cost is convex in its player's own action; the pseudo-gradient is not strongly monotone as "
        f"the theorems suppose, m = {m:.3g}."
    )
