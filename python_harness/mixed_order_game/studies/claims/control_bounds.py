"""What bounds u_max of the controls do to the claims: the theorems know none."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...game.bounds import box_around, game_bounds
from ...game.definition import has_expressions
from ...game.parameters import FloatArray, GameParameters
from ...results.result import Result
from ...results.unknown_term import UNKNOWN
from ...theory.spectrum import nash_equilibrium

MOST_TOLD = 8
"""Players of whom is told."""


def at_bound(u: FloatArray, game: GameParameters) -> NDArray[np.bool_]:
    """Where controls u (T, N, D) are at their bounds, up to the rounding of a result file."""
    return np.asarray(np.abs(u) >= game.u_max * (1.0 - 1e-12))


def control_bounds(run: Result | None, game: GameParameters, fmu: Path) -> list[str]:
    """What to tell of a game with bounded controls, and of its default experiment; empty for others."""
    if not np.isfinite(game.u_max).any():
        return []
    told = (
        "Controls are bounded by u_max. The theorems know no such bound: the claims about runs are told for "
        "these initial values, and from others a control at its bound may fail to bring the actions back."
    )
    notes = [told]
    if run is not None:
        held = np.any(at_bound(run.u, game), axis=2)  # (T, N)
        until = {i: float(run.time[held[:, i]][-1]) for i in np.flatnonzero(held.any(axis=0))}
        longest = sorted(until, key=lambda i: -until[i])
        told_of = [f"of player {i + 1} until {until[i]:.4g} s" for i in longest[:MOST_TOLD]]
        if len(longest) > MOST_TOLD:
            told_of.append(f"of {len(longest) - MOST_TOLD} more players before")
        notes.append(
            f"In the default experiment controls are at their bounds, {', '.join(told_of)}."
            if told_of
            else "In the default experiment no sampled control is at its bound."
        )
    return notes + _beyond_at_equilibrium(game, fmu)


def _beyond_at_equilibrium(game: GameParameters, fmu: Path) -> list[str]:
    """Whose control would have to be larger than its bound to stay at x*: u = -g(x*) - d(t) there."""
    needed = _drive_at_equilibrium(game, fmu)
    over = np.where(np.isfinite(game.u_max) & np.isfinite(needed), needed - game.u_max, -np.inf)
    farthest = np.argmax(over, axis=1)
    beyond = [(i, k) for i, k in enumerate(farthest) if over[i, k] > 0.0]
    return [
        f"To stay at x* the control of player {i + 1} may have to reach {needed[i, k]:.4g}, beyond its bound "
        f"{game.u_max[i, k]:.4g}; then the loop linearized at x* without bounds is not the one that acts."
        for i, k in beyond[:MOST_TOLD]
    ] + ([f"So it is for {len(beyond) - MOST_TOLD} more players."] if len(beyond) > MOST_TOLD else [])


def _drive_at_equilibrium(game: GameParameters, fmu: Path) -> FloatArray:
    """|g_il(x*)| + |d_il| at most, (N, D); of expressions as far as it is proved, inf where nothing is."""
    x_star = nash_equilibrium(game) if game.x_star is None else game.x_star
    if has_expressions(game.expressions, *UNKNOWN):
        found = game_bounds(fmu, box_around(x_star, 0.0), x_star)
        return np.asarray(found.dynamics_size + found.disturbance_size)
    g = np.einsum("ijl,jl->il", game.dynamics_linear, x_star)
    g = g + np.einsum("ijl,jl->il", game.dynamics_square, x_star**2)
    return np.asarray(np.abs(g) + game.disturbance_bound)
