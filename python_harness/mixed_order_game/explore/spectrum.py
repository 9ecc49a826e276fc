"""Eigenvalues of the unperturbed loop for the values on the page, and the word for its badge."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MixedOrderGameError
from ..fmu.model import Value
from ..fmu.run import Simulator
from ..game.definition import has_expressions
from ..game.parameters import GameParameters, game_parameters
from ..theory.exact_loop import LARGEST_LINEAR_LOOP
from ..theory.graph import is_connected
from ..theory.growing_modes import stability
from ..theory.linearized import linearized_loop
from ..theory.spectrum import linear_loop

FloatArray = NDArray[np.float64]

STABLE, UNSTABLE, NOT_DECIDED, NOT_COMPUTED = "stable", "unstable", "not decided", "not computed"

PATIENCE = 10.0
"""Time in s that eigenvalues of a large loop may be counted for."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """What is known of the unperturbed loop's modes."""

    eigenvalues: NDArray[np.complex128]  # (n,), 1/s; empty where they are not computed
    verdict: str  # STABLE, UNSTABLE, NOT_DECIDED or NOT_COMPUTED
    reason: str  # one sentence

    def as_json(self) -> dict[str, Any]:
        """Plain values for json.dumps, eigenvalues to seven digits."""
        return {
            "real": [float(f"{value:.7g}") for value in self.eigenvalues.real],
            "imaginary": [float(f"{value:.7g}") for value in self.eigenvalues.imag],
            "verdict": self.verdict,
            "reason": self.reason,
        }


def spectrum_of(simulator: Simulator, changes: Mapping[str, Value]) -> Spectrum:
    """Of quadratic costs that of one coordinate's loop, which is linear; otherwise that at x*.

    What the FMU refuses, and a loop that is too large, is the reason of one that is not computed.
    """
    near = "" if has_expressions(simulator.model.expressions, "cost") is None else " near x*"
    try:
        if near:
            loop = linearized_loop(simulator, changes)
            game, is_large = loop.game, loop.is_large
        else:
            game = game_parameters(simulator.model, changes)
            is_large = game.players > LARGEST_LINEAR_LOOP
    except MixedOrderGameError as error:
        return Spectrum(np.empty(0, dtype=complex), NOT_COMPUTED, f"{error}.")
    if is_large:
        return _counted(game, near)
    matrix = linear_loop(game)
    eigenvalues = np.linalg.eigvals(matrix).astype(complex)
    rounding = len(matrix) * float(np.finfo(float).eps) * float(np.abs(matrix).max())
    verdict, reason = _judged(float(eigenvalues.real.max()), rounding, is_connected(game.adjacency), near)
    return Spectrum(eigenvalues, verdict, reason)


def _counted(game: GameParameters, near: str) -> Spectrum:
    """Of a large loop: no eigenvalues, but whether some have positive real parts."""
    judged = stability(game, rate=False, time_limit=PATIENCE)
    verdict = {True: STABLE, False: UNSTABLE, None: NOT_COMPUTED}[judged.stable]
    drawn = "" if judged.stable is None else f"{near}; they are too many to be drawn"
    return Spectrum(np.empty(0, dtype=complex), verdict, f"{judged.told[0].upper()}{judged.told[1:]}{drawn}.")


def _judged(abscissa: float, rounding: float, connected: bool, near: str) -> tuple[str, str]:  # noqa: FBT001
    """Verdict and reason for a largest real part in 1/s, of which rounding is not known."""
    if abscissa > rounding:
        return UNSTABLE, f"A mode grows{near} at {abscissa:.4g} 1/s."
    if not connected:
        return NOT_DECIDED, "The graph is not connected: some estimates are corrected by nothing."
    if abscissa >= -rounding:
        return NOT_DECIDED, f"The largest real part{near} is zero to rounding."
    return STABLE, f"The slowest mode{near} decays at {-abscissa:.4g} 1/s."
