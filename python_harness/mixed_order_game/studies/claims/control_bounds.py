"""What bounds u_max of the controls do to the claims: the theorems know none."""

import numpy as np

from ...game.definition import has_expressions
from ...game.parameters import FloatArray, GameParameters
from ...results.result import Result
from ...results.unknown_term import UNKNOWN
from ...theory.spectrum import nash_equilibrium


def at_bound(u: FloatArray, game: GameParameters) -> np.ndarray:
    """Where controls u (T, N, D) are at their bounds, up to the rounding of a result file."""
    return np.abs(u) >= game.u_max * (1.0 - 1e-12)


def control_bounds(run: Result | None, game: GameParameters) -> list[str]:
    """What to tell of a game with bounded controls, and of its default experiment; empty for others."""
    if not np.isfinite(game.u_max).any():
        return []
    told = (
        "Controls are bounded by u_max. The theorems know no such bound: the claims about runs are told for "
        "these initial values, and from others a control at its bound may fail to bring the actions back."
    )
    notes = [told]
    if run is not None:
        held = at_bound(run.u, game)
        if held.any():
            players = [str(i + 1) for i in np.flatnonzero(held.any(axis=(0, 2)))]
            moments = held.any(axis=(1, 2))
            notes.append(
                f"In the default experiment controls of player {', '.join(players)} are at their bounds at "
                f"{moments.mean():.0%} of the samples, the last at {run.time[moments][-1]:.4g} s."
            )
        else:
            notes.append("In the default experiment no sampled control is at its bound.")
    return notes + _beyond_at_equilibrium(game)


def _beyond_at_equilibrium(game: GameParameters) -> list[str]:
    """Whose control would have to be larger than its bound to stay at x*: u = -g(x*) - d(t) there."""
    if has_expressions(game.expressions, *UNKNOWN):
        return []
    x_star = nash_equilibrium(game) if game.x_star is None else game.x_star
    g = np.einsum("ijl,jl->il", game.dynamics_linear, x_star)
    g = g + np.einsum("ijl,jl->il", game.dynamics_square, x_star**2)
    needed = np.abs(g) + game.disturbance_bound
    return [
        f"To stay at x* the control of player {i + 1} may have to reach {needed[i, k]:.4g}, beyond its bound "
        f"{game.u_max[i, k]:.4g}; then the loop linearized at x* without bounds is not the one that acts."
        for i, k in np.argwhere(needed > game.u_max)
    ]
